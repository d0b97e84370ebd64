r"""A drawing as a TikZ picture, which a paper takes by ``\input`` and sets in its own font.

In: a :class:`Drawing`. Out: text for LaTeX with the package ``tikz``. A dot at (3, 4) becomes::

    \fill[c1] (3,4) circle[radius=2.4bp];

Lengths are big points (1/72 inch) as in all drawings, and y is downwards.
"""

from __future__ import annotations

import unicodedata

from runtime.diagrams.layout import Point
from runtime.diagrams.shapes import CurveShape, Dot, Drawing, Rect, Shape, TextShape

DASHES = "dash pattern=on 5bp off 3.5bp"
ANCHORS = {"start": "base west", "middle": "base", "end": "base east"}
LINE = 1.2  # of the size of letters, from one base line to the next
HEAD = r"""% A diagram of {title}.
% In the preamble: \usepackage{{tikz}}. In the paper: \input{{this file}}.
\begin{{tikzpicture}}[x=1bp, y=-1bp, inner sep=0pt, outer sep=0pt, font=\sffamily]
"""
# Letters that LaTeX does not set as they are, and those that its text fonts lack.
LETTERS = {
    **{c: rf"\{c}" for c in "#$%&_{}"},
    **{"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"},
    **{"<": r"\textless{}", ">": r"\textgreater{}", '"': r"\textquotedbl{}", "|": r"\textbar{}"},
    **{"−": "$-$", "×": r"$\times$", "→": r"$\to$", "·": r"$\cdot$", "…": r"\dots{}"},
    **{"²": "$^2$", "³": "$^3$", "°": r"$^\circ$", "µ": r"$\mu$", "≤": r"$\leq$", "≥": r"$\geq$"},
    **{c: f"$^{i}$" for i, c in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹") if c not in "²³"},
    **{c: f"$_{i}$" for i, c in enumerate("₀₁₂₃₄₅₆₇₈₉")},
}


def to_tikz(drawing: Drawing) -> str:
    """The drawing as the text of a ``tikzpicture``."""
    colours: dict[str, str] = {}
    lines = [_line(shape, colours) for group in drawing.groups for shape in group.shapes]
    defined = [
        rf"\definecolor{{{name}}}{{HTML}}{{{colour.lstrip('#').upper()}}}"
        for colour, name in colours.items()
    ]
    head = HEAD.format(title=_comment(drawing.title))
    return head + "\n".join([*defined, *lines, r"\end{tikzpicture}", ""])


def _line(shape: Shape, colours: dict[str, str]) -> str:
    def colour(value: str) -> str:
        return colours.setdefault(value, f"c{len(colours) + 1}")

    if isinstance(shape, Rect):
        return _rect(shape, colour(shape.fill), colour(shape.stroke))
    if isinstance(shape, CurveShape):
        path = _path(shape)
        if shape.fill:
            return rf"\fill[{colour(shape.fill)}] {path};"
        dashes = f", {DASHES}" if shape.dashed else ""
        return (
            rf"\draw[{colour(shape.stroke)}, line width={_number(shape.stroke_width)}bp{dashes}] "
            f"{path};"
        )
    if isinstance(shape, Dot):
        at = _at((shape.x, shape.y))
        return rf"\fill[{colour(shape.fill)}] {at} circle[radius={_number(shape.radius)}bp];"
    return _text(shape, colour(shape.fill))


def _rect(rect: Rect, fill: str, stroke: str) -> str:
    width, height, radius = map(_number, (rect.width, rect.height, rect.radius))
    look = f"fill={fill}, draw={stroke}, line width={_number(rect.stroke_width)}bp"
    look += f", {DASHES}" if rect.dashed else ""
    if rect.width == rect.height == 2.0 * rect.radius:
        middle = _at((rect.x + rect.radius, rect.y + rect.radius))
        return rf"\path[{look}] {middle} circle[radius={radius}bp];"
    corner = _at((rect.x, rect.y))
    return rf"\path[{look}, rounded corners={radius}bp] {corner} rectangle +({width},{height});"


def _path(curve: CurveShape) -> str:
    """The path; TikZ has cubic curves only, whose control points lie at two thirds."""
    parts: list[str] = []
    here = (0.0, 0.0)
    for letter, points in curve.commands:
        if letter == "Z":
            parts.append(" -- cycle")
            continue
        if letter == "Q":
            bend, end = points
            first, second = _towards(here, bend), _towards(end, bend)
            parts.append(f" .. controls {_at(first)} and {_at(second)} .. {_at(end)}")
        else:
            parts.append((" -- " if letter == "L" else "") + _at(points[0]))
        here = points[-1]
    return "".join(parts)


def _towards(start: Point, end: Point) -> Point:
    return start[0] + (end[0] - start[0]) * 2 / 3, start[1] + (end[1] - start[1]) * 2 / 3


def _text(text: TextShape, colour: str) -> str:
    size, skip = _number(text.size), _number(LINE * text.size)
    font = rf"\sffamily\fontsize{{{size}bp}}{{{skip}bp}}\selectfont"
    bold = r"\bfseries" if text.bold else ""
    look = f"anchor={ANCHORS[text.anchor]}, text={colour}, font={font}{bold}"
    return rf"\node[{look}] at {_at((text.x, text.y))} {{{_escape(text.text)}}};"


def _escape(text: str) -> str:
    return "".join(LETTERS.get(c) or _letter(c) for c in text)


def _letter(letter: str) -> str:
    """A Greek letter by its name, as LaTeX knows it; any other as it is."""
    kind, _, name = unicodedata.name(letter, "?").rpartition(" LETTER ")
    if kind in ("GREEK SMALL", "GREEK CAPITAL") and " " not in name:
        name = name.lower().replace("lamda", "lambda")
        return rf"$\{name if kind == 'GREEK SMALL' else name.title()}$"
    return letter if letter.isprintable() else "?"


def _comment(text: str) -> str:
    """A text that does not end its line."""
    return "".join(c if c.isprintable() else "?" for c in text)


def _at(point: Point) -> str:
    return f"({_number(point[0])},{_number(point[1])})"


def _number(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".") or "0"
