"""Block diagrams of networks: data, layout, shapes, and the formats in which they are written.

In: a checked network. Out: a string or bytes in one of the formats::

    network ─▶ picture  boxes, parts, nets: what is drawn
            ─▶ sheet    where: positions of boxes, corners of wires (``layout``)
            ─▶ drawing  shapes with colours ─▶ svg, png, pdf
    Graphviz and Mermaid lay out themselves: their text is made from the picture.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.diagrams.formats import FORMATS, DiagramFormat, diagram, format_of
    from runtime.diagrams.paint import draw
    from runtime.diagrams.stored import TOO_LARGE, read_picture, stored_picture
    from runtime.diagrams.svg import SvgText, to_svg
else:
    __getattr__ = door(__name__)

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
