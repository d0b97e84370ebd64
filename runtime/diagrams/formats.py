"""The formats of diagrams, and drawing a network in one of them.

In: a checked network and the name of a format. Out: the picture as text or bytes. A package
offers a :class:`DiagramFormat` under an entry point of the group ``spikeblocks.diagrams``::

    diagram(network, "mermaid")     # flowchart LR ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from blocks.library.extensions import Registry
from runtime.arguments import chosen
from runtime.diagrams.paint import draw
from runtime.diagrams.picture import DETAILS, picture_of
from runtime.diagrams.shapes import Drawing
from runtime.errors import UsageError
from runtime.network import Network
from runtime.observation import Probe


@dataclass(frozen=True)
class DiagramFormat:
    """One way to write the block diagram of a network.

    Parameters
    ----------
    doc : what it is, in a few words.
    write : from a checked network to text or bytes; the same network gives the same bytes.
    suffixes : of files in this format, beside its name.
    render : in place of ``write``, from shapes that are laid out here, which fit on paper.
    """

    doc: str
    write: Callable[[Network], str | bytes] | None = None
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


def _tikz(drawing: Drawing) -> str:
    from runtime.diagrams.tikz import to_tikz

    return to_tikz(drawing)


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
        "svg": DiagramFormat("a picture with hovering texts", render=_svg),
        "png": DiagramFormat("a picture of pixels", render=_png),
        "pdf": DiagramFormat("a picture on a page", render=_pdf),
        "tikz": DiagramFormat("a picture for LaTeX, in its fonts", None, ("tex",), _tikz),
        "dot": DiagramFormat("text that Graphviz lays out", _dot, ("gv",)),
        "mermaid": DiagramFormat("text that Mermaid lays out", _mermaid, ("mmd", "md")),
    },
)


def format_of(suffix: str) -> str:
    """The format that files with a suffix are in, as "dot" for "gv"; else the suffix itself."""
    return next((name for name, kind in FORMATS.items() if suffix in kind.suffixes), suffix)


def diagram(
    network: Network,
    format: str,
    paper: float | None = None,
    probes: Iterable[Probe] = (),
    detail: Iterable[str] | None = None,
) -> str | bytes:
    """Draw the block diagram of a network.

    Parameters
    ----------
    network : a checked network; removed blocks are drawn in grey.
    format : "svg", "png", "pdf" or "tikz" for a picture that is laid out here, "dot" or "mermaid"
        for a text that Graphviz or Mermaid lays out, or a format of an installed package.
    paper : the width of a column of paper (points, 1/72 inch), for a picture in rows.
    probes : whose signals are marked in a picture.
    detail : what a picture shows beside names and wires, of "blocks", "types", "rates", "ports",
        "values" and "probes"; all of it, on paper without "types" of signals.

    Returns
    -------
    The text, or the bytes of the png or pdf. The same network gives the same bytes.

    Raises
    ------
    UsageError : there is no such format or detail, or a format that another program lays out is
        asked for a width or a detail.
    """
    kind = chosen(FORMATS, format, "diagram format")
    if kind.render is not None:
        if detail is None:
            # Words between columns would halve what fits into a row; colours say the types, too.
            detail = DETAILS if paper is None else (each for each in DETAILS if each != "types")
        return kind.render(draw(picture_of(network, probes).only(detail), paper))
    if paper is not None or detail is not None:
        names = ", ".join(name for name, each in FORMATS.items() if each.render is not None)
        what = "of a given width" if paper is not None else "with another detail"
        raise UsageError(f"a diagram {what} is drawn as {names}, not as {format}")
    if kind.write is None:
        raise UsageError(f"the diagram format {format} has neither write nor render")
    return kind.write(network)
