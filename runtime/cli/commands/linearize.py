"""``runtime linearize``: a graph's continuous part as A, B, C, D, its poles and responses."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.arguments import add_json, at_least
from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.errors import UsageError
from runtime.terminal import number, show, show_json, table

if TYPE_CHECKING:
    from runtime.runs import Linearization

HELP = "linearize at an operating point: A, B, C, D, poles, step response, Bode plot"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    parser.add_argument(
        *("--inputs",),
        default="",
        metavar="PORTS",
        help="inputs of blocks, or outputs that drive the system: plant.torque,step.out",
    )
    parser.add_argument(
        "--outputs", default="", metavar="SIGNALS", help="outputs or states: plant.angle"
    )
    parser.add_argument(
        *("--at",),
        type=at_least(0.0),
        default=0.0,
        metavar="S",
        help="time of the operating point, s: the graph runs up to there (0)",
    )
    parser.add_argument(
        *("--state",),
        action="append",
        default=[],
        metavar="STATE=VALUE",
        help="a continuous state at the operating point: plant.theta=0.1; repeatable",
    )
    parser.add_argument(
        "-o", "--out", metavar="FILE", help="draw poles and responses: png, svg, pdf"
    )
    add_json(parser)


def run(options: Namespace) -> int:
    """Print the matrices and the poles; draw them if asked."""
    graph = changed_graph(options.graph, options)
    inputs, outputs = _names(options.inputs), _names(options.outputs)
    states = dict(_state(text) for text in options.state)
    found = graph.linearize(inputs, outputs, at=options.at, states=states)
    if options.json:
        show_json(found.to_dict())
    else:
        show(_text(graph.title, found))
    if options.out:
        _draw(graph.title, found, Path(options.out))
        if not options.json:
            show(options.out)
    return 0


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _state(text: str) -> tuple[str, Any]:
    from runtime.document import parse_scalar

    address, equals, written = text.partition("=")
    values = [parse_scalar(part.strip()) for part in written.strip("[] ").split(",")]
    if not equals or not all(isinstance(v, (int, float)) for v in values):
        raise UsageError(f"--state {text}: expected a state and its value, as in plant.theta=0.1")
    return address.strip(), values if written.strip().startswith("[") else values[0]


def _text(title: str, found: Linearization) -> str:
    lines = [f"{title}: linearized at t = {found.t:g} {found.time_unit}", "", "Operating point"]
    point = zip(found.states, found.point.tolist(), strict=True)
    lines += [f"  {name} = {number(value)}" for name, value in point]
    for name, matrix, rows, columns in (
        ("A", found.a, found.states, found.states),
        ("B", found.b, found.states, found.inputs),
        ("C", found.c, found.outputs, found.states),
        ("D", found.d, found.outputs, found.inputs),
    ):
        if rows and columns:
            cells = [("", *columns)]
            cells += [(row, *map(number, m.tolist())) for row, m in zip(rows, matrix, strict=True)]
            lines += ["", name, table(cells, right=range(1, len(columns) + 1))]
    lines += ["", f"Poles (1/{found.time_unit})"]
    for pole in found.poles:
        lines.append(f"  {pole.real:.6g} {'+' if pole.imag >= 0 else '-'} {abs(pole.imag):.6g}j")
    return "\n".join(lines)


def _draw(title: str, found: Linearization, path: Path) -> None:
    from runtime.plots import FORMATS, draw_linear, save_figure

    if path.suffix.lstrip(".") not in FORMATS:
        raise UsageError(f"--out {path}: expected a file that ends in .{', .'.join(FORMATS)}")
    if not found.inputs or not found.outputs:
        raise UsageError("a figure needs --inputs and --outputs")
    matrices = (found.a, found.b, found.c, found.d)
    save_figure(draw_linear(matrices, found.inputs, found.outputs, title, found.time_unit), path)
