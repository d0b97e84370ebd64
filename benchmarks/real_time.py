"""Lateness of ticks that wait for the clock: both engines, with and without priority."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import runtime
from benchmarks.tables import table
from runtime.runs import Pacing, simulate

GRAPH, UNTIL = "line_actuator_failure", 20.0


def lateness(engine: str, priority: bool, until: float = UNTIL) -> Mapping[str, Any]:
    """The figures of one run in real time."""
    graph = runtime.load(GRAPH).set("run.engine", engine).set("run.until", until)
    result = simulate(graph.prepared(), pacing=Pacing(priority=priority))
    figures: Mapping[str, Any] = result.manifest["real_time"]
    return figures


def section(rounds: int, quick: bool = False) -> str:
    """The section of docs/performance.md about real time."""
    # One run of each: a quantile of 99.9 % needs many ticks, and rounds would not make it smaller.
    until = 1.0 if quick else UNTIL
    rows = []
    for engine in ("python", "compiled"):
        for priority in (False, True):
            found = lateness(engine, priority, until)
            late = (f"{1e6 * value:.1f} µs" for value in found["late_s"].values())
            rows.append([engine, found["priority"], *late, str(found["overruns"])])
    head = ["engine", "priority", "50 %", "99 %", "99.9 %", "worst", "overruns"]
    text = (
        f"`{GRAPH}`, ticks of 1 ms, {until:g} s by the clock: how late ticks began, and how many "
    )
    text += (
        "ended after the next was due. Read it with the load below: where that is above the number "
    )
    text += "of cores, a process of normal priority waits for others."
    return f"\n## Real time\n\n{text}\n\n{table(head, rows)}"
