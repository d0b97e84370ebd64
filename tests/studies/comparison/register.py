"""Whether the plan came before the runs: its commit beside the times of the rows.

In: the repository, and the rows of docs/study. Out: what is wrong, as sentences::

    path: LQR, tuning 3 began 2026-01-02 10:00:00, before the plan was committed (...)

A change of the plan after its first commit is allowed if a line of ``deviations`` names the
commit's subject; anything that a condition, a contestant or a range depends on is part of the plan.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import Any

import yaml

from runtime.errors import UsageError
from tests.studies.comparison import plan, rows

ROOT = plan.FOLDER.parents[1]
# What the numbers depend on, besides the package itself.
REGISTERED = ("docs/study/*.yaml", "docs/study/plan.md", "tests/studies/comparison/plan.py")

# What the verdicts depend on: changes after the first run are told, for the reader to weigh.
JUDGED = tuple(f"tests/studies/comparison/{name}.py" for name in ("judge", "rows", "page"))

# No run depends on these; a task that is like another has that one's entries in it.
WORDS = ("title", "unit", "scale", "measures", "contestants", "only", "like")


def _git(*arguments: str) -> list[str]:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def commits(of: Sequence[str] = REGISTERED) -> list[tuple[str, datetime, str]]:
    """Commits that changed the plan, or other files, the first one first: hash, time, subject."""
    lines = _git("log", "--no-merges", "--reverse", "--format=%h %ct %s", "--", *of)
    parts = [line.split(" ", 2) for line in lines]
    return [(name, datetime.fromtimestamp(int(at), UTC), subject) for name, at, subject in parts]


def require() -> None:
    """Refuse to run a plan that is not committed.

    Raises
    ------
    UsageError : the plan differs from its last commit.
    """
    changed = _git("status", "--porcelain", "--", *REGISTERED)
    if changed or not commits():
        raise UsageError(f"the plan is not committed: {', '.join(changed) or 'no commit'}")


def problems() -> Iterator[str] | list[str]:
    """What is wrong; empty if every run is younger than the plan and all changes are told."""
    registered = commits()
    if not registered:
        return ["the plan is not committed"]
    told = plan.read()["deviations"]
    found = [
        f"{hash_} changes the plan ({subject}), and no line of deviations names it"
        for hash_, _, subject in registered[1:]
        if not any(subject in line for line in told)
    ]
    history = [(hash_, at, _plan_of(hash_)) for hash_, at, _ in registered]
    for task in rows.tasks():
        for (contestant, tuning), began in rows.began(task).items():
            name, since = _since(history, task, contestant)
            if began < since:
                found.append(
                    f"{task}: {contestant}, tuning {tuning} began {began:%Y-%m-%d %H:%M:%S}, "
                    f"before its entry was committed ({name}, {since:%Y-%m-%d %H:%M:%S})"
                )
    return found


def _plan_of(commit: str) -> dict[str, Any]:
    """The plan as it was at a commit."""
    text = "\n".join(_git("show", f"{commit}:./docs/study/plan.yaml"))
    return plan.expanded(yaml.safe_load(text))


def _since(
    history: Sequence[tuple[str, datetime, dict[str, Any]]], task: str, contestant: str
) -> tuple[str, datetime]:
    """The newest commit that changed what a contestant of a task is, or how it is tuned."""
    newest, before = history[0][:2], None
    for name, at, version in history:
        entry = _entry(version, task, contestant)
        if entry != before:
            newest, before = (name, at), entry
    return newest


def _entry(version: dict[str, Any], task: str, contestant: str) -> Any:
    """What the runs of a contestant depend on; None if the plan does not have it."""
    entry = version["tasks"].get(task, {})
    if contestant not in entry.get("contestants", {}):
        return None
    common = {key: value for key, value in entry.items() if key not in WORDS}
    settings = {key: version.get(key) for key in plan.SETTINGS}
    return settings | common | {"own": entry["contestants"][contestant]}


def told() -> list[str]:
    """What there is: the plan's commit, the first run, deviations."""
    name, first, _ = commits()[0]
    times = _times()
    lines = [f"plan: {name}, {first:%Y-%m-%d %H:%M:%S} UTC"]
    if times:
        lines.append(f"first of {len(times)} tunings: {min(times):%Y-%m-%d %H:%M:%S} UTC")
    return [*lines, *(f"deviation: {line}" for line in plan.read()["deviations"])]


def judged_since() -> list[str]:
    """Commits that changed how runs are judged and told, after the first run.

    Not on the page, since a commit of the page itself would be one of them.
    """
    times = _times()
    later = [one for one in commits(JUDGED) if times and one[1] > min(times)]
    return [f"the judging was changed after the first run: {hash_} {s}" for hash_, _, s in later]


def _times() -> list[datetime]:
    """When the tunings began, by the clock of the computer that ran them.

    It gives the order of plan and runs to who trusts that clock, and proves nothing to others.
    """
    return [began for task in rows.tasks() for began in rows.began(task).values()]
