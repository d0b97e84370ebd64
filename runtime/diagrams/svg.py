"""A drawing as self-contained SVG text, for pages, notebooks and files.

In: a :class:`Drawing`. Out: one string; a dot is ``<circle cx="10" cy="4" r="2.4"
fill="#475569"/>``. Numbers have two decimals: a hundredth of a point cannot be seen.
"""

from __future__ import annotations

from runtime.diagrams.shapes import CurveShape, Dot, Drawing, Group, Rect, Shape, TextShape

FONTS = (
    "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, "
    "'Liberation Sans', 'DejaVu Sans', sans-serif"
)
DASHES = ' stroke-dasharray="5 3.5"'


class SvgText(str):
    """The text of an SVG file, which a notebook shows as a picture that fits its cell."""

    __slots__ = ()

    def _repr_svg_(self) -> str:
        return self.replace("<svg ", '<svg style="max-width: 100%; height: auto" ', 1)


def to_svg(drawing: Drawing) -> SvgText:
    """The drawing as SVG."""
    width, height = _number(drawing.width), _number(drawing.height)
    margin, top = _number(drawing.margin), _number(drawing.margin + drawing.top)
    unit = drawing.unit
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}{unit}" height="{height}{unit}" '
        f'viewBox="0 0 {width} {height}" font-family="{FONTS}" role="img">',
        f"<title>{_escape(drawing.title)}</title>",
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
        f'<g transform="translate({margin} {top})" fill="none">',
    ]
    for group in drawing.groups:
        lines += _group(group)
    return SvgText("\n".join([*lines, "</g>", "</svg>", ""]))


def _group(group: Group) -> list[str]:
    name = f' data-name="{_escape(group.name)}"' if group.name else ""
    about = [f"<title>{_escape(group.about)}</title>"] if group.about else []
    shapes = [_shape(shape) for shape in group.shapes]
    return [f'<g data-kind="{group.kind}"{name}>', *about, *shapes, "</g>"]


def _shape(shape: Shape) -> str:
    if isinstance(shape, Rect):
        return _rect(shape)
    if isinstance(shape, CurveShape):
        return _curve(shape)
    if isinstance(shape, Dot):
        x, y, radius = map(_number, (shape.x, shape.y, shape.radius))
        return f'<circle cx="{x}" cy="{y}" r="{radius}" fill="{shape.fill}"/>'
    return _text(shape)


def _rect(rect: Rect) -> str:
    x, y, width, height = map(_number, (rect.x, rect.y, rect.width, rect.height))
    return (
        f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="{_number(rect.radius)}" '
        f'fill="{rect.fill}" stroke="{rect.stroke}" stroke-width="{_number(rect.stroke_width)}"'
        f"{DASHES if rect.dashed else ''}/>"
    )


def _curve(curve: CurveShape) -> str:
    path = "".join(
        letter + " ".join(f"{_number(x)} {_number(y)}" for x, y in points)
        for letter, points in curve.commands
    )
    if curve.fill:
        return f'<path d="{path}" fill="{curve.fill}"/>'
    dashes = DASHES if curve.dashed else ""
    width = _number(curve.stroke_width)
    return f'<path d="{path}" stroke="{curve.stroke}" stroke-width="{width}"{dashes}/>'


def _text(text: TextShape) -> str:
    more = "" if text.anchor == "start" else f' text-anchor="{text.anchor}"'
    more += ' font-weight="700"' if text.bold else ""
    position = f'x="{_number(text.x)}" y="{_number(text.y)}" font-size="{_number(text.size)}"'
    return f'<text {position} fill="{text.fill}"{more}>{_escape(text.text)}</text>'


def _number(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _escape(text: str) -> str:
    """Text escaped for XML; characters that XML does not allow become question marks."""
    marks = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"}
    return "".join(
        marks.get(letter, letter if letter.isprintable() or letter == "\n" else "?")
        for letter in text
    )
