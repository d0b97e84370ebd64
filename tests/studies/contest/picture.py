"""The figure of docs/comparison.md, drawn from its tables.

    python -m tests.studies.contest.picture

In: the text of the page. Out: for each case a panel with a dot and an interval for each contestant,
the best on top, and a line at the tuned LQR. The runs themselves are not needed::

    | robust rule | 9.1 | 8.6 [5.1, 12.1] | ...        a dot at 8.6 mm, a line from 5.1 to 12.1 mm
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.studies.contest.opening import SPIKES
from tests.studies.contest.results import RIVAL

DOCS = Path(__file__).parents[3] / "docs"
LINE = re.compile(r"\| (.+?) \| [^|]+ \| ([\d.]+) \[(-?[\d.]+), ([\d.]+)\] \|")
SPIKING, OTHER, REFERENCE = "#d55e00", "#0072b2", "#555555"
LEAST = 0.3  # of a mean: an interval that reaches further down, or below 0, is cut there


class Outcome(NamedTuple):
    """A contestant's mean error on the held-out runs (mm) with its 95 % interval."""

    name: str
    mean: float
    low: float
    high: float


def outcomes(text: str) -> Iterator[tuple[str, list[Outcome]]]:
    """The cases of the page, each with its contestants, the best first."""
    for part in re.split(r"^## Case ", text, flags=re.M)[1:]:
        title = part.partition("\n")[0]
        table = re.split(r"^##", part, maxsplit=1, flags=re.M)[0]
        found = [Outcome(name, *map(float, ends)) for name, *ends in LINE.findall(table)]
        yield f"Case {title}", sorted(found, key=lambda one: one.mean)


def draw(text: str, path: Path) -> None:
    """Write the figure of the page."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    from runtime.plots import save_figure

    panels = list(outcomes(text))
    counts = [max(len(found) for _, found in panels[i : i + 2]) for i in range(0, len(panels), 2)]
    figure = Figure(figsize=(9.0, 0.21 * sum(counts) + 1.0 * len(counts)), layout="constrained")
    grid = figure.subplots(len(counts), 2, squeeze=False, height_ratios=[c + 3 for c in counts])
    for axes, (title, found) in zip(grid.flat, panels, strict=False):
        for row, one in enumerate(found):
            color = SPIKING if one.name in SPIKES else OTHER
            low = max(one.low, LEAST * one.mean)
            axes.plot([low, one.high], [row, row], color=color, linewidth=1.6)
            axes.plot([one.mean], [row], "o", color=color, markersize=5.0)
        reference = next(one.mean for one in found if one.name == RIVAL)
        axes.axvline(reference, color=REFERENCE, linewidth=1.0, linestyle="--", zorder=0.5)
        axes.set_yticks(range(len(found)), [one.name for one in found], fontsize=8.0)
        for label, one in zip(axes.get_yticklabels(), found, strict=True):
            label.set_color(SPIKING if one.name in SPIKES else "black")
        axes.invert_yaxis()
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.tick_params(axis="y", length=0)
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.set_title(title, loc="left", fontsize=9.0, fontweight="bold")
        axes.set_xlabel("mean error on the held-out runs, mm", fontsize=8.0)
    save_figure(figure, path)


if __name__ == "__main__":
    page = (DOCS / "comparison.md").read_text(encoding="utf-8")
    draw(page, DOCS / "images" / "comparison.png")
