"""The report of whatever lies in a folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from runtime.reopen import run_folder


@dataclass(frozen=True)
class Report:
    """A page, the kind of what it is about, and the folder that holds that."""

    kind: str
    folder: Path
    html: str


def report(path: Path) -> Report:
    """Report on a run, a sweep or an ablation.

    Raises
    ------
    UsageError : there is none of them, or its files are missing or damaged.
    """
    from runtime.reports.run_report import run_report

    folder = run_folder(path)
    return Report("run", folder, run_report(folder))
