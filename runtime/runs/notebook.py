"""What a notebook shows of a run: what ran, its metrics, and its figures inline.

In: a run. Out: one string of HTML, with every name escaped and pictures as data, so that a stored
notebook shows them without the run's folder.
"""

from __future__ import annotations

from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from runtime.observation import RunData

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 110
FIT = "max-width: 100%; height: auto"


class Figures(dict[str, "Figure"]):
    """Figures by the names of their plots; a notebook shows each once."""

    def _repr_html_(self) -> str:
        return "".join(_picture(name, figure) for name, figure in self.items())


def notebook_html(result: RunData) -> str:
    """A run as HTML: a line that says what ran, its metrics, notes and plots."""
    from runtime.plots import draw

    manifest = result.manifest
    duration = result.ticks * manifest["dt"]
    parts = [
        f"<b>{escape(result.title)}</b>: {result.status}, {duration:g} "
        f"{result.time_unit}, seed {manifest['seed']}"
    ]
    rows = "".join(
        f"<tr><td style='text-align: left'>{escape(name)}</td>"
        f"<td>{_value_text(result, name)}</td></tr>"
        for name in result.metrics
    )
    parts += [f"<table>{rows}</table>"] * bool(rows)
    parts += [f"<div>note: {escape(note)}</div>" for note in result.notes]
    for plot in result.plots:
        try:
            parts.append(_picture(plot.name, draw(plot, result)))
        except Exception as error:  # noqa: BLE001 -- a display hook must not raise
            parts.append(f"<div>plot {escape(plot.name)} is not drawn: {escape(str(error))}</div>")
    return "\n".join(parts)


def _value_text(result: RunData, name: str) -> str:
    """A value with its unit; words or a dash alone where there is none."""
    unit = "" if result.metrics[name] is None else result.units.get(name, "")
    return escape(f"{result.metric_text(name)} {unit}".strip())


def _picture(name: str, figure: Figure) -> str:
    content = BytesIO()
    figure.savefig(content, dpi=DPI, format="png")
    data = b64encode(content.getvalue()).decode("ascii")
    return (
        f'<img alt="{escape(name, quote=True)}" style="{FIT}" src="data:image/png;base64,{data}">'
    )
