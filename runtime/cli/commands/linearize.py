"""``runtime linearize``: a graph as A, B, C, D, with poles, responses, margins and equilibria."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.arguments import add_json, add_style, at_least
from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.errors import UsageError
from runtime.files import write_out
from runtime.terminal import show, show_json, tell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from runtime.graph import Graph
    from runtime.runs import Linearization

HELP = "linearize at an operating point: matrices, poles, margins, steps"
ABOUT = """
The graph as a linear system, for small deviations from an operating point: in continuous time, or,
with sampled blocks in the loop, exactly as the loop is at their common period (poles in the z
plane, with the s that they stand for). The operating point is the start of the run, the time that
--at names, or an equilibrium that --trim finds.
"""
EXAMPLES = """
runtime linearize gallery/pid_loop --inputs setpoint.out --outputs gain.out
runtime linearize gallery/pid_loop --open pid.out --margins -o margins.png
"""
LOCUS_VALUES = 60


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    for flag, form, text in (
        ("--inputs", "PORTS", "inputs of blocks, or outputs that drive the system: p.torque,u.out"),
        ("--outputs", "SIGNALS", "outputs or states: plant.angle"),
        ("--open", "SIGNAL", "cut the loop at this output; alone, show the loop transfer function"),
    ):
        parser.add_argument(flag, default="", metavar=form, help=text)
    message = "time of the operating point, s: the graph runs up to there (0)"
    parser.add_argument("--at", type=at_least(0.0), default=0.0, metavar="S", help=message)
    message = "a state at the operating point: plant.theta=0.1; repeatable"
    _repeatable(parser, "--state", "STATE=VALUE", message)
    trim = parser.add_argument_group("equilibria")
    message = "find one, with --inputs free; write it as an overlay for --with"
    trim.add_argument("--trim", metavar="FILE", help=message)
    message = "a state, input or output with this value; repeatable"
    _repeatable(trim, "--fix", "NAME=VALUE", message)
    message = "a state, input or output in this range; repeatable"
    _repeatable(trim, "--bound", "NAME=LOW..HIGH", message)
    figures = parser.add_argument_group("numbers and figures (extra 'control' for --step)")
    kind = figures.add_mutually_exclusive_group()
    kind.add_argument("--margins", action="store_true", help="gain, phase and delay margin")
    kind.add_argument("--step", action="store_true", help="rise and settling time, overshoot")
    kind.add_argument("--nyquist", action="store_true", help="Nyquist plot and sensitivity")
    message = "poles while an entry of the graph changes: blocks.pid.kp=0.1..10"
    kind.add_argument("--rlocus", metavar="PARAM=RANGE", help=message)
    message = "draw: poles and responses, or what was asked for; png, svg, pdf"
    figures.add_argument("-o", "--out", metavar="FILE", help=message)
    add_style(parser)
    add_json(parser)


def _repeatable(parser: Any, flag: str, form: str, message: str) -> None:
    parser.add_argument(flag, action="append", default=[], metavar=form, help=message)


def run(options: Namespace) -> int:
    """Print the matrices and the poles, or what was asked for; draw it."""
    from runtime.cli.linear_text import as_text, margins_text

    path = _path(options)
    graph = changed_graph(options.graph, options)
    states = dict(_state("--state", text) for text in options.state)
    given: dict[str, Any] = {}
    if options.trim:
        found_rest = _trimmed(graph, options, states)
        if found_rest is None:
            return 1
        graph, given["trim"], states = *found_rest, {}
    found = _linearized(graph, options, states)
    texts = [as_text(graph.title, found)]
    if options.margins or options.step:
        from runtime.runs import margins, step_info

        numbers = vars(margins(found)) if options.margins else step_info(found)
        given["margins" if options.margins else "step"] = numbers
        texts.append(margins_text(numbers, found.time_unit))
    if options.json:
        show_json(found.to_dict() | given)
    else:
        show("\n\n".join(texts))
    if path is not None:
        from runtime.plots import save_figure

        save_figure(_figure(graph, found, options, states, given), path)
        if not options.json:
            show(str(path))
    return 0


def _path(options: Namespace) -> Path | None:
    """The file of the figure, checked before the graph is run."""
    from runtime.plots import FORMATS

    if options.out is None:
        if options.nyquist or options.rlocus:
            raise UsageError("name the file of the figure: -o FILE")
        return None
    path = Path(options.out)
    if path.suffix.lstrip(".") not in FORMATS:
        raise UsageError(f"--out {path}: expected a file that ends in .{', .'.join(FORMATS)}")
    loops = options.margins or options.nyquist
    if loops and not (options.open or (options.inputs and options.outputs)):
        raise UsageError("name the signal at which the loop is cut: --open SIGNAL")
    if not (loops or options.rlocus or options.open or (options.inputs and options.outputs)):
        raise UsageError("a figure needs --inputs and --outputs")
    return path


def _linearized(graph: Graph, options: Namespace, states: dict[str, Any]) -> Linearization:
    inputs, outputs = _names(options.inputs), _names(options.outputs)
    return graph.linearize(inputs, outputs, at=options.at, states=states, opened=options.open)


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _state(flag: str, text: str) -> tuple[str, Any]:
    from runtime.document import parse_scalar

    address, equals, written = text.partition("=")
    values = [parse_scalar(part.strip()) for part in written.strip("[] ").split(",")]
    if not equals or not all(isinstance(v, (int, float)) for v in values):
        raise UsageError(f"{flag} {text}: expected a name and a value, as in plant.theta=0.1")
    return address.strip(), values if written.strip().startswith("[") else values[0]


def _range(flag: str, text: str) -> tuple[str, float, float]:
    address, equals, written = text.partition("=")
    low, dots, high = written.partition("..")
    try:
        ends = float(low or "-inf"), float(high or "inf")
    except ValueError:
        ends = 0.0, 0.0
    if not (equals and dots and ends[0] < ends[1]):
        raise UsageError(f"{flag} {text}: expected a name and a range, as in pid.kp=0.1..10")
    return address.strip(), *ends


def _trimmed(
    graph: Graph, options: Namespace, states: dict[str, Any]
) -> tuple[Graph, dict[str, Any]] | None:
    """The graph at an equilibrium, which is written as an overlay; None if there is none."""
    from runtime.cli.linear_text import overlay_text, trim_text

    fixed = dict(_state("--fix", text) for text in options.fix)
    bounds = {
        name: (low, high) for name, low, high in (_range("--bound", t) for t in options.bound)
    }
    found = graph.trim(
        *(_names(options.inputs), _names(options.outputs)),
        fixed=fixed,
        bounds=bounds,
        at=options.at,
        states=states,
    )
    if not options.json or not found.is_equilibrium:
        (show if found.is_equilibrium else tell)(trim_text(found))
    if not found.is_equilibrium:
        return None
    write_out(Path(options.trim), overlay_text(graph.title, found))
    if not options.json:
        show(f"{options.trim}\n")
    return graph.overlay(options.trim), {
        name: dict(getattr(found, name)) for name in ("inputs", "states", "outputs")
    }


def _figure(
    graph: Graph,
    found: Linearization,
    options: Namespace,
    states: dict[str, Any],
    given: dict[str, Any],
) -> Figure:
    from runtime.cli.linear_text import crossings
    from runtime.plots import LinearSystem, draw_linear, draw_locus, draw_margins, draw_nyquist

    names = found.inputs, found.outputs
    system = LinearSystem(found.a, found.b, found.c, found.d, *names, found.period, found.time_unit)
    what = f"loop opened at {found.opened}" if found.opened else "linearized"
    title = (graph.title, f"{what}, t = {options.at:g} {found.time_unit}")
    look = options.style
    if options.rlocus:
        name, low, high = _range("--rlocus", options.rlocus)
        is_log = low > 0.0 and high >= 20.0 * low
        import numpy as np

        values = (np.geomspace if is_log else np.linspace)(low, high, LOCUS_VALUES)
        poles = [
            _linearized(graph.set(name, float(v), origin="--rlocus"), options, states).poles
            for v in values
        ]
        return draw_locus(values, poles, name, found.period, found.time_unit, title, look)
    if options.nyquist:
        return draw_nyquist(system, title, look)
    if options.margins:
        return draw_margins(system, crossings(given["margins"], found.time_unit), title, look)
    return draw_linear(system, title, look)
