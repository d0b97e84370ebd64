"""docs/comparison.md and its figure, from the contestants' tunings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from runtime.experiments.analysis import Estimate
from tests.studies.contest.contestants import CONTESTANTS, HELD_OUT, LIMITS
from tests.studies.contest.results import (
    CHANGE,
    COUNTS,
    ERROR,
    RIVAL,
    UNLEARNT,
    Contestant,
    Verdict,
    verdicts,
)

MM = 1e3
SPIKES = ("our rule", "robust rule", "SNN as printed")
HEALS = [name for name in HELD_OUT if "heals" in name]
SOON = 10.0  # s
PLENTY = 100  # trials, below which a budget is called small
SMALL = ": a small budget, whose verdicts are provisional"

INTRODUCTION = """# Controllers at equal budget and effort

Written by `python -m tests.studies.contest`; every number is from its runs. Case C: the contestants
follow the walls of the paper's room. Each was tuned by the same optimiser on the same training
runs, with the same number of trials, for the smallest mean error under a limit of effort, of which
there are a low one ("gentle") and a high one ("stiff"); its winner was then run on held-out seeds
and conditions. The last line says who has not been run. The experiment files are in
`tests/studies/contest/experiments`: `runtime tune FILE` runs one of them again.
"""

READING = """## How to read this

* **Error**: mean distance from the contour 180 mm from the walls, in mm, from when it is first
  reached. The floor of a robot with a turning radius of 0.2 m is 4.4 mm in the paper's room.
* **Effort**: root of the mean square of the change of the commanded turn rate from one record to
  the next (50 ms), in rad/s. In training its mean must be below {limits}; held out
  it is only reported.
* **Training**: {training}. **Held out**: {held_out}.
* All faults set in at 60 s and end at 90 s; those that "heal" name it because it is what they test.
* **Optimism**: training minus held-out, of the mean error. It contains that some held-out
  conditions are harder.
* **Against the tuned {rival}**, on the same held-out runs: *better* or *worse* where the difference
  is significant (paired t, Benjamini-Hochberg) and at least {counts:g} mm; *equivalent* where it is
  significantly smaller than that (two one-sided tests, corrected likewise); else *undecided*. The
  runs of a condition are not independent of each other, so the intervals are rather too narrow.
* **Edge**: parameters whose value is within 2 % of an end of its range; a wider range may give
  better values.
