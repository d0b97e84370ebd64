"""Block diagrams of networks: data, layout, shapes, and the formats in which they are written."""

from runtime.diagrams.formats import FORMATS, DiagramFormat, diagram, format_of
from runtime.diagrams.paint import draw
from runtime.diagrams.stored import TOO_LARGE, read_picture, stored_picture
from runtime.diagrams.svg import SvgText, to_svg

__all__ = [
    "FORMATS",
    "TOO_LARGE",
    "DiagramFormat",
    "SvgText",
    "diagram",
    "draw",
    "format_of",
    "read_picture",
    "stored_picture",
    "to_svg",
]
