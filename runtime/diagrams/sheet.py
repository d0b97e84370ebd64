"""The geometry of a diagram's boxes, frames and wires; inner parts are laid out first.

In: a :class:`Picture`. Out: a :class:`Sheet`. A part is laid out on its own, and then is one cell
in the level around it, whose pins are the points at which wires cross its frame::

    wire a.out ─▶ arm.pid.error
    level "":     a ─▶ [arm]      the cell "arm" has the pin "0": the number of the net
    level "arm":  "<0" ─▶ pid     the cell "<0" is the end of the wire at the frame

Laying out all levels at once would let blocks of a part stand among blocks outside of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

from runtime.diagrams.layout import Cell, DiagramLayout, Link, Pin, Point, arrange, fold, simplify
from runtime.diagrams.picture import Box, Net, Picture
from runtime.diagrams.shapes import text_width

NAME_SIZE, TYPE_SIZE, PORT_SIZE, LABEL_SIZE, VALUE_SIZE = 13.0, 10.0, 9.5, 9.0, 11.0
VALUE = 16  # height of a line of a value, below the type
NAME, TYPE, ROW, FOOTER, MARGIN = 23, 13, 16, 20, 10
BARE_FOOTER = 6  # without a rate
MIN_WIDTH = 84
# A Sum is a circle below its name.
CIRCLE, CIRCLE_TOP = 34.0, 20.0
FRAME_TOP, FRAME_BOTTOM, FRAME_SIDE = 28, 14, 16
GHOST_WEIGHT = 0.25


@dataclass
class BoxPlacement:
    """A rectangle; for a block, with the y of each port on its edges."""

    x: float
    y: float
    width: float
    height: float
    inputs: dict[str, float] = field(default_factory=dict)
    outputs: dict[str, float] = field(default_factory=dict)


@dataclass
class Sheet:
    """The geometry of a picture; ``lines`` maps a net's index and a target to its corners."""

    picture: Picture
    width: float
    height: float
    boxes: dict[str, BoxPlacement]
    frames: dict[str, BoxPlacement]
    lines: dict[tuple[int, Pin], list[Point]]


@dataclass
class _Level:
    """The inside of one part (or of the whole graph): its cells, laid out on their own."""

    part: str
    cells: list[Cell]
    links: dict[int, Link]
    layout: DiagramLayout
    x: float = 0.0
    y: float = 0.0

    @cached_property
    def index(self) -> dict[int, int]:
        """The index of each net's link in the layout."""
        return {net: i for i, net in enumerate(self.links)}

    def route(self, net: int, end: Pin) -> list[Point]:
        points = self.layout.routes[self.index[net], end]
        return [(self.x + x, self.y + y) for x, y in points]


def lay_out(picture: Picture, width: float | None = None) -> Sheet:
    """Lay out all boxes, frames and wires of a picture; in rows of a width (points), if given."""
    has_ports = "ports" in picture.detail
    cells = {name: _box_cell(box, has_ports) for name, box in picture.boxes.items()}
    levels: dict[str, _Level] = {}
    # The deepest parts first: the size of a part's cell is that of its finished layout.
    for part in sorted(picture.parts, key=lambda name: -name.count(".")):
        levels[part] = _level(picture, part, cells)
        cells[part] = _frame_cell(picture, levels[part])
    levels[""] = _level(picture, "", cells)
    if width is not None:
        levels[""].layout = fold(levels[""].layout, levels[""].cells, width)
    boxes: dict[str, BoxPlacement] = {}
    frames: dict[str, BoxPlacement] = {}
    # From outside inwards: a frame has to be placed before what is in it.
    for part in ["", *sorted(picture.parts, key=lambda name: name.count("."))]:
        level = levels[part]
        if part:
            level.x += frames[part].x
            level.y += frames[part].y
        for cell in level.cells:
            x, y = level.layout.positions[cell.name]
            x, y = round(level.x + x, 2), round(level.y + y, 2)
            placement = BoxPlacement(x, y, cell.width, cell.height)
            if cell.name in levels:
                frames[cell.name] = placement
            elif cell.name in picture.boxes:
                placement.inputs = {pin: y + cell.input_y(pin) for pin in cell.inputs}
                placement.outputs = {pin: y + cell.output_y(pin) for pin in cell.outputs}
                boxes[cell.name] = placement
    lines = {
        (i, target): _line(picture, levels, i, target)
        for i, net in enumerate(picture.nets)
        for target in net.targets
    }
    top = levels[""].layout
    return Sheet(picture, top.width, top.height, boxes, frames, lines)


