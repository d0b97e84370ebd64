"""docs/comparison.md and its figure, from the contestants' tunings."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tests.studies.contest import budgets, fronts, one_setting, weaknesses
from tests.studies.contest.contestants import TASKS, WIDER, Task
from tests.studies.contest.opening import SPIKES, sentences, verdict_table
from tests.studies.contest.results import (
    CHANGE,
    ERROR,
    RIVAL,
    SATURATION,
    UNLEARNT,
    Contest,
    Contestant,
    Infeasible,
    Verdict,
    rival_of,
)
from tests.studies.contest.words import MM, interval, mm, table

SOON = 10.0  # s

INTRODUCTION = """# Controllers at equal budget and effort

Written by `python -m tests.studies.contest`; every number is from its runs. In case C the
contestants follow the walls of the paper's room, under a low limit of effort ("gentle") and a high
one ("stiff"); in the cases A ("line") and B ("sine") they follow the paper's paths. Each was tuned
by the same optimiser on the same training runs, with the same number of trials, for the smallest
mean error under the limit; its winner was then run on held-out seeds and conditions. The last
lines say who has not been run. The experiment files are in `tests/studies/contest/experiments`:
`runtime tune FILE` runs one of them again.
"""

SEEN = "Mean errors of all contestants with their intervals, in a panel for each case"
FIGURE = """Mean errors on the held-out runs, a panel for each case, the best contestant on top.
Orange is spiking adaptation together with its own LQR, and the dashed line the tuned LQR. Lines are
95 % intervals over the conditions, cut at 0.3 times the mean. Drawn from the tables below by
`python -m tests.studies.contest.picture`.
"""

READING = """## How to read this

* **Robust rule**: the rule of `graphs/*_robust.yaml`, tuned here like everyone; with *one setting*
  only the LQR beside it is tuned, and the rule is as it is shipped. **Lateral rule**: an earlier
  one of ours, which descends the heading error and lambda times the lateral error, with constants
  for each case (`tests/studies/contest/lateral*.yaml`).
* **Error**: mean distance from the contour 180 mm from the walls, in mm, from when it is first
  reached. The floor of a robot with a turning radius of 0.2 m is 4.4 mm in the paper's room.
* **Effort**: root of the mean square of the change of the commanded turn rate from one record to
  the next (50 ms), in rad/s. In training its mean must be below {limits}; held out it is only
  reported.
* **Worst condition**: the largest mean error over the seeds of a held-out condition, in mm.
  **Saturated**: the share of the time in which the command is at its limit, held out.
{training}
* In case C all faults set in at 60 s and end at 90 s; those that "heal" name it because it is what
  they test. In the cases A and B the error is that of docs/reproduction.md, and the feedforward
  the paper's, alpha = 0.06.
* **Optimism**: training minus held-out, of the mean error. It contains that some held-out
  conditions are harder.
* **Against the tuned {rival}**, on the same held-out runs: *better* or *worse* where the difference
  is significant (paired t, Benjamini-Hochberg) and at least so many mm: {counts}; *equivalent*
  where it is significantly smaller than that (two one-sided tests, corrected likewise); else
  *undecided*. The seeds of a condition resemble each other, so that the mean of a condition counts
  as one value, in intervals and tests.
* **Edge**: parameters whose value is within 2 % of an end of its range. Where there were such, the
  range was widened and the tuning done again, with the same budget: {wider}. An edge that is still
  named is one of the wider range, where a smaller value has no effect any more.
