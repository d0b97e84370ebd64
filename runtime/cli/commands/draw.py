"""``runtime draw``: draw the block diagram."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.terminal import show

HELP = "draw the block diagram: svg, png, pdf, dot, mermaid"
EXAMPLES = """
runtime draw my.yaml
runtime draw my.yaml --without adaptive -o figure.pdf
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    parser.add_argument(
        "-o", "--out", metavar="FILE", help="file to write (<graph>.svg); - is stdout"
    )
    parser.add_argument(
        "--format", metavar="F", help="svg, png, pdf, dot or mermaid (by the file's suffix)"
    )


def run(options: Namespace) -> int:
    """Write the block diagram."""
    from runtime.diagrams import diagram, format_of
    from runtime.files import system_errors

    graph = changed_graph(options.graph, options)
    network = graph.network
    written = options.out or f"{Path(options.graph).stem}.{options.format or 'svg'}"
    suffix = "svg" if written == "-" else Path(written).suffix.lstrip(".")
    kind = options.format or format_of(suffix)
    drawn = diagram(network, kind)
    content = drawn.encode() if isinstance(drawn, str) else drawn
    if written == "-":
        sys.stdout.buffer.write(content)
        return 0
    with system_errors(f"write '{written}'"):
        Path(written).write_bytes(content)
    show(written)
    return 0
