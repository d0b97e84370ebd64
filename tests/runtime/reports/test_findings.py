"""The sentence that a report begins with says what its numbers say."""

from __future__ import annotations

import math
from typing import Any

import pytest

import runtime
from runtime.reports import pieces
from runtime.reports.findings import of_ablation, of_contest, of_run, of_sweep, of_tuning


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        *((0.005885, "m", "5.885 mm"), (12.97, "s", "12.97 s"), (0.254, "m", "0.254 m")),
        *((-2.5e-6, "A", "−2.5 µA"), (0.0, "m", "0 m"), (0.002, "rad", "0.002 rad")),
        *((12_500.0, "Hz", "12.5 kHz"), (3.0, "", "3"), (0.01, "m/s", "0.01 m/s")),
        (float("inf"), "s", "inf s"),
    ],
)
def test_a_quantity_has_a_prefix_where_that_is_shorter(value: float, unit: str, text: str) -> None:
    assert pieces.quantity(value, unit) == text


def test_a_run_says_its_metrics_and_what_failed() -> None:
    graph = runtime.load("gallery/step_feedback")
    assert of_run(graph.run(until=0.1)) == ""
    graph = graph.metric("last", "final", of="plant.out")
    result = graph.run()
    assert of_run(result) == f"Last {pieces.quantity(result.metrics['last'] or 0.0, '')}."
    strict = graph.set("metrics.last.below", 0.1)
    assert of_run(strict.run()).startswith("1 expectation failed: ")


def line(variant: str, n: int, mean: float | None, **difference: Any) -> dict[str, Any]:
    """A line of an ablation's table with 10 seeds."""
    whole = {
        "n": n,
        "mean": mean,
        "p_adjusted": 0.2,
        "p_presence": None,
        "distinguishable": False,
        **difference,
    }
    is_own = variant == "baseline"
    facts = {"variant": variant, "metric": "settled_at", "runs": 10, "n": n, "mean": mean}
    return {**facts, "difference": None if is_own else whole}


def told(*lines: dict[str, Any]) -> str:
    facts = {"table": lines, "units": {"settled_at": "s"}}
    return of_ablation({**facts, "never": {"settled_at": "never settled"}})


def test_an_ablation_says_what_differs_significantly() -> None:
    own = line("baseline", 10, 12.0)
    without = line("without net", 0, None, distinguishable=True, p_presence=0.002)
    text = "The baseline settled in 10 of 10 runs, without net in none (p = 0.002)."
    assert told(own, without) == text
    slower = line("bypass limit", 10, 0.024, verdict="yes", p_adjusted=3e-6)
    text = "Bypass limit: settled at 24 ms instead of 12 s, over 10 seeds (p < 0.0001)."
    assert told(own, slower) == text
    assert told(own, line("same", 10, 12.1)) == (
        "No variant differs significantly from the baseline in any metric."
    )
    # One run of ten more is no result of McNemar's test; what was tested are the ranks.
    once = line("rough", 9, 2.0, verdict="yes", p_adjusted=0.01, never=1)
    assert told(own, once) == (
        "Rough: settled at differs from the baseline's by signed ranks, in which a run that failed "
        "or never settled is the worst; 9 of 10 runs have a value, and 10 of the baseline's "
        "(p = 0.01)."
    )
    # A verdict in words is later than a truth value, and decides.
    assert "No variant" in told(own, line("x", 10, 1.0, verdict="negligible", distinguishable=True))
    assert told(own) == ""
    many = [line(f"v{i}", 10, 1.0, distinguishable=True) for i in range(5)]
    assert told(own, *many).endswith(
        "5 variants differ significantly from the baseline in at least one metric."
    )


def test_counts_are_those_of_runs_that_lack_a_value() -> None:
    """One run that stands for all, since they are equal, is no count of runs with a value."""
    own = line("baseline", 10, 12.0)
    same = {**line("without net", 1, 24.0, verdict="yes", p_adjusted=0.001), "identical": True}
    assert told(own, same) == (
        "Without net: settled at 24 s (the seed changes nothing) instead of 12 s, over 10 seeds "
        "(p = 0.001)."
    )
    both = {**line("without net", 1, 24.0, verdict="n = 1", p_adjusted=None), "identical": True}
    assert told({**line("baseline", 1, 12.0), "identical": True}, both) == (
        "Without net: settled at 24 s (the seed changes nothing) instead of 12 s (the seed changes "
        "nothing)."
    )
    crashed = line("without net", 0, None, verdict="yes, in seeds", p_presence=0.002)
    assert told(own, {**crashed, "failed": 10}) == (
        "The baseline settled in 10 of 10 runs, without net in none, 10 failed (p = 0.002)."
    )
    # The line of one setting is not that of all, and that of the worst run is not the mean.
    setting = {**line("baseline", 3, 99.0), "setting": "wind=2"}
    slower = line("bypass limit", 10, 24.0, verdict="yes", p_adjusted=0.01)
    worst = {**line("baseline", 10, 99.0), "statistic": "worst"}
    assert told(own, setting, worst, slower).startswith(
        "Bypass limit: settled at 24 s instead of 12 s"
    )


