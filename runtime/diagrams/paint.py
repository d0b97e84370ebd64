"""From a picture to shapes: wires coloured by signal type, boxes by rate, removed blocks grey.

In: a :class:`Picture`. Out: a :class:`Drawing`. The net u.out ─▶ g.input becomes a line, an arrow
head and the label "Scalar", all in the colour of scalars.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import partial
from itertools import cycle

from runtime.diagrams.layout import Point
from runtime.diagrams.picture import CONSTANT, CONTINUOUS, MINUS, Box, Net, Picture
from runtime.diagrams.shapes import (
    CurveShape,
    Dot,
    Drawing,
    Group,
    Rect,
    Shape,
    TextShape,
    arrow_head,
    branchings,
    line_through,
    text_width,
    without_repeats,
)
from runtime.diagrams.sheet import (
    CIRCLE_TOP,
    LABEL_SIZE,
    NAME_SIZE,
    PORT_SIZE,
    TYPE_SIZE,
    VALUE,
    VALUE_SIZE,
    BoxPlacement,
    Sheet,
    footer_height,
    header_height,
    lay_out,
)

PAGE_MARGIN, PAPER_MARGIN = 16.0, 2.0
FULL_LEGEND = 400.0  # the legend of a narrow diagram on a page is as wide as this
LEAST_TYPE = 7.0  # points on paper
LEGEND_GAP, LEGEND_ROW = 30.0, 16.0
TITLE_HEIGHT, TITLE_SIZE = 26.0, 14.0
INK, SOFT, GHOST, PORT_INK = "#1f2937", "#4b5563", "#a7adb8", "#374151"
BORDER, FRAME_BORDER = "#475569", "#c5ccd6"
# Nested frames alternate between the two.
FRAME_FILLS = ("#f5f6f8", "#ebeef2")
GHOST_FILL = "#fafafa"
CONSTANT_TINT, CONTINUOUS_TINT = "#ffffff", "#e7e5e4"
TYPE_COLOURS = {
    "Pose": "#1d4ed8",
    "Twist": "#c2410c",
    "TrackingState": "#7e22ce",
    "Path": "#15803d",
    "Scalar": "#475569",
    "Vector": "#0f766e",
    "WheelSpeeds": "#a16207",
    "Spikes": "#be185d",
    "Scan": "#0369a1",
    "PointCloud": "#4d7c0f",
}
OTHER_COLOURS = ("#9f1239", "#3730a3", "#166534", "#854d0e", "#6b21a8")
# Of 1 kHz, 500, 200, 100, ... 1 Hz: neighbours differ in hue and lightness.
TINTS = (
    "#ffeecf",
    "#a0ebe4",
    "#f2ebff",
    "#ffccb3",
    "#dbf9e2",
    "#bedcff",
    "#ffe4ea",
    "#d8e2a9",
    "#d1f7ff",
    "#f9c9f1",
)


def draw(picture: Picture, paper: float | None = None) -> Drawing:
    """Lay out a picture and turn it into shapes.

    Parameters
    ----------
    picture : what is shown.
    paper : the width of a page or column (points), for a drawing in rows with type of 7 points at
        least, whose title is left to the caption; type is smaller only where a part is too wide.
    """
    if paper is not None:
        return _on_paper(picture, paper)
    return _drawing(picture, None)


def _on_paper(picture: Picture, width: float) -> Drawing:
    """A drawing that is as wide as the paper, or narrower where it does not need all of it."""
    largest = LABEL_SIZE / LEAST_TYPE
    drawing = _drawing(picture, largest * width - 2 * PAPER_MARGIN)
    return replace(drawing.scale(min(1.0, width / drawing.width)), unit="pt")


def _drawing(picture: Picture, row: float | None) -> Drawing:
    """The drawing; in rows of a width, if given, with a small margin and without its title."""
    sheet = lay_out(picture, row)
    painter = _Painter(sheet)
    titles = [painter.title()] if row is None else []
    groups = [*painter.frames(), *painter.nets(), *painter.boxes(), *titles]
    legend = painter.legend(max(sheet.width, row or FULL_LEGEND))
    margin, top = (PAGE_MARGIN, TITLE_HEIGHT) if row is None else (PAPER_MARGIN, 0.0)
    height = sheet.height + 2 * margin + top
    width = max(sheet.width, text_width(picture.title, TITLE_SIZE, bold=True) if titles else 0.0)
    if legend is not None:
        ends = [s.x + text_width(s.text, s.size) for s in legend.shapes if isinstance(s, TextShape)]
        width = max(width, *ends)
        height += max(s.y for s in legend.shapes if isinstance(s, TextShape)) - sheet.height + 10.0
        groups.append(legend)
    wide = width + 2 * margin
    return Drawing(picture.title, wide, height, margin, groups, top)


class _Painter:
    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self.picture = sheet.picture
        self.palette = Palette(sheet.picture)
        self.has_ports = "ports" in sheet.picture.detail

    def title(self) -> Group:
        """The graph's name, above everything."""
        text = TextShape(0.0, 14.0 - TITLE_HEIGHT, self.picture.title, TITLE_SIZE, INK, bold=True)
        return Group("title", "", "", [text])

    def frames(self) -> Iterator[Group]:
        for name, placement in self.sheet.frames.items():
            is_out = self.picture.is_out(name)
            title = self.picture.parts[name].title
            shapes: list[Shape] = [
                Rect(
                    x=placement.x,
                    y=placement.y,
                    width=placement.width,
                    height=placement.height,
                    radius=10.0,
                    fill=GHOST_FILL if is_out else frame_fill(name),
                    stroke=FRAME_BORDER,
                    dashed=is_out,
                ),
                TextShape(
                    placement.x + 12,
                    placement.y + 18,
                    title,
                    11.0,
                    GHOST if is_out else SOFT,
                    bold=True,
                ),
            ]
            yield Group("part", name, f"part {name}", shapes)

    def nets(self) -> Iterator[Group]:
        with_label: set[tuple[str, str]] = set()
        # Wires are drawn on top of removed ones.
        ghosts_first = sorted(enumerate(self.picture.nets), key=lambda item: not item[1].is_ghost)
        for i, net in ghosts_first:
            yield self.net(i, net)
        for net in sorted(self.picture.nets, key=lambda net: net.is_ghost):
            if self.picture.label(net) and net.source not in with_label:
                with_label.add(net.source)
                yield self.label(net)

    def net(self, i: int, net: Net) -> Group:
        colour = self.palette.wire(net)
        lines = [self.line(i, net, target) for target in net.targets]
        forks = branchings(lines)
        shapes: list[Shape] = []
        for line in without_repeats(lines):
            # The line ends inside its arrow head, so that it does not blunt the tip.
            inside = [*line[:-1], (line[-1][0] - 3.0, line[-1][1])]
            commands = line_through(inside, set(forks))
            shapes.append(CurveShape(commands, colour, dashed=net.is_ghost))
        shapes += [arrow_head(line[-1], colour) for line in lines]
        shapes += [Dot(*fork, 2.4, colour) for fork in forks]
        source = ".".join(net.source)
        about = "\n".join(f"{source} → {'.'.join(target)}" for target in net.targets)
        about += f"\n{net.type}" if net.type else ""
        return Group("removed wire" if net.is_ghost else "wire", source, about, shapes)

    def line(self, i: int, net: Net, target: tuple[str, str]) -> list[Point]:
        """The corners of a wire; at a Sum it goes on to the circle."""
        points = list(self.sheet.lines[i, target])
        for at, name, side in ((0, net.source[0], -1.0), (-1, target[0], 1.0)):
            if self.picture.boxes[name].is_sum:
                x, y = points[at]
                points[at] = (x + side * _inset(self.sheet.boxes[name], y), y)
        return points

    def label(self, net: Net) -> Group:
        placement = self.sheet.boxes[net.source[0]]
        x, y = placement.x + placement.width + 5, placement.outputs[net.source[1]] - 4
        text = TextShape(x, y, net.type, LABEL_SIZE, self.palette.wire(net))
        return Group("type", ".".join(net.source), "", [text])

    def boxes(self) -> Iterator[Group]:
        for name, box in self.picture.boxes.items():
            placement = self.sheet.boxes[name]
            if box.is_sum:
                shapes = list(self.circle_of(box, placement))
            else:
                shapes = [*self.frame_of(box, placement), *self.ports_of(box, placement)]
            yield Group("removed block" if box.fate else "block", name, box.about, shapes)

    def frame_of(self, box: Box, placement: BoxPlacement) -> Iterator[Shape]:
        is_out = bool(box.fate)
        middle = placement.x + placement.width / 2
        yield Rect(
            x=placement.x,
            y=placement.y,
            width=placement.width,
            height=placement.height,
            radius=7.0,
            fill=self.palette.box(box),
            stroke=GHOST if is_out else BORDER,
            stroke_width=1.2,
            dashed=is_out,
        )
        ink, soft = (GHOST, GHOST) if is_out else (INK, SOFT)
        free = 0.0
        if not self.has_ports:
            free = (placement.height - header_height(box) - footer_height(box)) / 2
        top, bottom = placement.y + free, placement.y + placement.height - free
        yield TextShape(middle, top + 17, box.title, NAME_SIZE, ink, "middle", bold=True)
        if box.type:
            yield TextShape(middle, top + 30, box.type, TYPE_SIZE, soft, "middle")
        yield from self.value_of(box, middle, top + header_height(box), ink)
        if box.fate or box.rate:
            text = box.fate or box.rate
            yield TextShape(middle, bottom - 7, text, LABEL_SIZE, soft, "middle")

    def value_of(self, box: Box, middle: float, bottom: float, ink: str) -> Iterator[Shape]:
        """A block's value, of two lines a fraction, above a height."""
        y = bottom - VALUE * (1 + box.value.count("\n")) + 9.0
        lines = box.value.split("\n") if box.value else []
        for i, line in enumerate(lines):
            yield TextShape(middle, y + VALUE * i, line, VALUE_SIZE, ink, "middle")
        if len(lines) == 2:
            half = max(text_width(line, VALUE_SIZE) for line in lines) / 2
            ends = (middle - half, y + 4.5), (middle + half, y + 4.5)
            yield CurveShape((("M", (ends[0],)), ("L", (ends[1],))), ink, stroke_width=1.0)

    def circle_of(self, box: Box, placement: BoxPlacement) -> Iterator[Shape]:
        """A Sum: a circle with the signs of its terms, and its name above it."""
        is_out = bool(box.fate)
        size, top = placement.width, placement.y + CIRCLE_TOP
        ink = GHOST if is_out else INK
        yield Rect(
            x=placement.x,
            y=top,
            width=size,
            height=size,
            radius=size / 2,
            fill=self.palette.box(box),
            stroke=GHOST if is_out else BORDER,
            stroke_width=1.2,
            dashed=is_out,
        )
        middle = placement.x + size / 2
        yield TextShape(middle, placement.y + 14, box.title, NAME_SIZE, ink, "middle", bold=True)
        for port, sign in box.signs.items():
            y = placement.inputs[port]
            x = placement.x + _inset(placement, y) + 4
            yield TextShape(x, y + 4, sign, NAME_SIZE, ink, bold=sign == MINUS)
        for port in box.probed:
            y = placement.outputs[port]
            yield _diamond(placement.x + size - _inset(placement, y), y)

    def ports_of(self, box: Box, placement: BoxPlacement) -> Iterator[Shape]:
        ink = GHOST if box.fate else PORT_INK
        for port, y in placement.inputs.items():
            is_open = port in box.open
            if self.has_ports:
                yield TextShape(placement.x + 7, y + 3, port, PORT_SIZE, SOFT if is_open else ink)
            if is_open:
                yield _ring(placement.x, y)
        right = placement.x + placement.width
        for port, y in placement.outputs.items():
            if self.has_ports:
                yield TextShape(right - 7, y + 3, port, PORT_SIZE, ink, "end")
            if port in box.probed:
                yield _diamond(right, y)

    def legend(self, width: float) -> Group | None:
        """The meaning of tints and marks, in rows of a width; None if there are none."""
        boxes = self.picture.boxes.values()
        tints = [(rate, tint, BORDER) for rate, tint in self.palette.tints.items()]
        tints += [(fate, GHOST_FILL, GHOST) for fate in sorted({b.fate for b in boxes if b.fate})]
        samples: list[tuple[str, Callable[[float, float], Shape]]] = []
        if len(tints) > 1:
            samples = [(text, partial(_sample, fill=f, stroke=s)) for text, f, s in tints]
        samples += [("recorded", _diamond)] * any(box.probed for box in boxes)
        samples += [("unconnected", _ring)] * any(box.open for box in boxes)
        if not samples:
            return None
        x, y = 0.0, self.sheet.height + LEGEND_GAP
        shapes: list[Shape] = []
        for text, sample in samples:
            wide = 22 + text_width(text, TYPE_SIZE)
            if x and x + wide > width:
                x, y = 0.0, y + LEGEND_ROW
            shapes += [sample(x + 8.0, y - 3.5), TextShape(x + 22, y, text, TYPE_SIZE, SOFT)]
            x += wide + 18
        return Group("legend", "", "", shapes)


