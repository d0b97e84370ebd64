"""runtime.runs."""

from runtime.runs.folder import (
    DIAGRAM,
    MANIFEST,
    METRICS,
    PROBES,
    RESOLVED,
    WRITTEN,
    Draft,
    contents,
    git_commit,
    link_latest,
    new_folder,
    portable_modules,
    save,
    save_elsewhere,
)
from runtime.runs.leftovers import leftovers, recover, remove
from runtime.runs.reading import read_run, run_folder
from runtime.runs.result import Result, open_run
from runtime.runs.simulate import PreparedRun, chosen_runner, simulate, versions

__all__ = [
    "DIAGRAM",
    "MANIFEST",
    "METRICS",
    "PROBES",
    "RESOLVED",
    "WRITTEN",
    "Draft",
    "PreparedRun",
    "Result",
    "chosen_runner",
    "contents",
    "git_commit",
    "leftovers",
    "link_latest",
    "new_folder",
    "open_run",
    "portable_modules",
    "read_run",
    "recover",
    "remove",
    "run_folder",
    "save",
    "save_elsewhere",
    "simulate",
    "versions",
]
