"""A drawing as PNG or PDF, drawn by matplotlib from the same shapes as the SVG.

In: a :class:`Drawing`. Out: bytes. A renderer for SVG would be another package, and its text
another font.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from runtime.diagrams.shapes import CurveShape, Dot, Drawing, Rect, Shape, TextShape

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCALE = 2.0
# The limits of Agg, in pixels along one side and in all.
MAX_SIDE, MAX_AREA = 60_000, 1e8
# Text smaller than this (in pixels) is illegible, but takes most of the time.
LEGIBLE = 4.0
POINTS_PER_INCH = 72.0
ANCHORS = {"start": "left", "middle": "center", "end": "right"}
DASHES = (0, (5.0, 3.5))


def to_pdf(drawing: Drawing) -> bytes:
    """The drawing as a PDF of its nominal size, with its text as text."""
    import matplotlib

    with matplotlib.rc_context({"pdf.fonttype": 42}):
        return _render(drawing, 1.0, "pdf")


def to_png(drawing: Drawing) -> bytes:
    """The drawing as a PNG of twice its nominal size (less if that would be too large)."""
    width, height = drawing.width, drawing.height
    scale = min(SCALE, MAX_SIDE / max(width, height), (MAX_AREA / (width * height)) ** 0.5)
    return _render(drawing, scale, "png")


def _render(drawing: Drawing, scale: float, kind: str) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = drawing.width, drawing.height
    # One unit of the drawing is one point, so that text sizes and line widths fit.
    size = (width / POINTS_PER_INCH, height / POINTS_PER_INCH)
    figure = Figure(figsize=size, dpi=POINTS_PER_INCH * scale, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(-drawing.margin, width - drawing.margin)
    above = drawing.margin + drawing.top
    axes.set_ylim(height - above, -above)
    order = 0
    for group in drawing.groups:
        for shape in group.shapes:
            if kind == "png" and isinstance(shape, TextShape) and shape.size * scale < LEGIBLE:
                continue
            order += 1
            _add(axes, shape, order)
    buffer = io.BytesIO()
    # Without dates, the same drawing is the same file.
    about = {"Software": None} if kind == "png" else {"CreationDate": None}
    figure.savefig(buffer, format=kind, metadata=about)
    return buffer.getvalue()


def _add(axes: Axes, shape: Shape, order: int) -> None:
    """Draw one shape; ``order`` keeps later shapes on top."""
    from matplotlib.patches import Circle

    if isinstance(shape, Rect):
        _add_rect(axes, shape, order)
    elif isinstance(shape, CurveShape):
        _add_curve(axes, shape, order)
    elif isinstance(shape, Dot):
        axes.add_artist(Circle((shape.x, shape.y), shape.radius, color=shape.fill, zorder=order))
    else:
        _add_text(axes, shape, order)


def _add_rect(axes: Axes, rect: Rect, order: int) -> None:
    from matplotlib.patches import Circle, FancyBboxPatch

    look: dict[str, Any] = {
        "facecolor": rect.fill,
        "edgecolor": rect.stroke,
        "linewidth": rect.stroke_width,
        "linestyle": DASHES if rect.dashed else "solid",
        "zorder": order,
    }
    if rect.width == rect.height == 2.0 * rect.radius:
        middle = (rect.x + rect.radius, rect.y + rect.radius)
        axes.add_artist(Circle(middle, rect.radius, **look))
        return
    style = f"round,pad=0,rounding_size={rect.radius}"
    axes.add_artist(FancyBboxPatch((rect.x, rect.y), rect.width, rect.height, style, **look))


def _add_curve(axes: Axes, curve: CurveShape, order: int) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    codes: dict[str, list[Any]] = {
        "M": [Path.MOVETO],
        "L": [Path.LINETO],
        "Q": [Path.CURVE3, Path.CURVE3],
        "Z": [Path.CLOSEPOLY],
    }
    points = [p for letter, ends in curve.commands for p in (ends or ((0.0, 0.0),))]
    path = Path(points, [code for letter, _ in curve.commands for code in codes[letter]])
    patch = PathPatch(
        path,
        facecolor=curve.fill or "none",
        edgecolor=curve.stroke or "none",
        linewidth=curve.stroke_width,
        linestyle=DASHES if curve.dashed else "solid",
        capstyle="butt",
        zorder=order,
    )
    axes.add_artist(patch)


def _add_text(axes: Axes, text: TextShape, order: int) -> None:
    axes.text(
        text.x,
        text.y,
        text.text,
        fontsize=text.size,
        color=text.fill,
        fontweight="bold" if text.bold else "normal",
        fontfamily="DejaVu Sans",
        ha=ANCHORS[text.anchor],
        va="baseline",
        parse_math=False,
        zorder=order,
    )
