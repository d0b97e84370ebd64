"""Quantiles and the worst value in the table of an ablation, against numpy by hand."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import runtime
from runtime.experiments.analysis.samples import quantile_of
from tests.conftest import Run
from tests.runtime.experiments.graphs import normal

SEEDS = 6
NOISE = np.array([normal(seed) for seed in range(SEEDS)])
DRAWN = 1.0 + NOISE  # of the only level of the graph
GAINS = {"baseline": 2.0, "half": 3.0}
LEVELS = np.array([0.0, 1.0, 2.0, 9.0])
HEAD = "experiment: tails\ngraph: draw.yaml\nseeds: 0..5\nmetrics: [total]\nminimize: total\n"
TAILS = "quantile: [0.9, 0.5]\nworst: true\n"
VARIANTS = "variants:\n  half: {bypass: half}\n"
STATISTICS = ["mean", "0.9-quantile", "0.5-quantile", "worst"]
Lines = dict[tuple[str, str], dict[str, Any]]


def ablated(here: Run, folder: Path, text: str) -> tuple[Lines, str]:
    """The lines over all settings by statistic and variant, and the table as text."""
    (folder / "tails.yaml").write_text(HEAD + text)
    done = here("ablate", "tails.yaml", "--json", "--no-plots", "--test", "t")
    assert done.returncode == 0, done.stderr
    shown = here("ablate", "tails.yaml", "--no-plots", "--test", "t", "--resume").stdout
    facts = json.loads(done.stdout)
    assert here("report", facts["folder"]).returncode == 0
    return {
        (line["statistic"], line["variant"]): line
        for line in facts["table"]
        if not line["setting"] and line["metric"] == "total"
    }, shown


def q(share: float) -> Any:
    return lambda values, axis: np.quantile(values, share, axis=axis)


def test_a_tail_is_of_each_seed_over_the_settings(here: Run, draw: Path, tmp_path: Path) -> None:
    """total = gain (level + noise); the gain is 2, and 3 where half is bypassed."""
    crossed = "vary: {draw.level: [0, 1, 2, 9]}\n"
    lines, shown = ablated(here, tmp_path, TAILS + crossed + VARIANTS)
    runs = LEVELS[:, None] + NOISE
    of = dict(zip(STATISTICS, (np.mean, q(0.9), q(0.5), np.max), strict=True))
    assert list(dict.fromkeys(statistic for statistic, _ in lines)) == STATISTICS
    for statistic, function in of.items():
        values = {name: function(gain * runs, axis=0) for name, gain in GAINS.items()}
        for name, own in values.items():
            line = lines[statistic, name]
            assert line["mean"] == pytest.approx(own.mean()) and line["n"] == SEEDS
            half = stats.t.ppf(0.975, SEEDS - 1) * own.std(ddof=1) / math.sqrt(SEEDS)
            assert line["high"] - line["mean"] == pytest.approx(half)
        apart = lines[statistic, "half"]["difference"]
        assert apart["mean"] == pytest.approx((values["half"] - values["baseline"]).mean())
        assert apart["p"] == pytest.approx(stats.ttest_rel(*reversed(values.values())).pvalue)
        assert apart["p_adjusted"] is not None
    assert ", 0.9-quantile\n" in shown and ", worst\n" in shown


def test_of_one_setting_a_tail_is_one_number(here: Run, draw: Path, tmp_path: Path) -> None:
    lines, shown = ablated(here, tmp_path, TAILS + VARIANTS)
    for statistic, number in (("0.9-quantile", np.quantile(DRAWN, 0.9)), ("worst", DRAWN.max())):
        line = lines[statistic, "half"]
        assert line["mean"] == pytest.approx(3.0 * number) and line["low"] is None
        apart = line["difference"]
        assert apart["mean"] == pytest.approx(number) and apart["low"] is None
        assert apart["p"] is apart["p_adjusted"] is apart["p_presence"] is None
        assert apart["verdict"] == ""
    assert "0.9-quantile, 0.5-quantile, worst: one number of all observations" in shown
    assert "too few pairs" not in shown
    # They weaken no correction: nothing else is tested than without them.
    (mean,) = [line["difference"] for (name, _), line in lines.items() if name == "mean"][1:]
    assert mean["p_adjusted"] == mean["p"]


def test_of_drawn_settings_it_is_one_number_of_their_means(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    drawn = "random: 5\nvary: {draw.level: 0..9}\n"
    (tmp_path / "tails.yaml").write_text(HEAD + TAILS + drawn + VARIANTS)
    table = runtime.ablate(tmp_path / "tails.yaml", jobs=1)
    runs = [trial.metrics["total"] for trial in table.trials if trial.values["variant"] == "half"]
    means = np.array(runs, dtype=float).reshape(5, SEEDS).mean(axis=1)
    line = table.line("half", "total", "0.9-quantile")
    assert line.own.mean == pytest.approx(np.quantile(means, 0.9)) and line.is_single


@pytest.mark.parametrize(("goal", "worst"), [("minimize", np.max), ("maximize", np.min)])
def test_the_worst_follows_the_direction(
    here: Run, draw: Path, tmp_path: Path, goal: str, worst: Any
) -> None:
    text = (HEAD + "worst: true\n" + VARIANTS).replace("minimize", goal)
    (tmp_path / "tails.yaml").write_text(text)
    table = runtime.ablate(tmp_path / "tails.yaml", jobs=1)
    assert table.line("half", "total", "worst").own.mean == pytest.approx(3.0 * worst(DRAWN))
    assert table.line("half", "total").statistic == "mean"


def test_a_failed_run_is_the_worst_value(here: Run, draw: Path, tmp_path: Path) -> None:
    failing = "variants:\n  bad: {set: {draw.raises: ValueError}}\n"
    lines, shown = ablated(here, tmp_path, "worst: true\n" + failing)
    line = lines["worst", "bad"]
    assert line["mean"] is None and line["failed"] == 1 and line["difference"]["verdict"] == ""
    assert "failed" in shown.partition("worst\n")[2]


def test_a_metric_without_a_direction_has_no_worst_value(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    (tmp_path / "tails.yaml").write_text(
        HEAD.replace("minimize: total\n", "worst: true\n") + VARIANTS
    )
    shown = here("ablate", "tails.yaml", "--no-plots").stdout
    assert "no worst value, since neither less nor more is: total" in shown
    assert ", worst\n" not in shown


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20), st.floats(0.0, 1.0))
def test_a_quantile_is_numpys(values: list[float], share: float) -> None:
    scale = max(map(abs, values))
    assert quantile_of(values, share) == pytest.approx(np.quantile(values, share), abs=1e-7 * scale)


def test_infinite_values_are_ends_of_a_quantile() -> None:
    values = [1.0, 2.0, 3.0, 4.0, math.inf]
    assert quantile_of(values, 0.75) == 4.0  # numpy's is NaN: 0 times infinity
    assert quantile_of(values, 0.8) == math.inf
    assert quantile_of([-math.inf, 1.0, 2.0], 0.25) == -math.inf
    assert quantile_of([-math.inf, math.inf], 0.5) is None
    assert quantile_of([1.0, None], 0.5) is None


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("quantile: 90", "9:11: quantile: expected a number between 0 and 1, as 0.9, got 90"),
        ("quantile: [0.9, 1.0]", "9:17: quantile: expected a number between 0 and 1"),
        ("quantile: true", "9:11: quantile: expected a number between 0 and 1"),
        ("quantile: {total: 0.9}", "quantile: expected a number between 0 and 1"),
        ("worst: total", "9:8: worst: expected one of true, false, got the string"),
        ("worst: 1", "9:8: worst: expected one of true, false, got 1"),
    ],
)
def test_a_wrong_entry_is_reported_where_it_is(
    here: Run, draw: Path, tmp_path: Path, entry: str, message: str
) -> None:
    (tmp_path / "tails.yaml").write_text(HEAD + VARIANTS + "until: 0.05\n" + entry + "\n")
    done = here("ablate", "tails.yaml")
    assert done.returncode == 2 and message in done.stderr


def test_a_tuning_does_not_use_them(here: Run, draw: Path, tmp_path: Path) -> None:
    text = HEAD.replace("metrics: [total]\n", "") + "vary: {draw.level: 0..1}\nworst: true\n"
    (tmp_path / "tails.yaml").write_text(text)
    done = here("tune", "tails.yaml", "--trials", "2")
    assert done.returncode == 2 and "worst: 'runtime tune' does not use it" in done.stderr
