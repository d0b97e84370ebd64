"""The figure of a contest: what each contestant is worth on the held-out runs.

In: a contest that is complete. Out: one figure in the style of a paper: an axes per metric, means
with 95 % intervals over the held-out conditions or seeds, and a mark for each tuning.
"""

from __future__ import annotations

import math

from matplotlib.figure import Figure

from runtime.experiments.analysis.sweep_plots import variant_style
from runtime.experiments.tuning.contest import ContestResult
from runtime.plots import LOOKS, WIDTH, headline, styled
from runtime.terminal import with_unit

FACTS = "held-out runs: means with 95 % intervals, and a mark for each tuning"
BELOW = 0.22  # of the distance of two contestants: where the tunings are


def contest_figure(result: ContestResult, look: str = "paper") -> Figure:
    """A contest's figure, in a look of :data:`runtime.plots.LOOKS`."""
    names, metrics = list(result.tunings), result.plan.tuning.metrics
    with styled(look):
        height = len(metrics) * (0.55 + 0.3 * len(names))
        figure = Figure(figsize=(LOOKS[look].width or WIDTH, height), layout="constrained")
        headline(figure, result.name, FACTS, look)
        column = figure.subplots(len(metrics), 1, squeeze=False)[:, 0]
        for axes, metric in zip(column, metrics, strict=True):
            own = {
                line.variant: line.own
                for line in result.lines
                if line.metric == metric and line.reference in (None, names[0])
            }
            for y, name in enumerate(names):
                own_style = variant_style(y)
                scores = [score for score in result.scores(name, metric) if math.isfinite(score)]
                axes.plot(scores, [y + BELOW] * len(scores), "|", color=own_style["color"], ms=6.0)
                mean = own[name]
                if mean.n:
                    ends = [[0.0], [0.0]]
                    if not math.isnan(mean.low):
                        ends = [[mean.mean - mean.low], [mean.high - mean.mean]]
                    marks = own_style | {"linestyle": "none", "capsize": 2.5}
                    axes.errorbar(mean.mean, y, xerr=ends, markersize=4.0, **marks)
            axes.set_yticks(range(len(names)), names)
            axes.set_ylim(len(names) - 0.4, -0.6)
            axes.set_xlabel(with_unit(metric, result.plan.units))
    return figure
