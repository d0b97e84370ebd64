"""The registered comparison: its plan, its intervals, its page."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from runtime.errors import UsageError
from tests.studies.comparison import judge, page, plan, register, rows

TASKS = list(plan.read()["tasks"])


@pytest.mark.parametrize("task", TASKS)
def test_conditions_are_drawn_anew_and_inside_their_ranges(task: str) -> None:
    training, held_out = (plan.conditions(task, part) for part in (plan.TRAINING, plan.HELD_OUT))
    drawn = [repr(each) for each in (*training.values(), *held_out.values())]
    assert len(set(drawn)) == len(drawn)
    entry = plan.read()["tasks"][task]
    for name, condition in held_out.items():
        draws = entry["draws"] | entry.get("group_draws", {}).get(plan.group_of(name), {})
        for path, how in draws.items():
            if "uniform" in how:
                values = np.atleast_1d(condition["set"][path])
                assert np.all((how["uniform"][0] <= values) & (values <= how["uniform"][1]))


def test_contestants_of_a_task_share_runs_and_limits() -> None:
    """A contest has one entry of each; only changes and factors are a contestant's own."""
    for task in TASKS:
        contestants = plan.experiment(task)["contestants"]
        keys = {key for each in contestants.values() for key in each}
        assert keys <= {"with", "set", "replace", "without", "vary"}
        names = ("MRAC", "features", "rate neurons", "spikes")
        learners = [contestants[name] for name in names if name in contestants]
        assert all(each["vary"] == learners[0]["vary"] for each in learners)


def test_the_interval_of_conditions_alone_is_that_of_paired_t() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.normal(0.1, 0.2, 9), rng.normal(0.0, 0.2, 9)
    found = judge.contrast(a.reshape(1, 9, 1), b.reshape(1, 9, 1), 0.2)
    expected = stats.ttest_rel(a, b)
    low, high = expected.confidence_interval()
    assert (found.low, found.high) == pytest.approx((low, high))
    assert found.p == pytest.approx(expected.pvalue)


def test_the_interval_of_tunings_alone_is_that_of_welch() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.normal(0.1, 0.2, 5), rng.normal(0.0, 0.05, 7)
    found = judge.contrast(a.reshape(5, 1, 1), b.reshape(7, 1, 1), 0.2)
    expected = stats.ttest_ind(a, b, equal_var=False)
    low, high = expected.confidence_interval()
    assert (found.low, found.high) == pytest.approx((low, high))


def test_a_verdict_is_no_narrower_than_either_of_its_intervals() -> None:
    rng = np.random.default_rng(5)
    for shape in ((5, 10, 2), (1, 9, 1), (16, 8, 2)):
        a, b = np.exp(rng.normal(0.1, 0.8, shape)), rng.normal(0.0, 0.2, shape)
        plain, found = judge.contrast(a, b, 0.2), judge.judged(a, b, 0.2)
        assert found.low <= plain.low < plain.high <= found.high
        assert found.p >= plain.p and found.p_equivalent >= plain.p_equivalent
        assert judge.judged(a, b, 0.2) == found


def test_a_studentized_bootstrap_of_pairs_is_that_of_its_definition() -> None:
    """With conditions alone: t of each draw by its own mean and standard error."""
    rng = np.random.default_rng(6)
    apart = rng.exponential(1.0, 12)
    a, b = apart.reshape(1, 12, 1), np.zeros((1, 12, 1))
    found = judge.judged(a, b, 0.2, times=4000)
    draws = apart[rng.integers(0, 12, (4000, 12))]
    t = (draws.mean(axis=1) - apart.mean()) / (draws.std(axis=1, ddof=1) / np.sqrt(12))
    error = apart.std(ddof=1) / np.sqrt(12)
    low, high = apart.mean() - np.quantile(t, [0.975, 0.025]) * error
    plain = judge.contrast(a, b, 0.2)
    assert found.high == pytest.approx(max(high, plain.high), rel=0.05)
    assert found.low == pytest.approx(min(low, plain.low), rel=0.1)
    # Errors with a long upper tail: what the sample may have missed is above its mean.
    assert found.high > plain.high and found.low == plain.low


def test_lines_of_the_same_two_are_corrected_together(monkeypatch: pytest.MonkeyPatch) -> None:
    def line(one: str, other: str, p: float) -> judge.Answer:
        contrast = judge.Contrast(0.0, -0.1, 0.1, 1.0 - p, p)
        return judge.Answer("path", "heals", "error", one, other, contrast, 1.0)

    lines = [line("a", "b", 0.02), line("a", "c", 0.9), line("a", "b", 0.04), line("a", "c", 0.8)]
    monkeypatch.setattr(judge, "_answers", lambda question: iter(lines))
    found = [each.contrast.p_equivalent for each in judge.answers({})]
    assert found == pytest.approx([0.04, 0.9, 0.04, 0.9])


def test_words_follow_from_p_and_failures() -> None:
    better = judge.Contrast(-0.5, -0.6, -0.4, 0.001, 1.0)
    assert better.word == "better"
    assert judge.Contrast(-0.5, -0.6, -0.4, 0.001, 1.0, (3, 0)).word == "undecided"
    assert judge.Contrast(0.5, 0.4, 0.6, 0.001, 1.0, (3, 0)).word == "worse"
    assert judge.Contrast(0.05, 0.0, 0.1, 0.04, 0.01).word == "equivalent"
    assert judge.Contrast(0.05, -0.5, 0.6, 0.8, 0.4).word == "undecided"


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(5, 10, 2), (5, 6, 2), (3, 10, 2)])
def test_intervals_cover_and_bootstraps_do_not(shape: tuple[int, int, int]) -> None:
    """1,000 studies in which nothing differs; a standard error of 0.7 % at 95 %."""
    interval, bootstrap = judge.coverage(shape)
    assert 0.93 < interval < 0.99
    assert bootstrap < 0.95


