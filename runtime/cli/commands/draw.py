"""``runtime draw``: draw the block diagram."""

from __future__ import annotations

import re
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path

from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.terminal import show

HELP = "draw the block diagram: svg, png, pdf, tikz, dot, mermaid"
EXAMPLES = """
runtime draw my.yaml
runtime draw my.yaml --without adaptive --width 89mm -o figure.pdf
runtime draw my.yaml --width 89mm --detail blocks,values -o figure.tex
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    parser.add_argument(
        "-o", "--out", metavar="FILE", help="file to write (<graph>.svg); - is stdout"
    )
    parser.add_argument(
        "--format", metavar="F", help="svg, png, pdf, tikz, dot or mermaid (by the file's suffix)"
    )
    parser.add_argument(
        "--width",
        type=_points,
        metavar="LENGTH",
        help="fit it on paper, in rows with type of 7 points: 89mm, 3.5in, 252pt",
    )
    parser.add_argument(
        "--detail",
        type=_details,
        metavar="LIST",
        help="what to show beside names and wires: none, or some of blocks (their types), "
        "types (of signals), rates, ports, values, probes; all, with --width all but types",
    )


POINTS = {"mm": 72.0 / 25.4, "cm": 720.0 / 25.4, "in": 72.0, "pt": 1.0}


def _points(text: str) -> float:
    """A length in points."""
    found = re.fullmatch(r"([\d.]+) ?(mm|cm|in|pt)", text)
    try:
        length = float(found[1]) * POINTS[found[2]] if found else 0.0
    except ValueError:
        length = 0.0
    if not 72.0 <= length <= 7200.0:
        raise ArgumentTypeError(f"expected a length from 1in to 100in, as 89mm, got '{text}'")
    return length


def _details(text: str) -> list[str]:
    """The names in a list; their spelling is checked where they are known."""
    return [] if text == "none" else [name.strip() for name in text.split(",")]


def run(options: Namespace) -> int:
    """Write the block diagram."""
    from runtime.diagrams import format_of
    from runtime.files import system_errors, write_out

    graph = changed_graph(options.graph, options)
    written = options.out or f"{Path(options.graph).stem}.{options.format or 'svg'}"
    suffix = "svg" if written == "-" else Path(written).suffix.lstrip(".")
    kind = options.format or format_of(suffix)
    drawn = graph.diagram(kind, options.width, options.detail)
    content = drawn.encode() if isinstance(drawn, str) else drawn
    if written == "-":
        sys.stdout.buffer.write(content)
        return 0
    with system_errors(f"write '{written}'"):
        write_out(Path(written), content)
    show(written)
    return 0
