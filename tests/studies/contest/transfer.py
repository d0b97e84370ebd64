"""The setting that case C's training chose for our rule, in the cases A and B."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import runtime
from runtime.document.loader import SHIPPED
from runtime.experiments.analysis import Estimate, difference, estimate

FILE = "transfer.json"
CASES = {"A": "line_actuator_failure", "B": "sine_estimation_error"}
SEEDS = range(100, 103)
# Weights of all errors: a moderate LQR for v_r = 1 m/s, and the soft one of the graphs.
GAINS = {"moderate": [1.0, 1.0, 1.0], "the graph's": None}
ALONE, OURS, PRINTED, ROBUST = "LQR alone", "our rule", "SNN as printed", "robust rule"


def graphs(case: str, gains: list[float] | None, values: Mapping[str, Any]) -> dict[str, Any]:
    """The controllers of a case; ``values`` are our rule's."""
    name = CASES[case]
    own = {path: value for path, value in values.items() if not path.startswith("params.")}
    ours = runtime.load(name).overlay(SHIPPED / "rules" / "course.yaml")
    for path, value in own.items():
        ours = ours.set(path, value)
    found = {
        ALONE: runtime.load(name).without("adaptive"),
        OURS: ours,
        PRINTED: runtime.load(name),
        ROBUST: runtime.load(f"{name}_robust"),
    }
    return {
        who: (graph if gains is None else graph.set("lqr.q", gains)).set("plots", {})
        for who, graph in found.items()
    }


def measure(values: Mapping[str, Any], folder: Path) -> None:
    """Run all of them and store the errors (m) by seed."""
    found: dict[str, list[float]] = {}
    for case in CASES:
        for stiff, gains in GAINS.items():
            for who, graph in graphs(case, gains, values).items():
                graph = graph.set("run.engine", "compiled")
                results = [graph.run(seed=seed) for seed in SEEDS]
                found[f"{case}/{stiff}/{who}"] = [r.metrics["position_mae"] for r in results]
    (folder / FILE).write_text(json.dumps(found), encoding="utf-8")


def rows(folder: Path) -> list[tuple[str, ...]]:
    """A row for each case, gains and controller; none if it has not been measured."""
    path = folder / FILE
    if not path.exists():
        return []
    found = json.loads(path.read_text(encoding="utf-8"))
    lines = []
    for key, errors in found.items():
        case, stiff, who = key.split("/")
        alone = found[f"{case}/{stiff}/{ALONE}"]
        apart = "" if who == ALONE else _interval(difference(errors, alone), "+")
        lines.append((case, stiff, who, _interval(estimate(errors)), apart))
    return lines


def _interval(found: Estimate, sign: str = "") -> str:
    return f"{found.mean:{sign}.3f} [{found.low:{sign}.3f}, {found.high:{sign}.3f}]"
