"""Reports on a folder according to its content: a run, a sweep, an ablation, a tuning
or a contest.

In: a folder. Out: a page; nothing of the folder is imported or run::

    sweeps/x with plan.yaml of kind sweep  ->  Report("sweep", sweeps/x, "<!doctype html>...")
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from runtime.errors import UsageError
from runtime.experiments.execution import PLAN, read_plan
from runtime.experiments.tuning import CONTEST
from runtime.files import check_form
from runtime.runs import MANIFEST, run_folder

_PLAN = {"kind": str, "experiment": str, "total": int, "metrics": [str]}


@dataclass(frozen=True)
class Report:
    """A page, the kind of its subject ("run", "sweep", "ablation",
    "tuning", "contest"), and the subject's folder."""

    kind: str
    folder: Path
    html: str


def report(path: str | Path) -> Report:
    """Report on a run, a sweep, an ablation, a tuning or a contest.

    Parameters
    ----------
    path : the folder, a link to it, or its manifest, plan or contest.json.

    Raises
    ------
    UsageError : the folder has none of them, or its files are missing or damaged.
    """
    folder = Path(path)
    if folder.name in (MANIFEST, PLAN, CONTEST):
        folder = folder.parent
    if (folder / CONTEST).is_file():
        from runtime.reports.contest_report import contest_report

        return Report("contest", folder, contest_report(folder))
    if not (folder / PLAN).is_file():
        return _run(folder)
    plan = read_plan(folder)
    try:
        check_form(plan, _PLAN)
    except ValueError as error:
        raise UsageError(f"'{folder / PLAN}' is damaged: {error}") from None
    kind = plan["kind"]
    if kind == "ablation":
        from runtime.reports.ablation_report import ablation_report

        return Report("ablation", folder, ablation_report(folder))
    if kind == "sweep":
        from runtime.reports.sweep_report import sweep_report

        return Report("sweep", folder, sweep_report(folder))
    if kind == "tuning":
        from runtime.reports.tuning_report import tuning_report

        return Report("tuning", folder, tuning_report(folder))
    message = f"expected the kind sweep, ablation or tuning, got {kind!r}"
    raise UsageError(f"'{folder / PLAN}': {message}")


def _run(folder: Path) -> Report:
    from runtime.reports.run_report import run_report

    inside = sorted(file.parent for name in (PLAN, CONTEST) for file in folder.glob(f"*/{name}"))
    if inside and not (folder / MANIFEST).is_file():
        suggestion = folder / "latest" if folder / "latest" in inside else inside[-1]
        message = "is not the folder of a run, sweep, ablation, tuning or contest"
        raise UsageError(f"'{folder}' {message}; did you mean '{suggestion}'?")
    suggestion = run_folder(folder)
    return Report("run", suggestion, run_report(suggestion))
