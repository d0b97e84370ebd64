"""What each contestant costs as C: ``docs/study/rows/costs.csv``.

In: the first task's contestants. Out: bytes of memory and code, and operations of a step, from the
report of ``runtime export``::

    contestant,memory,code,arithmetic,divisions,functions
    LQR,2112,1843,52,4,3
"""

from __future__ import annotations

import csv
import re
import tempfile
from pathlib import Path

from runtime.experiments.design import read_experiment
from runtime.export import export
from tests.studies.comparison import plan, rows

COSTS = rows.ROWS / "costs.csv"
TASK = "path"
# The controller: what a contestant has of these.
BLOCKS = ("lqr", "demand", "bend", "course", "baseline", "adaptive", "total")
KEYS = ("contestant", "memory", "code", "arithmetic", "divisions", "functions")
MEMORY = re.compile(r"struct \w+: (\d+) bytes")
CODE = re.compile(r": (\d+) bytes of code")
STEP = re.compile(r"^  together +(\d+) +(\d+) +(\d+)", re.M)


def measure() -> None:
    """Export each contestant of the first task, and write what it needs."""
    with tempfile.TemporaryDirectory() as folder:
        experiment = read_experiment(str(plan.write(TASK, Path(folder))))
        found = []
        for each in experiment.contestants:
            names = [
                name
                for name in BLOCKS
                if any(f"{key}.".startswith(f"{name}.") for key in each.graph.network.entries)
            ]
            told = export(each.graph, Path(folder) / "c", blocks=names, ticks=20).report
            cells = [_first(MEMORY, told), _first(CODE, told)]
            step = STEP.search(told)
            cells += step.groups() if step else ("", "", "")
            found.append((each.name, *cells))
    rows.ROWS.mkdir(exist_ok=True)
    with COSTS.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows([KEYS, *found])


def _first(pattern: re.Pattern[str], text: str) -> str:
    match = pattern.search(text)
    return match[1] if match else ""


def read() -> list[dict[str, str]]:
    """The rows; none if nothing was measured."""
    if not COSTS.exists():
        return []
    with COSTS.open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))
