"""docs/comparison.md and its figure, from the contestants' tunings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from runtime.experiments.analysis import Estimate
from tests.studies.contest.contestants import EFFORT as LIMIT
from tests.studies.contest.contestants import HELD_OUT
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
runs, with the same number of trials, for the smallest mean error under one limit of effort; its
winner was then run on held-out seeds and conditions. The experiment files are in
`tests/studies/contest/experiments`: `runtime tune FILE` runs one of them again.
"""

READING = """## How to read this

* **Error**: mean distance from the contour 180 mm from the walls, in mm, from when it is first
  reached. The floor of a robot with a turning radius of 0.2 m is 4.4 mm in the paper's room.
* **Effort**: root of the mean square of the change of the commanded turn rate from one record to
  the next (50 ms), in rad/s. In training its mean must be below {limit:g}; held out it is only
  reported.
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


TRANSFER = """Our rule with the setting that case C's training chose, beside an LQR of Q = R = I
(moderate) and beside the graph's own soft one; the printed and the robust rule as they are shipped.
Mean error in m (from 10 s on in B), and the difference that the adaptive part makes.
"""


def page(
    found: Sequence[Contestant], missing: Sequence[str], transfer: Sequence[Sequence[str]]
) -> str:
    """The whole page; ``transfer`` are the rows about the cases A and B."""
    against = verdicts(found)
    ordered = sorted(found, key=lambda one: one.held_out(ERROR).mean)
    parts = [
        INTRODUCTION,
        "## In short\n",
        "\n".join(f"{i}. {text}" for i, text in enumerate(_short(ordered, against), start=1)),
        "\n![Error against effort](images/comparison.png)\n",
        "## The contestants\n",
        _table(
            (
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
            ),
            (_row(one, against) for one in ordered),
        ),
        "## Held-out error by condition, mm\n",
        _table(
            ("contestant", *HELD_OUT),
            (
                (one.name, *(_mm(one.held_out(ERROR, name).mean) for name in HELD_OUT))
                for one in ordered
            ),
        ),
        "## After a fault has healed\n",
        HEALING,
        _table(("contestant", "within 10 s", "mean time"), (_healed(one) for one in ordered)),
        *_transferred(transfer),
        "## What was found\n",
        FOUND,
        _table(("contestant", "trials", "training runs", "values"), map(_found, ordered)),
        READING.format(
            limit=LIMIT,
            counts=MM * COUNTS,
            rival=RIVAL,
            training=_runs(found[0], "training"),
            held_out=_runs(found[0], "held_out"),
        ),
    ]
    if missing:
        parts.append(f"Not run in this budget: {'; '.join(missing)}.\n")
    return "\n".join(parts)


def _transferred(rows: Sequence[Sequence[str]]) -> list[str]:
    if not rows:
        return []
    header = ("case", "LQR", "controller", "error", "against the LQR alone")
    return ["## The same setting in cases A and B\n", TRANSFER, _table(header, rows)]


def _runs(one: Contestant, key: str) -> str:
    runs = one.stored[key]
    return f"seeds {runs['seeds']}, conditions {'; '.join(runs['conditions'])}"


def _short(ordered: Sequence[Contestant], against: dict[str, Verdict]) -> Iterable[str]:
    """Five sentences, chosen by rules from the numbers."""
    first, trials = ordered[0], {one.stored["trials"] for one in ordered}
    rival = next(one for one in ordered if one.name == RIVAL)
    budget = " or ".join(map(str, sorted(trials)))
    yield (
        f"{len(ordered)} controllers were tuned with {budget} trials each, on at most "
        f"{_count(first, 'training')} training runs a trial, and judged on {len(first.runs)} "
        f"held-out runs{SMALL if max(trials) < PLENTY else ''}."
    )
    yield (
        f"The smallest held-out error has **{first.name}**: {_interval(first.held_out(ERROR))} mm; "
        f"the tuned {RIVAL} without any adaptation has {_interval(rival.held_out(ERROR))} mm."
    )
    words = {
        word: [name for name, verdict in against.items() if verdict.word == word]
        for word in ("better", "equivalent", "worse", "undecided")
    }
    told = "; ".join(f"{word}: {' / '.join(names)}" for word, names in words.items() if names)
    counts = f"{MM * COUNTS:g} mm"
    yield f"Against the tuned {RIVAL} on the same runs, with {counts} as what counts: {told}."
    spikes = [one for one in ordered if one.name in SPIKES]
    yield (
        "Spiking adaptation beside an LQR that is tuned with it: "
        + "; ".join(
            f"{one.name} {_mm(one.held_out(ERROR).mean)} mm ({against[one.name].word})"
            for one in spikes
        )
        + _without_spikes(ordered)
        + "."
    )
    optimism = [one.line(ERROR)["optimism"] for one in ordered]
    edges = [one.name for one in ordered if one.edges]
    at_edge = f"; a value lies at the edge of its range for {', '.join(edges)}" if edges else ""
    yield (
        f"On the training runs the errors are {-MM * max(optimism):.1f} to "
        f"{-MM * min(optimism):.1f} mm smaller than on the held-out ones{at_edge}."
    )


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


def _found(one: Contestant) -> tuple[str, ...]:
    values = ", ".join(f"{path} = {value:g}" for path, value in one.values.items())
    return one.name, str(one.stored["trials"]), str(one.stored["runs"]), values


def _mm(value: float) -> str:
    return "-" if math.isnan(value) else f"{MM * value:.1f}"


def _interval(found: Estimate) -> str:
    return f"{_mm(found.mean)} [{_mm(found.low)}, {_mm(found.high)}]"


def _signed(found: Estimate) -> str:
    return f"{MM * found.mean:+.1f} [{MM * found.low:+.1f}, {MM * found.high:+.1f}]"


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def draw(found: Sequence[Contestant], path: Path) -> None:
    """Held-out error against effort: the winners with their intervals."""
    from matplotlib.figure import Figure

    from runtime.plots import save_figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.subplots()
    for one in found:
        error, change = one.held_out(ERROR), one.held_out(CHANGE)
        mark = "D" if one.name in SPIKES else "o"
        (line,) = axes.plot(change.mean, MM * error.mean, mark, label=one.name)
        axes.plot([change.mean] * 2, [MM * error.low, MM * error.high], color=line.get_color())
        axes.plot(
            [change.low, change.high], [MM * error.mean] * 2, color=line.get_color(), alpha=0.5
        )
    axes.set_xlabel("change of the commanded turn rate in 50 ms, rms (rad/s)")
    axes.set_ylabel("error on the held-out runs (mm)")
    axes.legend(fontsize=7.0)
    save_figure(figure, path)
