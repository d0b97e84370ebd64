"""Fronts of error against effort: tunings with both as objectives, and condition by condition."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tests.studies.contest.contestants import FRONT, TASKS, WIDEST
from tests.studies.contest.results import CHANGE, ERROR, Contest, Contestant
from tests.studies.contest.words import interval, mm, table

TEXT = """## Fronts of error against effort

Tunings with two objectives, error and effort, with the same budget, for {names}. Of each front at
most five settings, its ends included, were run on the held-out runs; settings with an effort above
{widest:g} rad/s in training do not count. "Beaten by" are the contestants with a setting that has
both a smaller error and a smaller effort on the held-out runs.
"""
CASES = ("A", "B", "C")
HEADER = ("contestant", "error, mm", "effort, rad/s", "beaten by")
FAULTS = """### Who is on the front, condition by condition

Of all settings of a case on this page, for each held-out condition: those that no other one beats
in both the mean error and the mean effort over the seeds, the smallest effort first, with error
(mm) and effort (rad/s); those with spikes in bold. Three seeds a condition: neighbours may change
places.
"""
ONE = "robust rule, one setting"


@dataclass(frozen=True)
class Point:
    """A setting of a contestant, by its error (m) and effort (rad/s)."""

    name: str
    error: float
    effort: float

    def beats(self, other: Point) -> bool:
        """Whether it is better in one and not worse in the other."""
        mine, theirs = (self.error, self.effort), (other.error, other.effort)
        return mine != theirs and all(a <= b for a, b in zip(mine, theirs, strict=True))


def front(points: Sequence[Point]) -> list[Point]:
    """The points that no other one beats, the smallest effort first."""
    kept = {one for one in points if not any(other.beats(one) for other in points)}
    return sorted(kept, key=lambda one: one.effort)


def section(contest: Contest, spikes: Sequence[str]) -> str:
    """The section of docs/comparison.md; ``spikes`` are the contestants that have some."""
    found = [one for members in contest.fronts.values() for one in members]
    text = ""
    if found:
        names = ", ".join(name for name, members in contest.fronts.items() if members)
        head = TEXT.format(names=names, widest=WIDEST)
        text = f"{head}\n{table(HEADER, _settings(found))}\n"
    fronts = [(case, *item) for case in CASES for item in by_condition(contest, case).items()]
    rows = ((case, name, _told(members, spikes)) for case, name, members in fronts)
    parts = (FAULTS, table(("case", "condition", "on the front"), rows), *_where(contest))
    return text + "\n".join(parts)


def _where(contest: Contest) -> Iterator[str]:
    """Where the rule with one setting is on the front, and by how much it misses it elsewhere."""
    for case in CASES:
        on, off = [], []
        for name, points in _by_condition(contest, case).items():
            own = [_behind(point, points) for point in points if point.name == ONE]
            if own and min(own) == 0.0:
                on.append(name)
            elif own:
                off.append(f"{name}, {mm(min(own))}")
        if on or off:
            text = f"* **{ONE.capitalize()}**, case {case}: on the front in {len(on)} of"
            text += f" {len(on) + len(off)} conditions"
            text += f" ({'; '.join(on)})" if on else ""
            text += f". Not in, with the mm by which it is behind: {'; '.join(off)}" if off else ""
            yield f"{text}.\n" if case == CASES[-1] else f"{text}."


def _behind(own: Point, points: Sequence[Point]) -> float:
    """By how much the error (m) of the best setting of no more effort is smaller."""
    return own.error - min(point.error for point in points if point.effort <= own.effort)


def by_condition(contest: Contest, case: str) -> dict[str, list[Point]]:
    """The front of all settings of a case for each held-out condition."""
    return {name: front(points) for name, points in _by_condition(contest, case).items()}


def _by_condition(contest: Contest, case: str) -> dict[str, list[Point]]:
    """All settings of a case for each held-out condition."""
    everyone = [
        one for limit, who in contest.limits.items() if TASKS[limit].case == case for one in who
    ]
    if case == TASKS[FRONT].case:
        everyone += [one for members in contest.fronts.values() for one in members]
    if not everyone:
        return {}
    held_out = next(task.held_out for task in TASKS.values() if task.case == case)
    return {name: _points(everyone, name) for name in held_out}


def _settings(found: Sequence[Contestant]) -> Iterator[tuple[str, ...]]:
    points = [(one, one.held_out(ERROR), one.held_out(CHANGE)) for one in found]
    for one, error, effort in points:
        beaten = {
            other.name for other, e, c in points if e.mean < error.mean and c.mean < effort.mean
        }
        spread = f"{effort.mean:.3f} [{effort.low:.3f}, {effort.high:.3f}]"
        yield one.name, interval(error), spread, ", ".join(sorted(beaten))


def _points(found: Sequence[Contestant], condition: str) -> list[Point]:
    points = (
        Point(
            one.name,
            one.held_out(ERROR, condition).mean,
            one.held_out(CHANGE, condition).mean,
        )
        for one in found
    )
    return [point for point in points if not math.isnan(point.error)]


def _told(members: Sequence[Point], spikes: Sequence[str]) -> str:
    return ", ".join(
        f"{f'**{one.name}**' if one.name in spikes else one.name} {mm(one.error)} at "
        f"{one.effort:.3f}"
        for one in members
    )
