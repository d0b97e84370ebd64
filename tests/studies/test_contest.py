"""The comparison at equal budget: its files, and the rules by which it judges."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import runtime
from runtime.document import dump_yaml
from runtime.document.loader import SHIPPED
from tests.studies.causes import CASES
from tests.studies.contest import budgets, fronts, opening, weaknesses
from tests.studies.contest.contestants import (
    TASKS,
    experiment,
    file_of,
)
from tests.studies.contest.results import (
    CHANGE,
    ERROR,
    RIVAL,
    Contest,
    Contestant,
    by_condition,
    verdicts,
)

CONDITIONS = [f"condition {i}" for i in range(8)]
NOISE = np.random.default_rng(3).normal(0.0, 1e-4, (len(CONDITIONS), 2))


def contestant(name: str, errors: dict[str, float], spread: float = 0.0, **more: Any) -> Contestant:
    """A contestant with an error for each condition, with noise of its own over the seeds."""
    runs = {
        (condition, seed): {ERROR: error + spread * NOISE[i, seed], CHANGE: 0.1}
        for i, (condition, error) in enumerate(errors.items())
        for seed in range(2)
    }
    return Contestant(name, more, 1, runs)


def even(error: float) -> dict[str, float]:
    return dict.fromkeys(CONDITIONS, error)


def test_the_files_are_those_that_the_code_writes() -> None:
    for limit, name in [
        (limit, name) for limit, task in TASKS.items() for name in task.contestants
    ]:
        text = file_of(name, limit).read_text(encoding="utf-8")
        assert text.endswith(dump_yaml(experiment(name, limit))), file_of(name, limit)


def test_every_contestant_has_the_same_runs_and_budget() -> None:
    keys = ("training", "held_out", "trials", "sampler", "constraints", "minimize")
    for limit, task in TASKS.items():
        first, *others = (
            {key: experiment(name, limit)[key] for key in keys} for name in task.contestants
        )
        assert all(other == first for other in others)


def test_verdicts_follow_from_differences() -> None:
    rival = contestant(RIVAL, even(0.010))
    mixed = {name: 0.010 + (0.02 if i % 2 else -0.018) for i, name in enumerate(CONDITIONS)}
    found = [
        rival,
        contestant("worse", even(0.013), spread=1.0),
        contestant("better", even(0.007), spread=1.0),
        contestant("equivalent", even(0.0102), spread=1.0),
        contestant("undecided", mixed, spread=1.0),
    ]
    assert {name: v.word for name, v in verdicts(found, rival, 1e-3).items()} == {
        name: name for name in ("worse", "better", "equivalent", "undecided")
    }


def test_a_condition_counts_as_one_value() -> None:
    """Seeds that repeat a condition do not narrow the interval."""
    errors = {name: 0.01 + 0.001 * i for i, name in enumerate(CONDITIONS)}
    found = contestant("any", errors).held_out(ERROR)
    values = list(errors.values())
    low, high = stats.t.interval(0.95, len(values) - 1, np.mean(values), stats.sem(values))
    assert (found.n, found.low, found.high) == (8, pytest.approx(low), pytest.approx(high))
    assert by_condition({("a", 0): 1.0, ("a", 1): 3.0, ("b", 0): math.nan}) == {"a": 2.0}


def test_a_verdict_that_a_doubled_rival_turns_does_not_survive(tmp_path: Path) -> None:
    contest = Contest(tmp_path)
    contest.limits["gentle"] = [
        contestant(RIVAL, even(0.010)),
        contestant("other", even(0.007), spread=1.0),
        contestant("far", even(0.030), spread=1.0),
    ]
    assert budgets.section(contest) == "" and budgets.changed(contest) == (0, 0)
    contest.doubled["gentle"] = [contestant(RIVAL, even(0.004))]
    assert budgets.changed(contest) == (1, 2)
    (_, _, before, after, both), far = budgets.rows(contest)
    assert (before.word, both) == ("better", None)
    assert after is not None and after.word == "worse"
    assert far[2].word == "worse"
    assert far[3] is not None and far[3].word == "worse"
    told = budgets.settled(contest, "gentle", contest.limits["gentle"][0])
    assert {name: verdict.word for name, verdict in told.items()} == {
        "other": "undecided",
        "far": "worse",
    }


def test_the_page_begins_with_what_the_numbers_say(tmp_path: Path) -> None:
    contest = Contest(tmp_path)
    untuned = {"metric": ERROR, "configuration": 0, "held_out": {"mean": 0.0179}}
    contest.limits["gentle"] = [
        contestant(RIVAL, even(0.010), trials=40, table=[untuned]),
        contestant("LQR without feedforward", even(0.030), spread=1.0),
        contestant("lateral rule", even(0.007), spread=1.0),
        contestant("robust rule", even(0.0102), spread=1.0),
        contestant("robust rule, MRAC for spikes", even(0.0097), spread=1.0),
    ]
    protocol, rival, spikes, feedforward, neurons = opening.sentences(contest)
    assert protocol.startswith("5 controllers") and " 40 trials " in protocol
    assert "10.0 mm in case C (gentle; the best, lateral rule, by 7.0 mm)" in rival
    assert "nobody tuned, by 17.9 mm" in rival
    assert "of 2 comparisons, better in 1 (case C) and equivalent in 1 (case C)" in spikes
    assert "costs +20.0 [" in feedforward
    assert "-0.5 mm (MRAC, gentle)" in neurons
    rows = opening.verdict_table(contest).splitlines()
    assert any(
        row.startswith("| lateral rule | -3.0 [") and row.endswith("better |") for row in rows
    )


CASE = ("v_r", "gain")  # the reference speed is the case's


def test_the_shipped_robust_graphs_differ_from_their_cases_by_one_rule() -> None:
    """The same blocks with the same parameters; v_r, a param of each case, is not the rule's."""

    def parameters(name: str) -> dict[str, tuple[str, dict[str, object]]]:
        return {
            key: (
                entry.cls.__name__,
                {p: str(v) for p, v in entry.block.parameters().items() if p not in CASE},
            )
            for key, entry in runtime.load(name).network.entries.items()
        }

    rules = []
    for case in CASES.values():
        plain, robust = parameters(case), parameters(f"{case}_robust")
        rules.append({key: robust[key] for key in robust if robust[key] != plain.get(key)})
    assert rules[0] == rules[1] == rules[2]
    assert "adaptive.snn_omega" in rules[0]


def test_the_shipped_setting_is_the_one_that_was_found() -> None:
    text = (SHIPPED.parent / "docs" / "comparison.md").read_text(encoding="utf-8")
    (told,) = re.findall(r"found one setting .*?trials: (.*?)\.\n", text, re.S)
    found = re.findall(r"`(\S+)` = (\S+?)(?:,|$)", told)
    assert len(found) == 5
    entries = runtime.load("wall_following_robust").network.entries
    for path, value in found:
        address = path.replace("adaptive.params", "adaptive.snn_omega")
        block, _, key = address.rpartition(".")
        assert entries[block].block.value(key) == float(value), path


def test_one_setting_has_no_constant_that_differs_from_case_to_case() -> None:
    assert weaknesses.differing(weaknesses.ROBUST) == 0
    assert weaknesses.differing(weaknesses.LATERAL) > 0


def test_the_front_has_what_nobody_beats_in_both() -> None:
    points = [fronts.Point(f"{e},{c}", e, c) for e, c in ((1, 9), (2, 5), (3, 5), (4, 1), (5, 2))]
    assert [one.name for one in fronts.front(points)] == ["4,1", "2,5", "1,9"]
