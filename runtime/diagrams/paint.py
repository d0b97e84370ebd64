"""From a sheet to shapes: colours by signal type, tints by rate, grey for what was taken out."""

from __future__ import annotations

from collections.abc import Iterator

from runtime.diagrams.diagram import CONSTANT, Box, Net, Picture, rate_text
from runtime.diagrams.palette import (
    BORDER,
    CONSTANT_TINT,
    FRAME_BORDER,
    GHOST,
    GHOST_FILL,
    INK,
    PORT_INK,
    SOFT,
    Palette,
    frame_fill,
)
from runtime.diagrams.shapes import (
    Curve,
    Dot,
    Drawing,
    Group,
    Rect,
    Shape,
    Text,
    arrow_head,
    branchings,
    line_through,
    text_width,
    without_repeats,
)
from runtime.diagrams.sheet import (
    LABEL_SIZE,
    NAME_SIZE,
    PORT_SIZE,
    TYPE_SIZE,
    Place,
    Sheet,
    lay_out,
)

PAGE_MARGIN = 16.0
LEGEND_HEIGHT = 40.0


def draw(picture: Picture) -> Drawing:
    """Lay out a picture and turn it into shapes."""
    sheet = lay_out(picture)
    painter = _Painter(sheet)
    groups = [*painter.frames(), *painter.nets(), *painter.boxes()]
    legend = painter.legend()
    height = sheet.height + 2 * PAGE_MARGIN
    width = sheet.width
    if legend is not None:
        ends = [s.x + text_width(s.text, s.size) for s in legend.shapes if isinstance(s, Text)]
        width = max(width, *ends)
        height += LEGEND_HEIGHT
        groups.append(legend)
    return Drawing(picture.title, width + 2 * PAGE_MARGIN, height, PAGE_MARGIN, groups)


class _Painter:
    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self.picture = sheet.picture
        self.palette = Palette(sheet.picture)

    def frames(self) -> Iterator[Group]:
        for name, place in self.sheet.frames.items():
            is_out = self.picture.is_out(name)
            title = self.picture.parts[name].title
            shapes: list[Shape] = [
                Rect(
                    *(place.x, place.y, place.width, place.height, 10.0),
                    GHOST_FILL if is_out else frame_fill(name),
                    FRAME_BORDER,
                    dashed=is_out,
                ),
                Text(place.x + 12, place.y + 18, title, 11.0, GHOST if is_out else SOFT, bold=True),
            ]
            yield Group("part", name, f"part {name}", shapes)

    def nets(self) -> Iterator[Group]:
        labelled: set[tuple[str, str]] = set()
        # What is wired is drawn on top of what was taken out.
        ghosts_first = sorted(enumerate(self.picture.nets), key=lambda item: not item[1].is_ghost)
        for i, net in ghosts_first:
            yield self.net(i, net)
        for net in sorted(self.picture.nets, key=lambda net: net.is_ghost):
            if net.type and net.source not in labelled:
                labelled.add(net.source)
                yield self.label(net)

    def net(self, i: int, net: Net) -> Group:
        colour = self.palette.wire(net)
        lines = [self.sheet.lines[i, target] for target in net.targets]
        forks = branchings(lines)
        shapes: list[Shape] = []
        for line in without_repeats(lines):
            # The line ends inside its arrow head, so that the tip stays sharp.
            inside = [*line[:-1], (line[-1][0] - 3.0, line[-1][1])]
            commands = line_through(inside, set(forks))
            shapes.append(Curve(commands, colour, dashed=net.is_ghost))
        shapes += [arrow_head(line[-1], colour) for line in lines]
        shapes += [Dot(*fork, 2.4, colour) for fork in forks]
        source = ".".join(net.source)
        about = "\n".join(f"{source} → {'.'.join(target)}" for target in net.targets)
        about += f"\n{net.type}" if net.type else ""
        return Group("removed wire" if net.is_ghost else "wire", source, about, shapes)

    def label(self, net: Net) -> Group:
        place = self.sheet.boxes[net.source[0]]
        x, y = place.x + place.width + 5, place.outputs[net.source[1]] - 4
        text = Text(x, y, net.type, LABEL_SIZE, self.palette.wire(net))
        return Group("type", ".".join(net.source), "", [text])

    def boxes(self) -> Iterator[Group]:
        for name, box in self.picture.boxes.items():
            place = self.sheet.boxes[name]
            shapes = [*self.frame_of(box, place), *self.ports_of(box, place)]
            yield Group("removed block" if box.fate else "block", name, box.about, shapes)

    def frame_of(self, box: Box, place: Place) -> Iterator[Shape]:
        is_out = bool(box.fate)
        middle = place.x + place.width / 2
        yield Rect(
            *(place.x, place.y, place.width, place.height, 7.0),
            GHOST_FILL if is_out else self.palette.tints[box.period],
            GHOST if is_out else BORDER,
            stroke_width=1.2,
            dashed=is_out,
        )
        ink, soft = (GHOST, GHOST) if is_out else (INK, SOFT)
        yield Text(middle, place.y + 17, box.title, NAME_SIZE, ink, "middle", bold=True)
        yield Text(middle, place.y + 30, box.type, TYPE_SIZE, soft, "middle")
        bottom = place.y + place.height - 7
        yield Text(middle, bottom, box.fate or box.rate, LABEL_SIZE, soft, "middle")

    def ports_of(self, box: Box, place: Place) -> Iterator[Shape]:
        ink = GHOST if box.fate else PORT_INK
        for port, y in place.inputs.items():
            yield Text(place.x + 7, y + 3, port, PORT_SIZE, ink)
        for port, y in place.outputs.items():
            right = place.x + place.width
            yield Text(right - 7, y + 3, port, PORT_SIZE, ink, "end")

    def legend(self) -> Group | None:
        """What the tints mean; None where there is nothing to tell apart."""
        entries = [(rate_text(p), tint, BORDER) for p, tint in self.palette.tints.items() if p]
        if 0.0 in self.palette.tints:
            entries.append((CONSTANT, CONSTANT_TINT, BORDER))
        fates = sorted({box.fate for box in self.picture.boxes.values() if box.fate})
        entries += [(fate, GHOST_FILL, GHOST) for fate in fates]
        if len(entries) < 2:
            return None
        x, y = 0.0, self.sheet.height + LEGEND_HEIGHT - 10
        shapes: list[Shape] = []
        for text, fill, stroke in entries:
            dashed = stroke == GHOST
            shapes.append(Rect(x, y - 9, 16.0, 11.0, 3.0, fill, stroke, dashed=dashed))
            shapes.append(Text(x + 22, y, text, TYPE_SIZE, SOFT))
            x += 22 + text_width(text, TYPE_SIZE) + 18
        return Group("legend", "", "", shapes)
