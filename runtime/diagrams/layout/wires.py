"""Step 6 of the layered layout: tracks in the channels, feedback below the boxes, corners of wires.

In: a :class:`Grid` and the top of each cell. Out: the x of each column and the corners of each
wire, as [(100, 20), (130, 20), (130, 60), (160, 60)] for one that goes down from one box to the
next.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from runtime.diagrams.layout.grid import FeedbackWire, Grid, Pin
from runtime.diagrams.layout.tracks import STRAIGHT, Track, assign_slots

Point = tuple[float, float]

LEAD = 12.0
ARROW = 14.0
TRACK_PITCH = 9.0
FEEDBACK_GAP = 16.0
FEEDBACK_PITCH = 10.0


@dataclass
class Channel:
    """The space left of a column: ``lead`` is kept free for texts, then come the tracks."""

    tracks: dict[int, Track]
    lead: float
    width: float
    x: float = 0.0

    def track_x(self, track: Track) -> float:
        return self.x + self.lead + track.slot * TRACK_PITCH


class WireRouter:
    """Routes the wires between cells of known heights, and sets the positions of the columns.

    Parameters
    ----------
    grid : the cells, in order.
    tops : the y of each cell's top.
    """

    def __init__(self, grid: Grid, tops: Mapping[str, float]) -> None:
        self.grid, self.tops = grid, tops
        self.feedback = {wire.link: wire for wire in grid.feedback}
        self.feedback_ys = self._feedback_heights()
        self.widths = [max(grid.cells[n].width for n in column) for column in grid.columns]
        self.labels = self._label_widths()
        self.channels = [self._channel(c) for c in range(len(grid.columns) + 1)]
        self.xs: list[float] = []
        x = 0.0
        for channel, width in zip(self.channels, [*self.widths, 0.0], strict=True):
            channel.x = x
            self.xs.append(x + channel.width)
            x += channel.width + width
        self.width = x
        lowest = [tops[name] + cell.height for name, cell in grid.cells.items()]
        self.height = max([*lowest, *self.feedback_ys.values()], default=0.0)

    def left_of(self, name: str) -> float:
        """The x of a cell's left edge; cells are centred in their column."""
        column = self.grid.column_of[name]
        return self.xs[column] + (self.widths[column] - self.grid.cells[name].width) / 2

    def route(self, i: int, target: Pin) -> list[Point]:
        """The corners of a wire from its link's source to one of its targets."""
        source = self.grid.links[i].source
        start = self.left_of(source[0]) + self.grid.cells[source[0]].width
        end = (self.left_of(target[0]), self._input_y(target))
        wire = self.feedback.get(i)
        column = self.grid.column_of[target[0]]
        points = [(start, self._output_y(source))]
        if wire is not None and target in wire.targets.get(column, ()):
            points += self._feedback_corners(wire, column, points[0][1], end[1])
        else:
            y = points[0][1]
            for channel in range(self.grid.column_of[source[0]] + 1, column + 1):
                goal = end[1] if channel == column else self.tops[f"{i}@{channel}"]
                points += self._channel_corners(channel, i, y, goal)
                y = goal
        return simplify([*points, end])

    def _output_y(self, pin: Pin) -> float:
        return self.tops[pin[0]] + self.grid.cells[pin[0]].output_y(pin[1])

    def _input_y(self, pin: Pin) -> float:
        return self.tops[pin[0]] + self.grid.cells[pin[0]].input_y(pin[1])

    def _feedback_heights(self) -> dict[int, float]:
        """The y of each feedback wire: below all cells between its ends, short wires innermost."""
        bottoms = [
            max(self.tops[name] + self.grid.cells[name].height for name in column)
            for column in self.grid.columns
        ]
        ys: dict[int, float] = {}
        earlier: list[tuple[int, int, float]] = []
        # Short ones first: a loop within another is drawn within it.
        for wire in sorted(self.grid.feedback, key=lambda o: (o.column - o.first, o.link)):
            first, last = wire.first, wire.column
            y = max(bottoms[max(first - 1, 0) : last + 2]) + FEEDBACK_GAP
            for other_first, other_last, other in earlier:
                if first <= other_last + 1 and other_first <= last + 1:
                    y = max(y, other + FEEDBACK_PITCH)
            earlier.append((first, last, y))
            ys[wire.link] = y
        return ys

    def _label_widths(self) -> list[float]:
        """The width of the labels at the starts of wires in each channel."""
        widths = [0.0] * (len(self.grid.columns) + 1)
        for link in self.grid.links:
            column = self.grid.column_of[link.source[0]]
            # A narrow cell, centred in its column, leaves room beside it for a part of its label.
            spare = (self.widths[column] - self.grid.cells[link.source[0]].width) / 2
            widths[column + 1] = max(widths[column + 1], link.label - spare)
        return widths

    def _channel(self, c: int) -> Channel:
        tracks: dict[int, Track] = {}
        for hop in self.grid.hops[c]:
            rights = [self._input_y(right) for right in hop.rights]
            tracks[hop.link] = Track([self._output_y(hop.left)], rights)
        for wire in self.grid.feedback:
            y = self.feedback_ys[wire.link]
            if wire.column + 1 == c:
                track = tracks.setdefault(wire.link, Track([self._output_y(wire.source)], []))
                track.lefts.append(y)
            if c in wire.targets:
                lefts = [y] if wire.first < c else []
                rights = [self._input_y(pin) for pin in wire.targets[c]]
                tracks[wire.link] = Track(lefts, [*rights, y])
        slots = assign_slots(list(tracks.values()))
        # The first part of a wire is straight, so that the label above it stays clear of all
        # tracks.
        lead = max(LEAD, self.labels[c])
        room = max(slots - 1, 0) * TRACK_PITCH
        # Left of the first column and right of the last there are feedback wires only; without any,
        # nothing.
        if c in (0, len(self.grid.columns)):
            return Channel(tracks, LEAD if c == 0 else lead, room + LEAD + lead if slots else 0.0)
        return Channel(tracks, lead, lead + room + ARROW)

    def _channel_corners(self, c: int, link: int, start: float, end: float) -> list[Point]:
        """The corners of a wire within a channel."""
        channel = self.channels[c]
        track = channel.tracks[link]
        if track.is_straight:
            return []
        x = channel.track_x(track)
        if track.then is None:
            return [(x, start), (x, end)]
        then, middle = channel.track_x(track.then), track.then.lefts[0]
        return [(x, start), (x, middle), (then, middle), (then, end)]

    def _feedback_corners(
        self, wire: FeedbackWire, column: int, start: float, end: float
    ) -> list[Point]:
        y = self.feedback_ys[wire.link]
        leaves, enters = self.channels[wire.column + 1], self.channels[column]
        out = leaves.track_x(leaves.tracks[wire.link])
        back = enters.track_x(enters.tracks[wire.link])
        return [(out, start), (out, y), (back, y), (back, end)]


def simplify(points: list[Point]) -> list[Point]:
    """The points without repeated ones and those in the middle of a straight line."""
    corners: list[Point] = []
    for point in points:
        if corners and abs(corners[-1][0] - point[0]) + abs(corners[-1][1] - point[1]) < STRAIGHT:
            continue
        if len(corners) > 1 and _in_line(corners[-2], corners[-1], point):
            corners.pop()
        corners.append(point)
    return corners


def _in_line(a: Point, b: Point, c: Point) -> bool:
    """Whether a line continues straight at ``b``; a reversal is not straight."""
    for k in (0, 1):
        same = abs(a[1 - k] - b[1 - k]) < STRAIGHT and abs(b[1 - k] - c[1 - k]) < STRAIGHT
        if same and (b[k] - a[k]) * (c[k] - b[k]) > 0:
            return True
    return False