"""

HEALING = """The number of runs whose lateral error is within 50 mm at the latest 10 s after the
fault has healed (and until 115 s), and the mean time of all that come back, in s. Corners exceed
the band, too.
"""

FOUND = """Every value was found by the optimiser within the range of its experiment file, over the
number of trials that is given; nothing was chosen by hand but the ranges.
"""


def page(contest: Contest) -> str:
    """The whole page."""
    sections = [
        _Section(contest, limit, rival)
        for limit, who in contest.limits.items()
        if (rival := rival_of(who)) is not None
    ]
    numbered = (f"{i}. {text}" for i, text in enumerate(sentences(contest), start=1))
    parts = [
        INTRODUCTION,
        "## In short\n",
        "\n".join(numbered) + "\n",
        verdict_table(contest),
        f"![{SEEN}](images/comparison.png)\n",
        FIGURE,
        *(part for section in sections for part in section.tables()),
        budgets.section(contest),
        fronts.section(contest, SPIKES),
        one_setting.section(contest.folder),
        weaknesses.section(contest.folder),
        "## What was found\n",
        FOUND,
        table(
            ("contestant", "limit", "trials", "training runs", "values"),
            (_found(one, each.limit) for each in sections for one in each.ordered),
        ),
        READING.format(
            limits=", ".join(f"{TASKS[each.limit].limit:g} ({each.limit})" for each in sections),
            counts=", ".join(
                f"{MM * TASKS[each.limit].counts:g} ({each.limit})" for each in sections
            ),
            rival=RIVAL,
            wider="; ".join(
                f"{name}, {limit} ({', '.join(vary)})" for (limit, name), vary in WIDER.items()
            ),
            training="\n".join(_trained(each) for each in sections),
        ),
        _missing(contest),
    ]
    return "\n".join(part for part in parts if part)


def _missing(contest: Contest) -> str:
    missing = [
        f"{name} ({limit})"
        for limit, who in contest.limits.items()
        for name in TASKS[limit].contestants
        if name not in {one.name for one in (*who, *contest.infeasible[limit])}
    ]
    missing += [f"{name} (front)" for name, found in contest.fronts.items() if not found]
    return (
        f"Not run within this budget, or without anyone to compare with: {'; '.join(missing)}.\n"
        if missing
        else ""
    )


class _Section:
    """The contestants under one limit of effort, the smallest held-out error first."""

    def __init__(self, contest: Contest, limit: str, rival: Contestant) -> None:
        self.limit, self.infeasible, self.task = limit, contest.infeasible[limit], TASKS[limit]
        self.against = budgets.settled(contest, limit, rival)
        self.ordered = sorted(contest.limits[limit], key=lambda one: one.held_out(ERROR).mean)

    def tables(self) -> list[str]:
        task = self.task
        parts = [
            f"## {_title(self.limit)}\n",
            table(HEADER, (_row(one, self.against) for one in self.ordered)),
            *(_out_of_reach(one, task) for one in self.infeasible),
            f"### Held-out error by condition, mm ({self.limit})\n",
            table(
                ("contestant", *task.held_out),
                (
                    (one.name, *(mm(one.held_out(ERROR, name).mean) for name in task.held_out))
                    for one in self.ordered
                ),
            ),
        ]
        heals = [name for name in task.held_out if "heals" in name]
        if heals:
            parts += [
                f"### After a fault has healed ({self.limit})\n",
                HEALING,
                table(
                    ("contestant", "within 10 s", "mean time"),
                    (_healed(one, heals) for one in self.ordered),
                ),
            ]
        return parts


def _title(limit: str) -> str:
    task = TASKS[limit]
    return f"Case {task.case}, {limit}: effort below {task.limit:g} rad/s"


HEADER = (
    "contestant",
    "training",
    "held out",
    "optimism",
    f"against {RIVAL}",
    "",
    "worst condition",
    "effort, training",
    "effort, held out",
    "saturated",
    "lost runs",
    "edge",
)


def _trained(section: _Section) -> str:
    first = section.ordered[0]
    return (
        f"* **{section.limit.capitalize()}**: trained on {_runs(first, 'training')}; held out "
        f"{_runs(first, 'held_out')}."
    )


def _runs(one: Contestant, key: str) -> str:
    runs = one.stored[key]
    return f"seeds {runs['seeds']} under {'; '.join(runs['conditions'])}"


def _out_of_reach(one: Infeasible, task: Task) -> str:
    return (
        f"No setting of {one.name} within the limit of {task.limit:g} rad/s was found over "
        f"{one.trials} trials: the smallest effort in training was {one.effort:.3f} rad/s, with an "
        f"error of {mm(one.error)} mm.\n"
    )


def _row(one: Contestant, against: dict[str, Verdict]) -> tuple[str, ...]:
    verdict = against.get(one.name)
    error, change = one.line(ERROR), one.line(CHANGE)
    return (
        one.name,
        mm(error["training"]["mean"]),
        interval(one.held_out(ERROR)),
        f"{MM * error['optimism']:+.1f}",
        "" if verdict is None else interval(verdict.difference, "+"),
        "" if verdict is None else verdict.word,
        mm(one.worst(ERROR)),
        f"{change['training']['mean']:.3f}",
        f"{one.held_out(CHANGE).mean:.3f}",
        f"{one.held_out(SATURATION).mean:.1%}",
        str(one.lost),
        ", ".join(one.edges),
    )


def _healed(one: Contestant, heals: Sequence[str]) -> tuple[str, ...]:
    times = [run[UNLEARNT] for (name, _), run in one.runs.items() if name in heals]
    known = [time for time in times if not math.isnan(time)]
    soon = sum(time <= SOON for time in known)
    mean = f"{sum(known) / len(known):.1f}" if known else "-"
    return one.name, f"{soon} of {len(times)}", mean


def _found(one: Contestant, limit: str) -> tuple[str, ...]:
    values = ", ".join(f"{path} = {value:g}" for path, value in one.values.items())
    return one.name, limit, str(one.stored["trials"]), str(one.stored["runs"]), values
