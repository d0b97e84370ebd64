"""Looks of figures: their width on a page, their fonts, and where their legends are.

In: a figure and a look, as ``LOOKS["paper"]``. Out: the same figure, 3.5 inches wide, its legends
below or inside the axes, without a title.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.text import Annotation

from runtime.plots.style import GREY, LETTER, STYLE, TITLE_SIZE, WIDTH, legend_height

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MANY_NAMES = 4  # that a legend inside narrow axes may have
NARROW = 12  # characters of a legend's entry, of which three fit into a column

ROW, HANDLE = 60, 7  # characters of a legend's row in a column, and of a line and its gaps
FACTS, LINE = 8.0, 1.3  # points, and the height of a line in font sizes
NARROW_ZOOM = 0.66  # of a picture of space, with labels beside it


@dataclass(frozen=True)
class Look:
    """A size of paper: the width of its figures (in), their largest height, and their fonts."""

    width: float | None = None
    height: float = 9.0
    settings: Any = field(default_factory=dict)


_SMALL: dict[str, Any] = {
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "legend.fontsize": 7.0,
}
_SMALL |= {"xtick.labelsize": 7.0, "ytick.labelsize": 7.0, "legend.fontsize": 7.0}
_SERIF: dict[str, Any] = {"font.family": "serif", "mathtext.fontset": "stix"}
# STIX, which comes with matplotlib, looks as Times does, and has the letters that Times lacks.
_SERIF |= {"font.serif": ["Times New Roman", "Nimbus Roman", "Liberation Serif", "STIXGeneral"]}
_SERIF["font.serif"].append("DejaVu Serif")
# The columns of an IEEE page are 3.5 in wide, and 7.16 in together.
LOOKS: Mapping[str, Look] = {
    "screen": Look(),
    "paper": Look(3.5, 4.0, {**_SMALL, **_SERIF}),
    "paper2": Look(7.16, 6.0, {**_SMALL, **_SERIF}),
}


def styled(look: str) -> AbstractContextManager[None]:
    """The settings of matplotlib in which figures of a look are drawn."""
    return matplotlib.rc_context({**STYLE, **LOOKS[look].settings})


def headline(figure: Figure, title: str, facts: str = "", look: str = "screen") -> None:
    """Write a title above all axes, and small facts below it; the figure grows for them.

    On paper both are left to the caption.
    """
    if LOOKS[look].width is not None:
        return
    width, height = map(float, figure.get_size_inches())
    lines = textwrap.wrap(facts, int(72.0 * width / (LETTER * FACTS)))
    figure.set_size_inches(width, height + LINE * FACTS * len(lines) / 72.0)
    # Empty lines keep room in the layout for the facts, which have another font.
    room = "\n" * math.ceil(len(lines) * FACTS / TITLE_SIZE)
    top = figure.suptitle(title + room, x=0.01, ha="left", fontsize=TITLE_SIZE, weight="bold")
    place: Any = {"xytext": (0.0, -1.3 * TITLE_SIZE), "textcoords": "offset points", "va": "top"}
    how: Any = {"xycoords": top, "fontsize": FACTS, "color": GREY, "annotation_clip": False}
    figure.add_artist(Annotation("\n".join(lines), (0.0, 1.0), **place, **how))


def fit(figure: Figure, look: Look) -> None:
    """Give a figure the width of a column; its height keeps the proportions up to a limit.

    Titles are left to the caption; the subtitle stays, in small print.
    """
    if look.width is None:
        return
    width, height = figure.get_size_inches()
    share = look.width / width
    # Fonts do not shrink with the figure, so its height shrinks less than its width.
    figure.set_size_inches(look.width, min(look.height, height * min(1.0, math.sqrt(share))))
    for axes in figure.axes:
        if axes.get_title(loc="left"):
            axes.set_title("", loc="left")
        for text in axes.texts:
            if text.get_gid() == "subtitle":
                text.set_visible(False)
    if look.width < WIDTH:
        _narrow_legends(figure)
        for axes in figure.axes:
            space: Any = axes
            if axes.name == "3d":  # its labels have no part in the layout
                space.set_box_aspect(space.get_box_aspect(), zoom=NARROW_ZOOM)


def _narrow_legends(figure: Figure) -> None:
    """Place the legends of axes inside them, and those of the figure below it, a few in a row."""
    for owner, legend in [(part, i) for part in (figure, *figure.subfigs) for i in part.legends]:
        labels = [text.get_text() for text in legend.get_texts()]
        legend.remove()
        entries = [handle for handle in legend.legend_handles if handle is not None]
        owner.legend(entries, labels, loc="outside lower center", ncols=_columns(labels))
    for axes in figure.axes:
        beside = axes.get_legend()
        if beside is not None:
            handles, _ = axes.get_legend_handles_labels()
            labels = [text.get_text() for text in beside.get_texts()]
            if len(labels) > MANY_NAMES:
                beside.remove()
                if len(figure.axes) == 1:
                    below: dict[str, Any] = {"loc": "outside lower center"}
                    figure.legend(handles, labels, ncols=_columns(labels), **below)
                else:
                    _place_above(figure, axes, handles, labels)
                continue
            # Lines run behind it there: the frame keeps its text legible.
            over: dict[str, Any] = {"frameon": True, "framealpha": 0.85, "edgecolor": "none"}
            axes.legend(handles, labels, loc="best", **over)


def _place_above(figure: Figure, axes: Axes, handles: Sequence[Any], labels: Sequence[str]) -> None:
    """Place many names above one of several axes, for which the figure grows."""
    columns = _columns(labels)
    place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
    axes.legend(handles, labels, ncols=columns, **place)
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + legend_height(-(-len(labels) // columns)))


def _columns(labels: Sequence[str]) -> int:
    if sum(map(len, labels)) + HANDLE * len(labels) <= ROW:
        return len(labels)
    return 3 if max(map(len, labels)) <= NARROW else 2