def _sum_cell(box: Box) -> Cell:
    """A circle, with its name above it; wires end at the sides of the square around it."""
    rows = max(len(box.inputs), 1)
    size = max(CIRCLE, ROW * rows + 6.0)
    middle = CIRCLE_TOP + size / 2
    ins = [middle + ROW * (i - (len(box.inputs) - 1) / 2) for i in range(len(box.inputs))]
    outs = [middle] * len(box.outputs)
    height = CIRCLE_TOP + size + 2.0
    return Cell(box.name, math.ceil(size), height, box.inputs[:], box.outputs[:], ins, outs, True)


def _box_cell(box: Box, has_ports: bool) -> Cell:
    if box.is_sum:
        return _sum_cell(box)
    inside = [text_width(pin, PORT_SIZE) if has_ports else 0.0 for pin in box.inputs]
    outside = [text_width(pin, PORT_SIZE) if has_ports else 0.0 for pin in box.outputs]
    width = max(
        MIN_WIDTH if has_ports else 0.0,
        text_width(box.title, NAME_SIZE, bold=True) + 2 * MARGIN,
        text_width(box.type, TYPE_SIZE) + 2 * MARGIN,
        *(text_width(line, VALUE_SIZE) + 2 * MARGIN for line in box.value.split("\n")),
        max(inside, default=0.0) + max(outside, default=0.0) + 3 * MARGIN,
    )
    ports = ROW * max(len(inside), len(outside))
    # Without names of ports, wires end beside the text and not below it.
    height: float = header_height(box) + ports + footer_height(box)
    middle = header_height(box) + ports / 2
    if not has_ports:
        height = max(header_height(box) + footer_height(box), ports + 8.0)
        middle = height / 2

    def heights(count: int) -> list[float]:
        return [middle + ROW * (i - (count - 1) / 2) for i in range(count)]

    sides = heights(len(inside)), heights(len(outside))
    name = box.name
    return Cell(
        name,
        math.ceil(width),
        height,
        box.inputs[:],
        box.outputs[:],
        *sides,
        fixed=True,
        stretch=True,
    )


def header_height(box: Box) -> int:
    """The height of a box above its ports: name, type and value."""
    value = VALUE * (1 + box.value.count("\n")) if box.value else 0
    return NAME + (TYPE if box.type else 0) + value


def footer_height(box: Box) -> int:
    """The height of a box below its ports."""
    return FOOTER if box.fate or box.rate else BARE_FOOTER


def _child(level: str, box: Box) -> str | None:
    """The block itself or the inner part that holds it, seen from a part; None if it is outside."""
    if box.part == level:
        return box.name
    prefix = f"{level}." if level else ""
    if not box.part.startswith(prefix):
        return None
    return prefix + box.part.removeprefix(prefix).partition(".")[0]


