"""The figures of each kind of experiment, drawn into its folder.

In: what an experiment has given. Out: files under ``plots``: those of its kind, then those that it
names itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from runtime.experiments.ablation import AblationTable
from runtime.experiments.analysis.ablation_plots import ablation_figure
from runtime.experiments.analysis.figures import save_figures
from runtime.experiments.analysis.study_figures import study_figures
from runtime.experiments.analysis.sweep_plots import sweep_figures
from runtime.experiments.execution import Outcome
from runtime.experiments.sweeping import SweepTable
from runtime.experiments.tuning import TuningTable
from runtime.experiments.tuning.contest_plots import contest_figure
from runtime.experiments.tuning.tuning_plots import tuning_figures


def draw_figures(result: Outcome, look: str, formats: Sequence[str]) -> list[Path]:
    """Draw an experiment that is complete; returns the files.

    Raises
    ------
    UsageError : they cannot be written.
    """
    pictures = save_figures(result.folder, _figures(result, look), formats)
    if isinstance(result, (SweepTable, AblationTable)):
        figures = study_figures(result.plan, result.folder)
        pictures += save_figures(result.folder, figures, ("pdf", "png"))
    return pictures


def _figures(result: Outcome, look: str) -> Iterator[tuple[str, Figure]]:
    folder = result.folder
    if isinstance(result, TuningTable):
        yield from tuning_figures(folder, look)
        return
    if isinstance(result, AblationTable):
        yield "ablation", ablation_figure(folder, look)
        if not result.plan.design.factors:
            return
    elif not isinstance(result, SweepTable):
        yield "contest", contest_figure(folder, look)
        return
    yield from sweep_figures(folder, look)
