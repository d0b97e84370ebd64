"""The record of an experiment's starts: which program computed its rows, and with which workers.

In: a plan that is about to run, and how. Out: lines of ``starts.jsonl``, two for each start::

    {"started": "2026-01-31T12:00:00+01:00", "program": "spikeblocks 0.1.0 (3f2a91c04b12)", ...}
    {"ended": "2026-01-31T12:20:00+01:00", "workers": [{"address": ..., "trials": 120, ...}]}

What was computed by one program is not continued by another unless that is asked for: the rows
would be mixed without a trace.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from blocks.files import read_text
from runtime.errors import UsageError
from runtime.experiments.execution.folder import RunOptions, elsewhere
from runtime.experiments.execution.plan import ExperimentPlan
from runtime.experiments.execution.worker_pool import WorkerPool
from runtime.files import append, system_errors
from runtime.runs import check_same_program, git_commit, versions

STARTS = "starts.jsonl"


@dataclass(frozen=True)
class Start:
    """One start of an experiment, of which ``has_rows`` tells whether it continues another."""

    plan: ExperimentPlan
    options: RunOptions
    has_rows: bool

    def pool(self) -> WorkerPool:
        """Record the start and make its workers.

        Raises
        ------
        UsageError : rows were computed by another program, or there are no workers.
        """
        here, folder, option = self.plan.program, self.options.folder, self.options.option
        if self.has_rows:
            mixed = option.format("mixed")
            way_out = f"{elsewhere(self.plan, option)} begins anew, {mixed} continues all the same"
            recorded = programs(folder) or [""]
            check_same_program(recorded, here, f"'{folder}'", way_out, self.options.mixed)
        pool = self.options.make_pool(here)
        self._add(
            {
                "started": _now(),
                "program": str(here),
                "versions": versions(),
                "git": git_commit(),
                "argv": list(sys.argv),
            }
        )
        return pool

    def end(self, pool: WorkerPool) -> None:
        """Record what the workers of this start have done."""
        if workers := pool.report():
            self._add({"ended": _now(), "workers": workers})

    def _add(self, entry: dict[str, Any]) -> None:
        path = self.options.folder / STARTS
        with system_errors(f"write '{path}'"):
            append(path, json.dumps(entry) + "\n")


def programs(folder: Path) -> list[str]:
    """The programs that have computed rows of an experiment, without those of no known program.

    Raises
    ------
    UsageError : the record is damaged.
    """
    path = folder / STARTS
    if not path.exists():
        return []
    try:
        entries = [json.loads(line) for line in read_text(path).splitlines()]
        return [str(entry["program"]) for entry in entries if "started" in entry]
    except (OSError, ValueError, TypeError, KeyError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UsageError(f"'{path}' is damaged: {reason}") from None


def _now() -> str:
    return datetime.now().astimezone().isoformat(timespec="seconds")
