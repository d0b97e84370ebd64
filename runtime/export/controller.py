"""Exports blocks of a graph as a controller in C."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from blocks.files import read_text
from runtime.compiler import fixed_sizes
from runtime.engine import Engine
from runtime.engine.compiled import c_plan
from runtime.errors import UsageError
from runtime.export.files import Replay, header, source, test
from runtime.export.layout import Layout
from runtime.export.names import check_name
from runtime.export.recording import (
    FLOAT_TOLERANCE,
    TOLERANCE,
    Native,
    record,
    run_natively,
    usual_ticks,
)
from runtime.export.report import cortex_sizes, report
from runtime.export.selection import Selection, named_blocks, select
from runtime.export.templates import CMAKE
from runtime.export.units import Units, measure, write_units
from runtime.files import refuse_link, system_errors, write_files
from runtime.graph import Graph
from runtime.toolchain import available

SPARE = 2  # of the arena over what was used, where sizes have no bound
UNMEASURED = 2**24  # bytes of the arena where sizes have no bound, before they are measured
CMAKE_FILE = "CMakeLists.txt"


@dataclass(frozen=True)
class Exported:
    """What was written.

    Parameters
    ----------
    folder : of the files. files : their names. report : as in report.txt.
    inputs, outputs : of the controller. members : of each, the members of its struct in C with the
        count of their numbers, 0 of a single number. learns : whether learning can be switched off.
    note : what was not written, and why; empty if nothing.
    """

    folder: Path
    files: tuple[str, ...]
    report: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    members: tuple[tuple[tuple[str, int], ...], ...] = ((), ())
    learns: bool = False
    note: str = ""


def export(
    graph: Graph,
    folder: str | Path,
    *,
    blocks: Sequence[str] = (),
    others: Sequence[str] = (),
    name: str = "controller",
    float32: bool = False,
    ticks: int | None = None,
    hold: bool = False,
    tolerance: float | None = None,
) -> Exported:
    """Write blocks of a graph as C: source, header, test and report.

    Parameters
    ----------
    blocks : names of blocks or parts to export. others : instead, or of these, the ones left out.
    name : of the files, the struct and the functions.
    float32 : compute in float instead of double.
    ticks : length of the recorded run that the test replays.
    hold : inputs that are not finite keep their last value, instead of being a failure.
    tolerance : of the test of float32, a share of each output's range (0.001). A larger difference
        is a warning in the report, and the test fails.

    Raises
    ------
    UsageError : a tolerance without float32; a name is unknown, or there is nothing to export.
    GraphError : blocks cannot be exported; each is named with the reason.
    """
    check_name(name)
    if tolerance is not None and not float32:
        raise UsageError("--tolerance: this option is for --float32; double has to be equal")
    network = graph.network
    names = named_blocks(network, blocks, others)
    switches = sorted(name for name in names if network.holds(name))
    if switches:
        # A controller decides on its ticks; so does the run that its test replays.
        graph = graph.set("run.events", "ticks")
        network = graph.network
    selection = select(network, graph.program().plan, names)
    layout = layout_of(graph, selection, name, hold)
    length = usual_ticks(selection) if ticks is None else min(ticks, network.ticks)
    replay = record(graph, selection, length)
    about = _about(graph, selection, float32)
    if switches:
        about.append(f"Events on ticks, as with run: {{events: ticks}}: {', '.join(switches)}.")
    layout, native = _measure(layout, about, replay, float32)
    tolerance, reason = _tolerance(native, float32, tolerance)
    files = {
        f"{name}.h": header(layout, about, float32),
        f"{name}.c": source(layout, about, float32),
    }
    sizes = cortex_sizes(files)
    files[f"{name}_test.c"] = test(layout, replay, tolerance, reason, float32)
    files["report.txt"] = report(layout, about, native, sizes, tolerance, replay, float32)
    place, note = _write(files, folder, name)
    inputs, outputs = (tuple(map(".".join, p)) for p in (selection.inputs, selection.outputs))
    told = layout.members, bool(layout.learnt)
    return Exported(place, tuple(files), files["report.txt"], inputs, outputs, *told, note)


def _write(files: dict[str, str], folder: str | Path, name: str) -> tuple[Path, str]:
    """The folder that has the files now, and a build of them; a note if a build of one's own is
    there, which is left as it is.
    """
    with system_errors(f"write to '{folder}'"):
        place = Path(folder)
        refuse_link(place)
        build = place / CMAKE_FILE
        names = _built(build)
        if names is not None:
            files[CMAKE_FILE] = CMAKE.substitute(names=" ".join(sorted({*names, name})))
        write_files({place / file: content for file, content in files.items()}, folders=True)
    return place, "" if names is not None else f"not written: {build}, which is one of your own"


def _built(build: Path) -> list[str] | None:
    """The controllers that a build written here has; None of a build that somebody changed."""
    if not build.exists():
        return []
    text = read_text(build, errors="replace")
    listed = re.search(r"^set\(CONTROLLERS (.*)\)$", text, re.MULTILINE)
    names = listed[1].split() if listed else []
    return names if text == CMAKE.substitute(names=" ".join(names)) else None


def make_layout(graph: Graph, name: str, loose: bool = False) -> Layout:
    """The C text of a whole graph, with the values that it starts with.

    Parameters
    ----------
    name : of the struct and the functions. loose : as of Layout.

    Raises
    ------
    GraphError : blocks cannot be exported; each is named with the reason.
    """
    return layout_of(graph, _whole(graph), name, hold=False, loose=loose)


def make_units(graph: Graph, name: str) -> Units:
    """Of that, the blocks alone."""
    engine = Engine(graph.program(), graph.network.seed)
    engine.prepare()
    return write_units(_whole(graph), engine.state.blocks, name)


def _whole(graph: Graph) -> Selection:
    return select(graph.network, graph.program().plan, named_blocks(graph.network, (), ()))


def layout_of(
    graph: Graph, selection: Selection, name: str, hold: bool, loose: bool = False
) -> Layout:
    """The blocks' C text, with the values that they start with; the options are those of Layout."""
    program = graph.program()
    engine = Engine(program, graph.network.seed)
    engine.prepare()
    units = write_units(selection, engine.state.blocks, name)
    with fixed_sizes():
        plan = c_plan(selection.plan, program.names, units.kernels, selection.inputs)
    for solver in plan.solvers:
        symbols = [entry.symbol for entry in solver.entries]
        measure(units, "the solver", solver.write().functions, symbols)
    names = program.names
    constants = {p: np.asarray(engine.namespace[names.signals[p]]) for p in selection.constants}
    arrays = {k: v for k, v in engine.namespace.items() if isinstance(v, np.ndarray)}
    reset = {block: engine.namespace[copies] for block, copies in names.initial.items()}
    arena = max(units.reserved, UNMEASURED if units.open else 0)
    states = engine.state.blocks
    return Layout(
        name, selection, units, plan, arrays, states, reset, constants, arena, hold, loose
    )


