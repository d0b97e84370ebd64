"""Fronts of error against effort: tunings with both as objectives."""

from __future__ import annotations

from tests.studies.contest.contestants import WIDEST
from tests.studies.contest.results import CHANGE, ERROR, Contest
from tests.studies.contest.words import interval, table

TEXT = """## Fronts of error against effort

Tunings with two objectives, error and effort, with the same budget, for {names}. Of each front at
most five settings, its ends included, were run on the held-out runs; settings with an effort above
{widest:g} rad/s in training do not count. "Beaten by" are the contestants with a setting that has
both a smaller error and a smaller effort on the held-out runs.
"""
HEADER = ("contestant", "error, mm", "effort, rad/s", "beaten by")


def section(contest: Contest) -> str:
    """The section of docs/comparison.md; empty if there is no front."""
    found = [one for front in contest.fronts.values() for one in front]
    if not found:
        return ""
    points = [(one, one.held_out(ERROR), one.held_out(CHANGE)) for one in found]
    lines = []
    for one, error, effort in points:
        beaten = {
            other.name for other, e, c in points if e.mean < error.mean and c.mean < effort.mean
        }
        spread = f"{effort.mean:.3f} [{effort.low:.3f}, {effort.high:.3f}]"
        lines.append((one.name, interval(error), spread, ", ".join(sorted(beaten))))
    names = ", ".join(name for name, front in contest.fronts.items() if front)
    return f"{TEXT.format(names=names, widest=WIDEST)}\n{table(HEADER, lines)}"