def test_no_run_is_older_than_the_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    if not register.commits():
        pytest.skip("there is no history")
    early = datetime(2020, 1, 1, tzinfo=UTC)
    monkeypatch.setattr(rows, "tasks", lambda: ["path"])
    monkeypatch.setattr(rows, "began", lambda task: {("LQR", 0): early})
    (problem,) = register.problems()
    assert problem.startswith("path: LQR, tuning 0 began 2020-01-01 00:00:00, before its entry")


def test_a_run_is_compared_with_the_change_of_its_own_entry(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A second commit gives the LQR more patience; what began in between is only right for PID."""
    first, second = (datetime(2026, 1, day, tzinfo=UTC) for day in (1, 3))

    def version(patience: int) -> dict[str, Any]:
        contestants = {"LQR": {"patience": patience}, "PID": {}}
        return {"tasks": {"path": {"title": str(patience), "contestants": contestants}}}

    plans = {"a": version(5), "b": version(15)}
    monkeypatch.setattr(register, "commits", lambda: [("a", first, "one"), ("b", second, "two")])
    monkeypatch.setattr(register, "_plan_of", plans.__getitem__)
    monkeypatch.setattr(plan, "read", lambda: {"deviations": ["two: more patience"]})
    between = datetime(2026, 1, 2, tzinfo=UTC)
    monkeypatch.setattr(rows, "tasks", lambda: ["path"])
    monkeypatch.setattr(rows, "began", lambda task: {("LQR", 0): between, ("PID", 0): between})
    (problem,) = register.problems()
    assert problem.startswith("path: LQR, tuning 0 began 2026-01-02")
    assert "(b, 2026-01-03" in problem


def test_a_failed_run_is_worse_than_any_value(monkeypatch: pytest.MonkeyPatch) -> None:
    one = {"heals 0": None, "heals 1": 0.4, "switching 0": 9.0}
    runs = {(t, name, 1): error for t in range(3) for name, error in one.items()}
    monkeypatch.setattr(rows, "held_out", lambda task, metric: {"one": runs})
    found = judge.cells("path", "error", "heals")["one"]
    assert found.failed == 3
    assert np.exp(found.values).ravel() == pytest.approx([0.5, 0.4] * 3)
    assert judge.cells("path", "error", "switching")["one"].failed == 3


@pytest.mark.skipif(not rows.tasks(), reason="nothing has been run")
def test_the_page_is_that_of_the_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = page.PAGE.read_text(encoding="utf-8")
    monkeypatch.setattr(page, "PAGE", tmp_path / "page.md")
    monkeypatch.setattr(page, "IMAGES", tmp_path)
    page.write()
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == written
    assert all(math.isfinite(x.contrast.mean) for x in judge.answers(plan.read()["questions"][0]))


def test_runs_of_one_tuning_have_what_it_entered() -> None:
    """What was judged has the smallest mean error of those within the limit of effort."""
    limit = plan.read()["tasks"]["path"]["effort"]
    for name in ("LQR", "spikes"):
        values = rows.entered("path", name, 0)
        assert set(values) == set(plan.factors("path", name))
        entry = plan.experiment("again", name, values, 0)["contestants"][name]
        assert entry["set"] | values == entry["set"]
        assert "vary" not in entry
        tried: dict[str, list[rows.Row]] = {}
        for row in rows.read("path"):
            mine = (row["contestant"], row["tuning"], row["part"]) == (name, "0", plan.TRAINING)
            if mine:
                tried.setdefault(row["values"], []).append(row)
        means = {
            cells: np.mean([float(row["error"]) for row in runs])
            for cells, runs in tried.items()
            if all(row["error"] for row in runs)
            and np.mean([float(row["effort"]) for row in runs]) < limit
        }
        best = min(means, key=means.__getitem__)
        assert list(values.values()) == [float(cell) for cell in best.split(",")]


def test_what_no_tuning_entered_is_not_made_up() -> None:
    with pytest.raises(UsageError, match="tuning 99 of spikes has no held-out run in task path"):
        rows.entered("path", "spikes", 99)


def test_controllers_that_are_given_have_no_scatter_of_tunings() -> None:
    rng = np.random.default_rng(4)
    a, b = rng.normal(0.0, 0.3, (5, 1, 1)) + np.zeros((5, 9, 2)), rng.normal(0, 0.1, (5, 9, 2))
    wide, narrow = (judge.contrast(a, b, 0.2, of_these=only) for only in (False, True))
    assert narrow.mean == wide.mean
    assert narrow.high - narrow.low < 0.5 * (wide.high - wide.low)


def test_an_interrupted_tuning_has_no_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its held-out runs are not those of the others, so that pairs would be wrong."""
    monkeypatch.setattr(rows, "tasks", lambda: [])
    own = tmp_path / "LQR-0"
    own.mkdir()
    (own / "tuning.json").write_text('{"status": "interrupted"}', encoding="utf-8")
    with pytest.raises(UsageError, match="no judged tuning"):
        rows.gather("path", tmp_path)
