"""The colours of a diagram: wires by signal type, boxes by rate, grey for what was taken out."""

from __future__ import annotations

from itertools import cycle

from runtime.diagrams.diagram import Net, Picture

INK, SOFT, GHOST, PORT_INK = "#1f2937", "#6b7280", "#a7adb8", "#374151"
BORDER, FRAME_BORDER = "#475569", "#c5ccd6"
# A frame within a frame stands out from it.
FRAME_FILLS = ("#f5f6f8", "#ebeef2")
GHOST_FILL = "#fafafa"
CONSTANT_TINT = "#ffffff"
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
TINTS = ("#fff7e8", "#e9f1fc", "#eaf6ec", "#f3edfb", "#fdecee", "#e8f6f6")


class Palette:
    """The colours of one picture; ``tints`` maps the step of a block to its box's colour."""

    def __init__(self, picture: Picture) -> None:
        periods = {box.period for box in picture.boxes.values() if not box.fate}
        self.tints = dict(zip(sorted(periods - {0.0}), cycle(TINTS), strict=False))
        if 0.0 in periods:
            self.tints[0.0] = CONSTANT_TINT
        kinds = {_family(net) for net in picture.nets}
        others = sorted(kinds - TYPE_COLOURS.keys() - {""})
        self._colours = TYPE_COLOURS | dict(zip(others, cycle(OTHER_COLOURS), strict=False))

    def wire(self, net: Net) -> str:
        return GHOST if net.is_ghost else self._colours.get(_family(net), INK)


def frame_fill(part: str) -> str:
    """The colour of a part's frame, by how deep it is."""
    return FRAME_FILLS[part.count(".") % len(FRAME_FILLS)]


def _family(net: Net) -> str:
    """The type without its length."""
    return net.type.partition("(")[0]
