"""Draws a network in one of the diagram formats."""

from __future__ import annotations

from runtime.diagrams.picture import picture_of
from runtime.errors import UsageError
from runtime.network import Network

FORMATS = ("svg", "png", "pdf", "dot", "mermaid")


def diagram(network: Network, format: str) -> str | bytes:
    """Draw the block diagram of a network.

    Parameters
    ----------
    network : a checked network; removed blocks are drawn in grey.
    format : "svg", "png" or "pdf" for a picture that is laid out here, "dot" or "mermaid" for a
        text that Graphviz or Mermaid lays out.

    Returns
    -------
    The text, or the bytes of the png or pdf. The same network gives the same bytes.

    Raises
    ------
    UsageError : there is no such format.
    """
    if format not in FORMATS:
        raise UsageError(f"no diagram format '{format}'; expected {', '.join(FORMATS)}")
    picture = picture_of(network)
    if format == "dot":
        from runtime.diagrams.text import to_dot

        return to_dot(picture)
    if format == "mermaid":
        from runtime.diagrams.text import to_mermaid

        return to_mermaid(picture)
    from runtime.diagrams.paint import draw

    drawing = draw(picture)
    if format == "svg":
        from runtime.diagrams.svg import to_svg

        return to_svg(drawing)
    from runtime.diagrams.png import to_pdf, to_png

    return to_pdf(drawing) if format == "pdf" else to_png(drawing)