def _sample(x: float, y: float, fill: str, stroke: str) -> Shape:
    """A small box around a point, with the look of boxes."""
    return Rect(x - 8.0, y - 5.5, 16.0, 11.0, 3.0, fill, stroke, dashed=stroke == GHOST)


def _ring(x: float, y: float) -> Shape:
    """The mark of an input that keeps its default."""
    return Rect(x - 3.0, y - 3.0, 6.0, 6.0, 3.0, CONSTANT_TINT, BORDER)


def _diamond(x: float, y: float) -> Shape:
    """The mark of an output that a probe records."""
    ends = ((x + 4.5, y), (x, y + 4.5), (x - 4.5, y))
    return CurveShape(
        (("M", ((x, y - 4.5),)), *(("L", (end,)) for end in ends), ("Z", ())), fill=INK
    )


def _inset(placement: BoxPlacement, y: float) -> float:
    """How far a circle is from the sides of the square around it, at the height ``y``."""
    radius = placement.width / 2
    away = y - (placement.y + CIRCLE_TOP + radius)
    return radius - math.sqrt(max(0.0, radius * radius - away * away))


class Palette:
    """The colours of one picture; ``tints`` maps the rate of a block to its box's colour."""

    def __init__(self, picture: Picture) -> None:
        rates = {
            box.rate: box.period for box in picture.boxes.values() if box.rate and not box.fate
        }
        self.tints: dict[str, str] = {}
        if CONTINUOUS in rates:
            self.tints[CONTINUOUS] = CONTINUOUS_TINT
        for rate, period in sorted(rates.items(), key=lambda item: item[1]):
            if rate not in (CONTINUOUS, CONSTANT):
                self.tints[rate] = tint_of(period, self.tints.values())
        if CONSTANT in rates:
            self.tints[CONSTANT] = CONSTANT_TINT
        kinds = {_family(net) for net in picture.nets}
        others = sorted(kinds - TYPE_COLOURS.keys() - {""})
        self._colours = TYPE_COLOURS | dict(zip(others, cycle(OTHER_COLOURS), strict=False))

    def box(self, box: Box) -> str:
        return GHOST_FILL if box.fate else self.tints.get(box.rate, CONSTANT_TINT)

    def wire(self, net: Net) -> str:
        return GHOST if net.is_ghost else self._colours.get(_family(net), INK)


def tint_of(period: float, in_use: Collection[str]) -> str:
    """The colour of a rate: the same in every diagram, unless another rate there has it already."""
    # Three tints per decade, as rates are chosen (1, 2, 5 times a power of ten): 1 kHz is 0, 500
    # Hz 1, 200 Hz 2, 100 Hz 3.
    first = round(3.0 * math.log10(1000.0 * period)) % len(TINTS)
    order = [*TINTS[first:], *TINTS[:first]]
    return next((tint for tint in order if tint not in in_use), TINTS[first])


def frame_fill(part: str) -> str:
    """The colour of a part's frame, by how deep it is."""
    return FRAME_FILLS[part.count(".") % len(FRAME_FILLS)]


def _family(net: Net) -> str:
    """The type without its length."""
    return net.type.partition("(")[0]
