"""The formats of diagrams, and drawing a network in one of them.

In: a checked network and the name of a format. Out: the picture as text or bytes. A package
offers a :class:`DiagramFormat` under an entry point of the group ``spikeblocks.diagrams``::

    diagram(network, "mermaid")     # flowchart LR ...
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from blocks.extensions import Registry
from runtime.arguments import chosen
from runtime.diagrams.paint import draw
from runtime.diagrams.picture import picture_of
from runtime.diagrams.shapes import Drawing
from runtime.errors import UsageError
from runtime.network import Network


@dataclass(frozen=True)
class DiagramFormat:
    """One way to write the block diagram of a network.

    Parameters
    ----------
    doc : what it is, in a few words.
    write : from a checked network to text or bytes; the same network gives the same bytes.
    suffixes : of files in this format, beside its name.
    render : of a format that is drawn here, from the shapes; only such a one fits on paper.
    """

    doc: str
    write: Callable[[Network], str | bytes]
    suffixes: tuple[str, ...] = ()
    render: Callable[[Drawing], str | bytes] | None = None


def _svg(drawing: Drawing) -> str:
    from runtime.diagrams.svg import to_svg

    return to_svg(drawing)


def _png(drawing: Drawing) -> bytes:
    from runtime.diagrams.png import to_png

    return to_png(drawing)


def _pdf(drawing: Drawing) -> bytes:
    from runtime.diagrams.png import to_pdf

    return to_pdf(drawing)


def _drawn(doc: str, render: Callable[[Drawing], str | bytes]) -> DiagramFormat:
    return DiagramFormat(doc, lambda network: render(draw(picture_of(network))), render=render)


def _dot(network: Network) -> str:
    from runtime.diagrams.text import to_dot

    return to_dot(picture_of(network))


def _mermaid(network: Network) -> str:
    from runtime.diagrams.text import to_mermaid

    return to_mermaid(picture_of(network))


FORMATS: Registry[DiagramFormat] = Registry(
    "diagrams",
    DiagramFormat,
    "a DiagramFormat",
    own={
        "svg": _drawn("a picture with hovering texts", _svg),
        "png": _drawn("a picture of pixels", _png),
        "pdf": _drawn("a picture on a page", _pdf),
        "dot": DiagramFormat("text that Graphviz lays out", _dot, ("gv",)),
        "mermaid": DiagramFormat("text that Mermaid lays out", _mermaid, ("mmd", "md")),
    },
)


def format_of(suffix: str) -> str:
    """The format that files with a suffix are in, as "dot" for "gv"; else the suffix itself."""
    return next((name for name, kind in FORMATS.items() if suffix in kind.suffixes), suffix)


def diagram(network: Network, format: str, paper: float | None = None) -> str | bytes:
    """Draw the block diagram of a network.

    Parameters
    ----------
    network : a checked network; removed blocks are drawn in grey.
    format : "svg", "png" or "pdf" for a picture that is laid out here, "dot" or "mermaid" for a
        text that Graphviz or Mermaid lays out, or a format of an installed package.
    paper : the width of a column of paper (points, 1/72 inch), for a picture in rows.

    Returns
    -------
    The text, or the bytes of the png or pdf. The same network gives the same bytes.

    Raises
    ------
    UsageError : there is no such format, or it is not for paper.
    """
    kind = chosen(FORMATS, format, "diagram format")
    if paper is None:
        return kind.write(network)
    if kind.render is None:
        names = ", ".join(name for name, each in FORMATS.items() if each.render is not None)
        raise UsageError(f"a diagram of a given width is drawn as {names}, not as {format}")
    return kind.render(draw(picture_of(network), paper))
