"""Shapes of a drawing, the same for all picture formats, and the lines of wires.

In: corners of wires. Out: shapes in points (1/72 inch), y downwards. The corners (0, 0), (20, 0),
(20, 30) become a line with one rounded corner: M 0 0, L 15 0, Q 20 0 20 5, L 20 30.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

from runtime.diagrams.layout import Point

# "M" moves, "L" draws a line, "Q" a quadratic curve (control point, end), "Z" closes the path.
Command = tuple[str, tuple[Point, ...]]

CORNER = 5.0
ARROW_LENGTH = 7.0
ARROW_HALF = 3.2
NARROW = frozenset("fijlrtI.,:;|!'()[] ")
WIDE = frozenset("mwMW@%")


@dataclass(frozen=True)
class Rect:
    x: float
    y: float
    width: float
    height: float
    radius: float
    fill: str
    stroke: str
    stroke_width: float = 1.0
    dashed: bool = False


@dataclass(frozen=True)
class CurveShape:
    """A line, or a filled area if ``fill`` is given."""

    commands: tuple[Command, ...]
    stroke: str = ""
    fill: str = ""
    stroke_width: float = 1.4
    dashed: bool = False


@dataclass(frozen=True)
class Dot:
    x: float
    y: float
    radius: float
    fill: str


@dataclass(frozen=True)
class TextShape:
    """A text on its base line; ``anchor`` is "start", "middle" or "end"."""

    x: float
    y: float
    text: str
    size: float
    fill: str
    anchor: str = "start"
    bold: bool = False


Shape = Rect | CurveShape | Dot | TextShape


@dataclass
class Group:
    """Shapes that belong together: a block, the wires of an output, a part's frame."""

    kind: str
    name: str
    about: str
    shapes: list[Shape] = field(default_factory=list)


@dataclass
class Drawing:
    """Shapes in a page with a margin; they begin ``top`` below it, under the title.

    ``unit`` is that of the numbers for an SVG: "pt" for paper, else the browser's pixels.
    """

    title: str
    width: float
    height: float
    margin: float
    groups: list[Group]
    top: float = 0.0
    unit: str = ""

    def scale(self, factor: float) -> Drawing:
        """The same drawing, larger or smaller."""
        groups = [
            replace(group, shapes=[_scale(shape, factor) for shape in group.shapes])
            for group in self.groups
        ]
        sizes = {
            name: factor * getattr(self, name) for name in ("width", "height", "margin", "top")
        }
        return replace(self, groups=groups, **sizes)


_LENGTHS = ("x", "y", "width", "height", "radius", "size", "stroke_width")


def _scale(shape: Shape, factor: float) -> Shape:
    sizes: dict[str, Any] = {
        name: factor * getattr(shape, name) for name in _LENGTHS if hasattr(shape, name)
    }
    if isinstance(shape, CurveShape):
        sizes["commands"] = tuple(
            (letter, tuple((factor * x, factor * y) for x, y in points))
            for letter, points in shape.commands
        )
    return replace(shape, **sizes)


# Estimated from classes of letters: a font's real widths need the font, which the viewer of an SVG
# chooses. Too wide rather than too narrow: text must not cross the border of its box.
def text_width(text: str, size: float, bold: bool = False) -> float:
    """The approximate width of a string in a wide font."""
    ems = 0.0
    for letter in text:
        if letter in NARROW:
            ems += 0.36
        elif letter in WIDE:
            ems += 0.93
        elif ord(letter) > 0x2E80:
            ems += 1.0
        else:
            ems += 0.68 if letter.isupper() or letter.isdigit() else 0.60
    return ems * size * (1.1 if bold else 1.0)


def arrow_head(tip: Point, fill: str) -> CurveShape:
    """An arrow that points to the right."""
    x, y = tip
    back = x - ARROW_LENGTH
    ends = ((back, y - ARROW_HALF), (back, y + ARROW_HALF))
    return CurveShape((("M", (tip,)), ("L", (ends[0],)), ("L", (ends[1],)), ("Z", ())), fill=fill)


def line_through(points: Sequence[Point], sharp: set[Point]) -> tuple[Command, ...]:
    """A line along corners, which are rounded except those in ``sharp``."""
    commands: list[Command] = [("M", (points[0],))]
    # Not larger than half of a segment, so that the curves at its two ends do not meet.
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        radius = min(CORNER, _distance(before, corner) / 2, _distance(corner, after) / 2)
        if corner in sharp or radius < 0.5:
            commands.append(("L", (corner,)))
            continue
        commands.append(("L", (_towards(corner, before, radius),)))
        commands.append(("Q", (corner, _towards(corner, after, radius))))
    commands.append(("L", (points[-1],)))
    return tuple(commands)


def branchings(lines: Sequence[Sequence[Point]]) -> list[Point]:
    """The points where lines of one net branch: three or four directions lead from there."""
    runs = sorted({tuple(sorted(run)) for line in lines for run in pairwise(line)})
    corners = sorted({point for line in lines for point in line[1:-1]})
    points = []
    for point in corners:
        directions: set[Point] = set()
        for a, b in runs:
            if _is_on(point, a, b):
                directions.update(_direction(point, end) for end in (a, b) if end != point)
        if len(directions) > 2:
            points.append(point)
    return points


def without_repeats(lines: Sequence[Sequence[Point]]) -> list[list[Point]]:
    """The lines of one net, each from where it leaves the earlier ones, so that none overlap."""
    return [
        min((_after(line, other) for other in lines[:i]), key=_length, default=list(line))
        for i, line in enumerate(lines)
    ]


def _after(line: Sequence[Point], other: Sequence[Point]) -> list[Point]:
    """The rest of a line after the part that it shares with another line of the same start."""
    k = 1
    while k < min(len(line), len(other)) and line[k] == other[k]:
        k += 1
    rest = [line[k - 1], *line[k:]]
    if k < min(len(line), len(other)) and line[0] == other[0]:
        # The lines part within this segment, where the shorter one of the two ends.
        start, mine, its = line[k - 1], line[k], other[k]
        if _direction(start, mine) == _direction(start, its):
            rest[0] = min(mine, its, key=lambda end: _distance(start, end))
    return rest if line[0] == other[0] else list(line)


def _length(line: Sequence[Point]) -> float:
    return sum(_distance(a, b) for a, b in pairwise(line))


def _distance(a: Point, b: Point) -> float:
    return abs(a[0] - b[0]) + abs(a[1] - b[1])


def _towards(start: Point, end: Point, length: float) -> Point:
    share = length / _distance(start, end)
    return start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share


def _is_on(point: Point, a: Point, b: Point) -> bool:
    level = a[1] == b[1] == point[1] and a[0] <= point[0] <= b[0]
    return level or (a[0] == b[0] == point[0] and a[1] <= point[1] <= b[1])


def _direction(start: Point, end: Point) -> Point:
    return _sign(end[0] - start[0]), _sign(end[1] - start[1])


def _sign(value: float) -> float:
    return float((value > 0) - (value < 0))
