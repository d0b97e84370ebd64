"""The figure of a contest: what each contestant is worth on the held-out runs.

In: the folder of a contest that is complete. Out: one figure in the style of a paper: an axes per
metric, means with 95 % intervals over the held-out conditions or seeds, and a dot for each tuning.
A mark is filled where the contestant differs significantly from the first one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from runtime.errors import UsageError
from runtime.experiments.analysis import ComparisonLine
from runtime.experiments.analysis.ablation_plots import draw_intervals
from runtime.experiments.tuning.contest import CONTEST
from runtime.files import read_json
from runtime.plots import LOOKS, WIDTH, headline, styled

FACTS = (
    "held-out {units}: means with 95 % intervals, a dot for each tuning; hollow: no significant "
    "difference to {first}"
)


def contest_figure(folder: Path, look: str = "paper") -> Figure:
    """A contest's figure, in a look of :data:`runtime.plots.LOOKS`.

    Raises
    ------
    UsageError : its contest.json cannot be read.
    """
    facts = read_contest(folder)
    contestants = facts["contestants"]
    dots = {
        metric: [[each["metrics"].get(metric) for each in own] for own in contestants.values()]
        for metric in facts["metrics"]
    }
    names = list(contestants)
    with styled(look):
        height = len(dots) * (0.75 + 0.26 * len(names)) + 0.3
        figure = Figure(figsize=(LOOKS[look].width or WIDTH, height), layout="constrained")
        shown = FACTS.format(units=facts["paired_by"] + "s", first=names[0])
        headline(figure, facts["experiment"], shown, look)
        draw_intervals(figure, facts, beside_first(facts), names, dots, (len(dots), 1))
    return figure


def read_contest(folder: Path) -> dict[str, Any]:
    """The contents of contest.json.

    Raises
    ------
    UsageError : it cannot be read.
    """
    try:
        facts: dict[str, Any] = read_json(folder / CONTEST)
    except (OSError, ValueError) as error:
        raise UsageError(f"cannot read '{folder / CONTEST}': {error}") from None
    return facts


def beside_first(facts: dict[str, Any]) -> list[ComparisonLine]:
    """The lines of each contestant beside the first, without those of other pairs."""
    references = (None, next(iter(facts["contestants"])))
    lines = map(ComparisonLine.from_dict, facts["table"])
    return [line for line in lines if line.reference in references]