def _level(picture: Picture, part: str, cells: dict[str, Cell]) -> _Level:
    inner = [name for name, box in picture.boxes.items() if box.part == part]
    inner += [name for name, other in picture.parts.items() if other.parent == part]
    members = {name: cells[name] for name in inner}
    with_label: set[tuple[str, str]] = set()
    links: dict[int, Link] = {}
    for i, net in enumerate(picture.nets):
        source, targets = _ends(picture, part, i, net)
        if not targets:
            continue
        for name in (source[0], *(target for target, _ in targets)):
            if name not in members:
                members[name] = _frame_end(name)
        label = 0.0
        if source[0] in picture.boxes and source not in with_label:
            with_label.add(source)
            text = picture.label(net)
            label = text_width(text, LABEL_SIZE) + 8.0 if text else 0.0
        # Wires of removed blocks may bend and cross, those that run should not.
        weight = GHOST_WEIGHT if net.is_ghost else 1.0
        breaks_loop = picture.breaks_loop(net, source[0] if source[0] in picture.parts else "")
        links[i] = Link(source, tuple(targets), weight, breaks_loop, math.ceil(label))
    inside = list(members.values())
    return _Level(part, inside, links, arrange(inside, list(links.values())))


def _frame_end(name: str) -> Cell:
    """The point where a wire passes through the frame of a part, as a cell."""
    if name.startswith("<"):
        return Cell(name, outputs=[""], output_ys=[0.0], fixed=True, edge="left")
    return Cell(name, inputs=[""], input_ys=[0.0], fixed=True, edge="right")


def _ends(picture: Picture, part: str, i: int, net: Net) -> tuple[Pin, list[Pin]]:
    """A net's ends within one level; no targets if the net is not part of it."""

    def pin(box: str, port: str, outside: Pin) -> Pin:
        child = _child(part, picture.boxes[box])
        if child is None:
            return outside
        return (child, port) if child == box else (child, str(i))

    source = pin(*net.source, (f"<{i}", ""))
    targets = dict.fromkeys(pin(*target, (f">{i}", "")) for target in net.targets)
    # A net that comes in through the frame and would leave again passes outside of the part.
    if source[0] == f"<{i}":
        targets.pop((f">{i}", ""), None)
    if source[0] not in picture.boxes:
        # A wire that starts and ends in the same inner part is drawn there.
        targets.pop(source, None)
    return source, list(targets)


def _frame_cell(picture: Picture, level: _Level) -> Cell:
    """A part as one cell of the level around it; its pins are where wires cross its frame."""
    layout = level.layout
    inputs = [cell for cell in level.cells if cell.edge == "left"]
    outputs = [cell for cell in level.cells if cell.edge == "right"]
    level.x = 0.0 if inputs else float(FRAME_SIDE)
    level.y = float(FRAME_TOP)
    width = level.x + layout.width + (0.0 if outputs else FRAME_SIDE)
    title = text_width(picture.parts[level.part].title + " (removed)", TYPE_SIZE, bold=True)
    width = max(width, title + 2 * MARGIN)
    height = FRAME_TOP + layout.height + FRAME_BOTTOM

    def pins(ends: list[Cell]) -> tuple[list[str], list[float]]:
        # From top to bottom, as the level around the part counts the pins of its cells.
        ends.sort(key=lambda end: layout.positions[end.name][1])
        ys = [FRAME_TOP + layout.positions[end.name][1] for end in ends]
        return [end.name[1:] for end in ends], ys

    (ins, in_ys), (outs, out_ys) = pins(inputs), pins(outputs)
    return Cell(level.part, math.ceil(width), height, ins, outs, in_ys, out_ys, fixed=True)


def _line(picture: Picture, levels: dict[str, _Level], i: int, target: Pin) -> list[Point]:
    """The corners of a wire from its source, out of and into parts, to its target."""
    net = picture.nets[i]
    source_box, target_box = picture.boxes[net.source[0]], picture.boxes[target[0]]
    part, points = source_box.part, []
    # Outwards until a level holds the target as well, then inwards to it.
    while _child(part, target_box) is None:
        points += levels[part].route(i, (f">{i}", ""))
        part = picture.parts[part].parent
    while True:
        child = _child(part, target_box)
        if child is None or child == target_box.name:
            points += levels[part].route(i, target)
            return [(round(x, 2), round(y, 2)) for x, y in simplify(points)]
        points += levels[part].route(i, (child, str(i)))
        part = child
