"""The record of an experiment's starts: which program computed its rows, and with which workers.

In: a folder whose trials begin, or have ended. Out: lines of ``starts.jsonl``, two for each start::

    {"started": "2026-01-31T12:00:00+01:00", "program": "spikeblocks 0.1.0 (3f2a91c04b12)", ...}
    {"ended": "2026-01-31T12:20:00+01:00", "workers": [{"address": ..., "trials": 120, ...}]}
"""

from __future__ import annotations

import json
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

from blocks.files import read_text
from runtime.errors import UsageError
from runtime.experiments.execution.worker_pool import WorkerPool
from runtime.files import append, system_errors
from runtime.runs import Program, git_commit, versions

STARTS = "starts.jsonl"


def record_start(folder: Path, program: Program) -> None:
    """Record that a program computes trials from now on."""
    entry = {"program": str(program), "versions": versions(), "git": git_commit()}
    _add(folder, {"started": _now(), **entry, "argv": list(sys.argv)})


def record_end(folder: Path, pool: WorkerPool) -> None:
    """Record what the workers of a start have done, if they are of a cluster."""
    if workers := pool.report():
        _add(folder, {"ended": _now(), "workers": workers})


def _add(folder: Path, entry: dict[str, Any]) -> None:
    path = folder / STARTS
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
