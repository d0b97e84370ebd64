"""Figures and diagrams as inline SVG, with ids that are unique within a page.

In: a figure, or a drawing as text. Out: markup whose ids begin with a name::

    <g id="axes_1">, name "figure-2"  ->  <g id="figure-2-axes_1">
"""

from __future__ import annotations

import io
import re
from typing import Any
from xml.etree import ElementTree

import matplotlib
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from runtime.tables import Html, visible

SVG, XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
MANY_MARKS = 2_000  # more marks are drawn as an image
IMAGE_DPI = 200
# Verdana has the widths of DejaVu Sans, for systems without it.
FONTS = "'DejaVu Sans', Verdana, sans-serif"
# Any: the names of the parameters are a literal type in some versions of matplotlib only.
_SETTINGS: Any = {"svg.fonttype": "none", "svg.hashsalt": "report", "svg.image_inline": True}
_LINK = f"{{{XLINK}}}href"


def figure_svg(figure: Figure, name: str, label: str) -> Html:
    """A matplotlib figure as an SVG element; the same figure gives the same text.

    Parameters
    ----------
    figure : drawn by the functions that also make the pictures of a run.
    name : prefix of all ids, so that they are unique within a page.
    label : a description for screen readers.
    """
    for artist in figure.findobj(_is_dense):
        artist.set_rasterized(True)
    written = io.StringIO()
    with matplotlib.rc_context(_SETTINGS):
        figure.savefig(written, format="svg", dpi=IMAGE_DPI, metadata={"Date": None})
    root = _parse(written.getvalue())
    for child in list(root):
        if child.tag == f"{{{SVG}}}metadata":
            root.remove(child)
    for parent in root.iter(f"{{{SVG}}}defs"):
        for child in parent.findall(f"{{{SVG}}}style"):
            # Its selector '*' would apply to the whole page; the root's style is inherited instead.
            parent.remove(child)
    root.set("style", "stroke-linejoin: round; stroke-linecap: butt")
    return _inline(root, name, label)


def diagram_svg(drawing: str, name: str, label: str) -> Html:
    """A block diagram, as :mod:`runtime.diagrams` draws it, as an SVG element."""
    return _inline(_parse(drawing), name, label)


def _parse(drawing: str) -> ElementTree.Element:
    """A drawing as a tree; characters that are not printable become U+FFFD."""
    return ElementTree.fromstring(drawing if drawing.isprintable() else visible(drawing))


def _is_dense(artist: object) -> bool:
    """Whether an artist has too many marks for an SVG."""
    if isinstance(artist, PathCollection):
        return len(artist.get_offsets()) > MANY_MARKS  # type: ignore[arg-type]
    if not isinstance(artist, Line2D) or artist.get_marker() in ("None", None, "", " "):
        return False
    return len(artist.get_xydata()) > MANY_MARKS  # type: ignore[arg-type]


def _inline(root: ElementTree.Element, name: str, label: str) -> Html:
    """A parsed drawing as an element of a page."""
    for node in root.iter():
        for key, value in node.attrib.items():
            if key == "id":
                node.set(key, f"{name}-{value}")
            elif key in (_LINK, "href") and value.startswith("#"):
                node.set(key, f"#{name}-{value[1:]}")
            elif "url(#" in value:
                node.set(key, value.replace("url(#", f"url(#{name}-"))
            elif "'DejaVu Sans'" in value:
                node.set(key, re.sub(r"'DejaVu Sans'(, [\w' -]+)*", FONTS, value))
    root.set("role", "img")
    root.set("aria-label", label)
    ElementTree.register_namespace("", SVG)
    ElementTree.register_namespace("xlink", XLINK)
    return Html(ElementTree.tostring(root, encoding="unicode"))