"""

HEALING = """The number of runs whose lateral error is within 50 mm at the latest 10 s after the
fault has healed (and until 115 s), and the mean time of all that come back, in s. Corners exceed
the band, too.
"""

FOUND = """Every value was found by the optimiser within the range of its experiment file, over the
number of trials that is given; nothing was chosen by hand but the ranges.
"""


def page(found: Mapping[str, Sequence[Contestant]], one_setting: str) -> str:
    """The whole page; ``one_setting`` is the section about all cases."""
    sections = [_Section(limit, who) for limit, who in found.items() if who]
    texts = [text for section in sections for text in section.short()]
    parts = [
        INTRODUCTION,
        "## In short\n",
        "\n".join(f"{i}. {text}" for i, text in enumerate(_opening(sections) + texts, start=1)),
        "\n![Error against effort](images/comparison.png)\n",
        *(part for section in sections for part in section.tables()),
        one_setting,
        "## What was found\n",
        FOUND,
        _table(
            ("contestant", "limit", "trials", "training runs", "values"),
            (_found(one, each.limit) for each in sections for one in each.ordered),
        ),
        READING.format(
            limits=" or ".join(f"{value:g} ({name})" for name, value in LIMITS.items()),
            counts=MM * COUNTS,
            rival=RIVAL,
            training=_runs(sections[0].ordered[0], "training"),
            held_out=_runs(sections[0].ordered[0], "held_out"),
        ),
    ]
    missing = [
        f"{name} ({limit})"
        for limit, who in found.items()
        for name in CONTESTANTS
        if name not in {one.name for one in who}
    ]
    if missing:
        parts.append(f"Without a result in this budget: {'; '.join(missing)}.\n")
    return "\n".join(parts)


def _opening(sections: Sequence[_Section]) -> list[str]:
    everyone = [one for section in sections for one in section.ordered]
    trials = {one.stored["trials"] for one in everyone}
    budget = " or ".join(map(str, sorted(trials)))
    first = everyone[0]
    limits = "one limit" if len(sections) == 1 else f"each of {len(sections)} limits"
    return [
        f"{len({one.name for one in everyone})} controllers were tuned with {budget} trials each "
        f"under {limits} of effort, on at most {_count(first, 'training')} "
        f"training runs a trial, and judged on {len(first.runs)} "
        f"held-out runs{SMALL if max(trials) < PLENTY else ''}."
    ]


class _Section:
    """The contestants under one limit of effort, the smallest held-out error first."""

    def __init__(self, limit: str, found: Sequence[Contestant]) -> None:
        self.limit = limit
        self.against = verdicts(found)
        self.ordered = sorted(found, key=lambda one: one.held_out(ERROR).mean)
        self.rival = next(one for one in found if one.name == RIVAL)

    def short(self) -> list[str]:
        """What the page begins with, chosen by rules from the numbers."""
        first = self.ordered[0]
        words = {
            word: [name for name, verdict in self.against.items() if verdict.word == word]
            for word in ("better", "equivalent", "worse", "undecided")
        }
        told = "; ".join(f"{word}: {' / '.join(names)}" for word, names in words.items() if names)
        spikes = [one for one in self.ordered if one.name in SPIKES]
        beside = "; ".join(
            f"{one.name} {_mm(one.held_out(ERROR).mean)} mm ({self.against[one.name].word})"
            for one in spikes
        )
        optimism = [one.line(ERROR)["optimism"] for one in self.ordered]
        edges = [one.name for one in self.ordered if one.edges]
        at_edge = f"; a value lies at the edge of its range for {', '.join(edges)}" if edges else ""
        return [
            f"**{self.limit.capitalize()}** (effort below {LIMITS[self.limit]:g} rad/s in "
            f"training): the smallest held-out error has {first.name}, "
            f"{_interval(first.held_out(ERROR))} mm; the tuned {RIVAL} without any adaptation has "
            f"{_interval(self.rival.held_out(ERROR))} mm. Against it on the same runs, with "
            f"{MM * COUNTS:g} mm as what counts: {told}.",
            f"{self.limit.capitalize()}: spiking adaptation beside an LQR that is tuned with it: "
            f"{beside}{_without_spikes(self.ordered)}. On the training runs errors are "
            f"{-MM * max(optimism):.1f} to {-MM * min(optimism):.1f} mm smaller than on the "
            f"held-out ones{at_edge}.",
        ]

    def tables(self) -> list[str]:
        title = f"{self.limit.capitalize()}: effort below {LIMITS[self.limit]:g} rad/s"
        return [
            f"## {title}\n",
            _table(HEADER, (_row(one, self.against) for one in self.ordered)),
            f"### Held-out error by condition, mm ({self.limit})\n",
            _table(
                ("contestant", *HELD_OUT),
                (
                    (one.name, *(_mm(one.held_out(ERROR, name).mean) for name in HELD_OUT))
                    for one in self.ordered
                ),
            ),
            f"### After a fault has healed ({self.limit})\n",
            HEALING,
            _table(
                ("contestant", "within 10 s", "mean time"),
                (_healed(one) for one in self.ordered),
            ),
        ]


HEADER = (
    "contestant",
    "training",
    "held out",
    "optimism",
    f"against {RIVAL}",
    "",
    "effort, training",
    "effort, held out",
    "lost runs",
    "edge",
)


def _runs(one: Contestant, key: str) -> str:
    runs = one.stored[key]
    return f"seeds {runs['seeds']}, conditions {'; '.join(runs['conditions'])}"


def _without_spikes(ordered: Sequence[Contestant]) -> str:
    others = [one for one in ordered if one.name.startswith("our rule, ")]
    return "".join(
        f"; {one.name.removeprefix('our rule, ')} {_mm(one.held_out(ERROR).mean)} mm"
        for one in others
    )


def _count(one: Contestant, key: str) -> int:
    runs = one.stored[key]
    return sum(_length(part) for part in runs["seeds"].split(",")) * len(runs["conditions"])


def _length(part: str) -> int:
    first, _, last = part.partition("..")
    return int(last or first) - int(first) + 1


def _row(one: Contestant, against: dict[str, Verdict]) -> tuple[str, ...]:
    verdict = against.get(one.name)
    error, change = one.line(ERROR), one.line(CHANGE)
    return (
        one.name,
        _mm(error["training"]["mean"]),
        _interval(one.held_out(ERROR)),
        f"{MM * error['optimism']:+.1f}",
        "" if verdict is None else _signed(verdict.difference),
        "" if verdict is None else verdict.word,
        f"{change['training']['mean']:.3f}",
        f"{one.held_out(CHANGE).mean:.3f}",
        str(one.lost),
        ", ".join(one.edges),
    )


def _healed(one: Contestant) -> tuple[str, ...]:
    times = [run[UNLEARNT] for (name, _), run in one.runs.items() if name in HEALS]
    known = [time for time in times if not math.isnan(time)]
    soon = sum(time <= SOON for time in known)
    mean = f"{sum(known) / len(known):.1f}" if known else "-"
    return one.name, f"{soon} of {len(times)}", mean


def _found(one: Contestant, limit: str) -> tuple[str, ...]:
    values = ", ".join(f"{path} = {value:g}" for path, value in one.values.items())
    return one.name, limit, str(one.stored["trials"]), str(one.stored["runs"]), values


def _mm(value: float) -> str:
    return "-" if math.isnan(value) else f"{MM * value:.1f}"


def _interval(found: Estimate) -> str:
    return f"{_mm(found.mean)} [{_mm(found.low)}, {_mm(found.high)}]"


def _signed(found: Estimate) -> str:
    return f"{MM * found.mean:+.1f} [{MM * found.low:+.1f}, {MM * found.high:+.1f}]"


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def draw(found: Mapping[str, Sequence[Contestant]], path: Path) -> None:
    """Held-out error against effort: each contestant's winners, with their intervals."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, ScalarFormatter

    from runtime.plots import save_figure

    figure = Figure(figsize=(9.0, 5.5), layout="constrained")
    axes = figure.subplots()
    for number, name in enumerate(CONTESTANTS):
        winners = [one for who in found.values() for one in who if one.name == name]
        if not winners:
            continue
        color = colormaps["tab20"](number % 20)
        errors = [one.held_out(ERROR) for one in winners]
        efforts = [one.held_out(CHANGE).mean for one in winners]
        axes.plot(
            efforts,
            [MM * error.mean for error in errors],
            "-D" if name in SPIKES else "-o",
            color=color,
            label=name,
        )
        for effort, error in zip(efforts, errors, strict=True):
            axes.plot([effort] * 2, [MM * error.low, MM * error.high], color=color, alpha=0.5)
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter("")
    axes.set_xlabel("change of the commanded turn rate in 50 ms, rms (rad/s), held-out runs")
    axes.set_ylabel("error on the held-out runs (mm)")
    figure.legend(loc="outside right upper", fontsize=7.0)
    save_figure(figure, path)