@pytest.mark.parametrize(
    ("verdicts", "text"),
    [
        (("equal", "equal"), "No variant differs from the baseline in any metric."),
        (
            ("too few pairs", "-"),
            "No difference from the baseline was tested: too few pairs.",
        ),
        (
            ("too few pairs", "no"),
            "No variant differs significantly from the baseline in any metric; of 1 there are too "
            "few pairs.",
        ),
    ],
)
def test_what_was_not_tested_is_not_called_insignificant(
    verdicts: tuple[str, ...], text: str
) -> None:
    variants = [line(f"v{i}", 10, 12.5, verdict=verdict) for i, verdict in enumerate(verdicts)]
    assert told(line("baseline", 10, 12.0), *variants) == text


def test_a_contestant_whose_runs_are_equal_has_all_of_them() -> None:
    def entry(name: str, reference: str | None, n: int, mean: float, **more: Any) -> dict[str, Any]:
        apart = None if reference is None else {"p_adjusted": 0.2, "verdict": "no"}
        facts = {"variant": name, "reference": reference, "metric": "total", "mean": mean, "n": n}
        return {**facts, "runs": 6, "difference": apart, **more}

    stored = {
        **{"metrics": ["total"], "units": {}, "paired_by": "seed", "minimize": "total"},
        "table": [entry("a", None, 6, 0.3), entry("b", "a", 1, 0.2, identical=True)],
    }
    found = of_contest(stored)
    assert found.startswith("Smallest total over 6 held-out seeds: b, 0.2 (the seed changes")
    failed = [entry("a", None, 6, 0.3), entry("b", "a", 0, math.nan, failed=6)]
    assert "b, failed in all of 6 runs" in of_contest({**stored, "table": failed})


def test_a_sweep_and_a_tuning_say_their_best() -> None:
    text = "Smallest mean error, 3 mm, at pid.kp = 2, x = [1, 2]."
    assert of_sweep(["pid.kp", "x"], ["2", "[1, 2]"], "mean_error", "minimize", 0.003, "m") == text
    stored = {
        "front": [7],
        "minimize": ["error"],
        "units": {"error": "m"},
        "table": [
            {"configuration": 0, "metric": "error", "held_out": {"n": 5, "mean": 0.4}},
            {
                **{"configuration": 7, "metric": "error"},
                "held_out": {"n": 5, "mean": 0.2, "difference": {"p_adjusted": 0.2}},
            },
        ],
    }
    assert of_tuning(stored) == (
        "Error on the held-out runs is 0.2 m with configuration 7, and 0.4 m with the graph's own "
        "values (not significant, p = 0.2)."
    )
    assert of_tuning({**stored, "front": []}) == ""


def test_a_contest_says_who_is_best_and_how_surely() -> None:
    def line(name: str, reference: str | None, mean: float, p: float, **more: Any) -> Any:
        apart = None if reference is None else {"p_adjusted": p, "verdict": "no", **more}
        n = 0 if math.isnan(mean) else 6
        return {
            **{"variant": name, "reference": reference, "metric": "total", "mean": mean},
            **{"n": n, "runs": 6, "difference": apart},
        }

    stored = {
        **{"metrics": ["total"], "units": {"total": "m"}, "paired_by": "condition"},
        "minimize": "total",
        "table": [
            line("a", None, 0.3, math.nan),
            line("b", "a", 0.2, 0.2),
            line("c", "a", math.nan, 0.03, verdict="yes"),
            line("c", "b", math.nan, 0.04, verdict="yes"),
        ],
    }
    assert of_contest(stored) == (
        "Smallest total over 6 held-out conditions: b, 0.2 m, instead of a, 0.3 m (not "
        "significant, p = 0.2); c, no value (p = 0.04)."
    )
    # What has no value is never the best, also where large is good.
    del stored["minimize"]
    assert of_contest({**stored, "maximize": "total"}).startswith("Largest total over 6 held-out")
    few = {
        **stored,
        "table": [stored["table"][0], line("b", "a", 0.2, 0.5, verdict="too few pairs")],
    }
    assert of_contest({**few, "maximize": "total"}).endswith(
        "a, 0.3 m, instead of b, 0.2 m (too few pairs)."
    )