def _measure(
    layout: Layout, about: Sequence[str], replay: Replay, float32: bool
) -> tuple[Layout, Native | None]:
    """The layout with the arena that it needs, and what a native run shows; None without one."""
    if not available():
        return layout, None

    def native(layout: Layout) -> Native:
        texts = header(layout, about, float32), source(layout, about, float32)
        return run_natively(layout, *texts, replay, float32)

    found = native(layout)
    if layout.units.open:
        arena = max(SPARE * found.arena, layout.units.reserved)
        layout = replace(layout, arena=arena)
        found = native(layout)
    _check(found, float32)
    return layout, found


def _check(native: Native, float32: bool) -> None:
    """Check that double gives what the graph gives.

    Raises
    ------
    UsageError : it does not, which is a fault of the export.
    """
    for port, apart in native.largest.items():
        if not float32 and not apart <= TOLERANCE:
            message = (
                f"the exported C gives another '{'.'.join(port)}' than the graph, by {apart:.3g}"
            )
            chaos = f"--ticks {native.equal}" if native.equal else "fewer --ticks"
            raise UsageError(
                f"{message}, from tick {native.equal} on: nothing was written. If the graph makes "
                f"more of the last bits (chaos), use {chaos}; otherwise, please report this"
            )


def _tolerance(native: Native | None, float32: bool, given: float | None) -> tuple[float, str]:
    """The tolerance of the test, and what was seen when it was written."""
    value = (FLOAT_TOLERANCE if given is None else given) if float32 else TOLERANCE
    if native is None:
        return value, "Not run when it was written, since there was no C compiler."
    seen = f"When it was written, the largest difference was {native.worst:.3g}"
    return value, f"{seen} of its range, by float instead of double." if float32 else f"{seen}."


def about(graph: Graph) -> str:
    """What wrote a file, from what."""
    from runtime.runs import versions

    made = versions().get("spikeblocks", "")
    return f"Written by spikeblocks {made} from a graph with seed {graph.network.seed}"


def _about(graph: Graph, selection: Selection, float32: bool) -> list[str]:
    """What the files say that they are."""
    lines = [
        f"{graph.network.title}: {', '.join(selection.blocks)}",
        f"{about(graph)}, in {'float' if float32 else 'double'}. Export it again instead of "
        "changing it.",
    ]
    begun = [
        f"{block}.{state}"
        for block in selection.blocks
        for state in graph.network.initial.get(block, ())
    ]
    if begun:
        lines.append(f"States that begin as an earlier run ended: {', '.join(begun)}.")
    return lines
