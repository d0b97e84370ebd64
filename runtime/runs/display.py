"""What a terminal and a notebook show of a run: what ran, its metrics, and its figures inline.

In: a run. Out: a table of its metrics; for a notebook one string of HTML, with every name escaped
and pictures as data, so that a stored notebook shows them without the run's folder.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import replace
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from runtime.observation import RunData
from runtime.tables import Cell, Table, element, join

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 110
FIT = "max-width: 100%; height: auto"


class Figures(dict[str, "Figure"]):
    """Figures by the names of their plots; a notebook shows each once."""

    def _repr_html_(self) -> str:
        return "".join(_picture(name, figure) for name, figure in self.items())


def metrics_table(result: RunData) -> Table:
    """The metrics of a run with their units; words or a dash alone where there is no value."""
    rows = []
    for name, value in result.metrics.items():
        unit = "" if value is None else result.units.get(name, "")
        rows.append([name, Cell(f"{result.metric_text(name)} {unit}".rstrip(), value)])
    return Table.of(["", ""], rows)


def compared_metrics(runs: Mapping[str, RunData], names: Iterable[str]) -> Table:
    """These metrics of several runs side by side, below the labels of the runs."""
    rows = [
        [name, *(Cell(run.metric_text(name), run.metrics.get(name)) for run in runs.values())]
        for name in names
    ]
    return Table.of(["", *runs], rows, numbers=range(1, len(runs) + 1))


def notebook_html(result: RunData) -> str:
    """A run as HTML: a line that says what ran, its metrics, notes and plots."""
    from runtime.plots import draw

    manifest = result.manifest
    ran = f"{result.ticks * manifest['dt']:g} {result.time_unit}, seed {manifest['seed']}"
    title = join(element("b", result.title), f": {result.status}, {ran}")
    notes = [f"note: {note}" for note in result.notes]
    parts: list[str] = [title, replace(metrics_table(result), notes=notes).notebook()]
    for plot in result.plots:
        try:
            parts.append(_picture(plot.name, draw(plot, result)))
        except Exception as error:  # noqa: BLE001 -- a display hook must not raise
            parts.append(element("div", f"plot {plot.name} is not drawn: {error}"))
    return "\n".join(parts)


def _picture(name: str, figure: Figure) -> str:
    content = BytesIO()
    figure.savefig(content, dpi=DPI, format="png")
    data = b64encode(content.getvalue()).decode("ascii")
    return (
        f'<img alt="{escape(name, quote=True)}" style="{FIT}" src="data:image/png;base64,{data}">'
    )
