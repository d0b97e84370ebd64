"""Whether a verdict survives a budget that is doubled."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from tests.studies.contest.contestants import TASKS, TRIALS
from tests.studies.contest.results import RIVAL, Contest, Contestant, Verdict, rival_of, verdicts
from tests.studies.contest.words import interval, table

TEXT = """## With the budget doubled

The tunings of {names} were continued to {trials} trials. Each verdict against the {rival}: at the
budget of all, with the {rival}'s budget doubled, and with both doubled. One that does not survive
counts as undecided everywhere else on this page.
"""
HEADER = ("contestant", "limit", "budget of all", f"{RIVAL} doubled", "both doubled", "survives")
Row = tuple[str, str, Verdict, Verdict | None, Verdict | None]


def rows(contest: Contest) -> Iterator[Row]:
    """Each contestant's verdicts, where anything was doubled."""
    for limit, found in contest.limits.items():
        rival, doubled = rival_of(found), contest.doubled[limit]
        if rival is None or not doubled:
            continue
        stronger = rival_of(doubled)
        counts = TASKS[limit].counts
        before = verdicts(found, rival, counts)
        after = verdicts(found, stronger, counts) if stronger else {}
        both = verdicts(doubled, stronger or rival, counts)
        for name, verdict in before.items():
            if name in after or name in both:
                yield name, limit, verdict, after.get(name), both.get(name)


def changed(contest: Contest) -> tuple[int, int]:
    """How many verdicts another budget changes, and of how many."""
    found = list(rows(contest))
    return sum(not _survives(row) for row in found), len(found)


def _survives(row: Row) -> bool:
    return all(other is None or other.word == row[2].word for other in row[3:])


def settled(contest: Contest, limit: str, rival: Contestant) -> dict[str, Verdict]:
    """All verdicts at the budget of all; one that a doubled budget changes is undecided."""
    found = verdicts(contest.limits[limit], rival, TASKS[limit].counts)
    turned = {row[0] for row in rows(contest) if row[1] == limit and not _survives(row)}
    return {name: replace(one, survives=name not in turned) for name, one in found.items()}


def names(contest: Contest) -> str:
    """Whose budget was doubled."""
    found = [f"{one.name} ({limit})" for limit, who in contest.doubled.items() for one in who]
    return ", ".join(found)


def section(contest: Contest) -> str:
    """The section of docs/comparison.md; empty if nothing was doubled."""
    found = list(rows(contest))
    if not found:
        return ""
    text = TEXT.format(names=names(contest), trials=2 * TRIALS, rival=RIVAL)
    lines = (
        (*row[:2], *map(_told, row[2:]), "yes" if _survives(row) else "**no**") for row in found
    )
    return f"{text}\n{table(HEADER, lines)}"


def _told(verdict: Verdict | None) -> str:
    return "" if verdict is None else f"{verdict.word}, {interval(verdict.difference, '+')}"
