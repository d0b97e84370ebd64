"""Running a graph once: from the checked network to the result.

In: a :class:`PreparedRun` (program, network, files that were read). Out: a :class:`Result`, with
what was recorded, the metrics, and all that is needed to run it again with the same bits.
"""

from __future__ import annotations

import hashlib
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from blocks.core import FloatArray
from blocks.world import World
from runtime.diagrams import stored_picture
from runtime.document import Override, arrays_in, dump_yaml
from runtime.engine import Engine, MakeRunner, Outcome, Profile, Program, silent, take_compiled
from runtime.errors import raised_text
from runtime.network import Network
from runtime.observation import OF_RUN, Metric, Probe, Recording, Series, of_run
from runtime.plan import Plan, Stop
from runtime.runs.fingerprint import versions
from runtime.runs.folder import (
    DIAGRAM,
    RESOLVED,
    SCHEMA_VERSION,
    WRITTEN,
    begin,
    contents,
    portable,
)
from runtime.runs.result import Result
from runtime.terminal import readable_bytes

if TYPE_CHECKING:
    from runtime.runs.checkpoint import Checkpoints
    from runtime.runs.pacing import Pacing


@dataclass(frozen=True)
class PreparedRun:
    """A checked graph, ready to run.

    program : what is executed and recorded. network : checked, with the run's seed.
    document : returns the graph as plain values. source : the graph's file, if it has one.
    read : the content of all files that the graph was read from, by resolved path.
    overrides : the changes made to the graph. notes : messages for the user.
    """

    program: Program
    network: Network
    document: Callable[[], dict[str, Any]]
    source: Path | None
    read: Mapping[str, bytes]
    overrides: tuple[Override, ...]
    notes: tuple[str, ...]


def simulate(
    graph: PreparedRun,
    progress: Callable[[int, int], None] | None = None,
    note: Callable[[str], None] = silent,
    profile: Profile | None = None,
    folder: Path | None = None,
    checkpoints: Checkpoints | None = None,
    pacing: Pacing | None = None,
    engine: Engine | None = None,
    whole: bool = True,
) -> Result:
    """Run a graph; see :meth:`runtime.graph.Graph.run`.

    ``note`` is called with messages for the user, such as what is compiled. ``profile`` collects
    the time per block under the Python engine. ``folder`` holds recordings that are larger than
    the graph's ``run.memory``, and those of a run with ``checkpoints``; a temporary folder by
    default. ``pacing`` lets ticks wait for the clock. ``engine`` is one for this graph at tick 0.
    ``whole`` tells whether the result shall have all that a folder needs, or probes and metrics.
    """
    network, program = graph.network, graph.program
    began = datetime.now().astimezone()
    # What is kept of a run without end is in memory.
    folder = folder if network.keep is None else None
    if engine is None:
        runner = chosen_runner(network, note) if profile is None else None
        engine = Engine(program, network.seed, runner, note, profile, folder)
    if program.gathered:
        if not program.growing:
            note(f"recording to disk, since it takes more than {readable_bytes(network.memory)}")
        if folder is not None:
            # Only a recording on disk survives a killed process; what is in memory is lost with it.
            _begin_recording(graph, engine, began, folder)
    if checkpoints is not None:
        progress = checkpoints.begin(engine, progress)
    engine.diagnosis.is_wanted = whole
    outcome = engine.run(progress, None if pacing is None else partial(pacing.advance, engine))
    result = result_of(graph, engine, outcome, began, whole)
    if pacing is not None:
        pacing.end(result)
    if checkpoints is not None:
        checkpoints.end(outcome, result)
    if outcome.error is not None:
        # A failed run is still a result: what was recorded up to the failure is kept, and the error
        # carries it to whoever saves it.
        outcome.error.result = result
        raise outcome.error
    return result


def result_of(
    graph: PreparedRun, engine: Engine, outcome: Outcome, began: datetime, whole: bool = True
) -> Result:
    """What a run has shown so far, with its metrics; ``whole`` as for :func:`simulate`."""
    network, program, observation = graph.network, graph.program, graph.program.observation
    probes = {
        name: _recording(
            probe, rows, engine.recorder.times(name, len(rows), network.dt), network.time_unit
        )
        for name, probe in observation.probes.items()
        for rows in (outcome.arrays[name],)
    }
    probes |= {
        name: _events(name, blocks, program.plan, outcome.events, network.time_unit)
        for name, blocks in observation.events.items()
    }
    metrics, failures, unclear = evaluate(
        observation.metrics, probes, network.world, outcome.stopped_at
    )
    if not whole:
        result = Result(network.title, probes, metrics, [], _outcome_facts(outcome))
        result.failures = failures
        return result
    notes = [*graph.notes, *observation.notes, *unclear, *outcome.notes]
    if outcome.stopped_at is not None:
        missing = (each for each in observation.metrics if metrics[each.name] is None)
        ends = [each.beyond(outcome.stopped_at, network.time_unit) for each in missing]
        notes += [note for note in ends if note and note not in notes]
    notes += _notes_of_events(observation.events, program.plan)
    notes += engine.diagnosis.notes(outcome.ticks) if outcome.ticks else []
    if network.keep is not None and outcome.ticks * network.dt > network.keep:
        kept = f"{network.keep:g} {network.time_unit}"
        notes.append(f"run.keep: recordings, metrics and plots are of the last {kept}")
    if network.initial:
        notes.append(
            f"the states of {', '.join(sorted(network.initial))} are those of an earlier run; time "
            "and noise begin again, as 'runtime resume' does not"
        )
    result = _result(graph, outcome, probes, metrics, notes, began)
    result.failures = failures
    result.states = engine.final_states() if outcome.ticks else {}
    return result


def at_start(graph: PreparedRun) -> Result:
    """A run before its first tick: what is recorded once, and the plots that need no more."""
    engine = Engine(graph.program, graph.network.seed)
    engine.prepare()
    probes = {
        name: _recording(probe, engine.arrays[name], np.zeros(1), graph.network.time_unit)
        for name, probe in graph.program.observation.probes.items()
        if probe.constant
    }
    result = _result(graph, Outcome({}, 0), probes, {}, [], datetime.now().astimezone())
    # Tuning is computed before the first tick; all other plots would be empty.
    result.plots = [plot for plot in result.plots if plot.definition.of_tuning]
    return result


def chosen_runner(network: Network, note: Callable[[str], None] = silent) -> MakeRunner | None:
    """The runner class for a graph that is run once; None for the Python engine.

    Raises
    ------
    MissingCompilerError : the compiled engine is requested, and there is no C compiler.
    """
    if not take_compiled(network, 1, note):
        return None
    from runtime.engine.compiled import CheckedRunner, CompiledRunner

    return CheckedRunner if network.engine == "checked" else CompiledRunner


def _recording(probe: Probe, values: FloatArray, times: FloatArray, time_unit: str) -> Recording:
    addresses, start = {}, 0
    for signal in probe.signals:
        width = len(signal.labels)
        addresses[signal.address] = (start, start + width)
        start += width
    return Recording(
        name=probe.name,
        t=times,
        values=values,
        labels=probe.labels,
        units=probe.units,
        kinds=tuple(signal.kind for signal in probe.signals),
        addresses=addresses,
        auto=probe.auto,
        names=probe.names,
        held=probe.held,
        time_unit=time_unit,
    )


def _events(
    name: str, blocks: Sequence[str], plan: Plan, log: FloatArray | None, time_unit: str
) -> Recording:
    """The events of some blocks: of each its time, the block if there are several, and which."""
    crossings = () if plan.integration is None else plan.integration.crossings
    rows = np.empty((0, 2)) if log is None else log
    found = [np.empty((0, 3))]
    for crossing in crossings:
        if crossing.block in blocks and not isinstance(crossing.guards, Stop):
            own = rows[(rows[:, 1] >= crossing.start) & (rows[:, 1] < crossing.stop)]
            number = np.full(len(own), blocks.index(crossing.block))
            found.append(np.column_stack([own[:, 0], number, own[:, 1] - crossing.start]))
    table = np.concatenate(found)
    table = table[np.argsort(table[:, 0], kind="stable")]
    labels = ("block", "which") if len(blocks) > 1 else ("which",)
    values = table[:, 1:] if len(blocks) > 1 else table[:, 2]
    units, addresses = ("",) * len(labels), {label: (i, i + 1) for i, label in enumerate(labels)}
    return Recording(
        name=name,
        t=table[:, 0],
        values=values,
        labels=labels,
        units=units,
        kinds=("Events",) * len(blocks),
        addresses=addresses,
        time_unit=time_unit,
    )


def _notes_of_events(events: Mapping[str, Sequence[str]], plan: Plan) -> list[str]:
    """Notes of blocks whose events a probe cannot record: they act on ticks in this graph."""
    crossings = () if plan.integration is None else plan.integration.crossings
    located = {crossing.block for crossing in crossings}
    return [
        f"probe '{name}': no event of '{block}' is between two ticks here, and none is recorded: "
        "its input holds between ticks, no state is continuous, or run: {events: ticks} is set"
        for name, blocks in events.items()
        for block in blocks
        if block not in located
    ]


def _begin_recording(graph: PreparedRun, engine: Engine, began: datetime, folder: Path) -> None:
    """Write what is needed to recover a recording on disk if the process is killed."""
    observation = graph.program.observation
    outcome = Outcome({}, 0, "interrupted", "python" if engine.make_runner is None else "compiled")
    notes = [*graph.notes, *observation.notes]
    empty = {
        name: _recording(probe, engine.arrays[name][:0], np.empty(0), graph.network.time_unit)
        for name, probe in observation.probes.items()
    }
    metrics: dict[str, float | None] = dict.fromkeys(metric.name for metric in observation.metrics)
    begin(_result(graph, outcome, empty, metrics, notes, began), observation.probes, folder)


def _result(
    graph: PreparedRun,
    outcome: Outcome,
    probes: dict[str, Recording],
    metrics: dict[str, float | None],
    notes: list[str],
    began: datetime,
) -> Result:
    return Result(
        title=graph.network.title,
        probes=probes,
        metrics=metrics,
        plots=graph.program.observation.all_plots,
        manifest=_manifest(graph, outcome, notes, began),
        origin=partial(_origin, graph, outcome.engine),
        notes=notes,
        world=graph.network.world,
        units=graph.program.observation.metric_units,
        never=graph.program.observation.metric_never,
    )


def _origin(graph: PreparedRun, engine: str) -> tuple[dict[str, str], dict[str, bytes]]:
    """The graph as written and as run, and the files of its own blocks."""
    read = graph.read
    resolved, files = portable(_resolve_document(graph, engine), read)
    # The bytes that were read, and not the file: it may have been edited during the run.
    source = None if graph.source is None else read.get(str(graph.source.resolve()))
    text = dump_yaml(resolved) if source is None else source.decode("utf-8-sig")
    texts = {WRITTEN: text, RESOLVED: dump_yaml(resolved)}
    diagram = stored_picture(graph.network, graph.program.observation.probes.values())
    return (texts if diagram is None else {**texts, DIAGRAM: diagram}), contents(files, read)


def _resolve_document(graph: PreparedRun, engine: str) -> dict[str, Any]:
    """The document with all entries of its ``run`` section written out."""
    return {**graph.document(), "run": graph.network.run_entries() | {"engine": engine}}


def _manifest(
    graph: PreparedRun, outcome: Outcome, notes: list[str], began: datetime
) -> dict[str, Any]:
    network = graph.network
    read = {path: hashlib.sha256(data).hexdigest() for path, data in graph.read.items()}
    read |= {each.origin: each.digest for _, each in arrays_in(graph.document()) if each.origin}
    return {
        "schema_version": SCHEMA_VERSION,
        "graph": network.title,
        "source": str(graph.source) if graph.source else None,
        "read": read,
        **_outcome_facts(outcome),
        "seed": network.seed,
        "dt": network.dt,
        "until": network.until,
        "time_unit": network.time_unit,
        "wall_s": outcome.wall_s,
        "ready_s": outcome.ready_s,
        # The first tick runs in Python under either engine and is not counted.
        "us_per_tick": _us_per_tick(outcome),
        "started": began.isoformat(timespec="seconds"),
        "argv": sys.argv,
        "overrides": [str(override) for override in graph.overrides],
        "removed": dict(network.removed),
        "order": _order(graph.program),
        "notes": notes,
        "versions": {**versions(), **_compiler(outcome.engine)},
    }


def _outcome_facts(outcome: Outcome) -> dict[str, Any]:
    """How a run ended."""
    return {
        "status": outcome.status,
        "error": str(outcome.error) if outcome.error else None,
        "ticks": outcome.ticks,
        "stopped_at": outcome.stopped_at,
        "engine": outcome.engines,
        "engine_notes": outcome.notes,
    }


def _us_per_tick(outcome: Outcome) -> float | None:
    """Microseconds a tick after the first; None of a run that had no other."""
    later = outcome.ticks - 1
    return 1e6 * (outcome.wall_s - outcome.ready_s) / later if later > 0 else None


def _compiler(engine: str) -> dict[str, str]:
    """The C compiler of a run that was compiled."""
    if engine == "python":
        return {}
    from runtime.toolchain import find_compiler

    return {"C compiler": find_compiler().identity}


def _order(program: Program) -> list[str]:
    """The probes in the order in which a tick computes their signals."""
    # Comparisons list probes as signals flow, from sources to plants, and not by their names.
    ranks: dict[str, int] = {}
    for call in program.plan.evaluations:
        ranks.setdefault(call.block, len(ranks))

    def rank(probe: Probe) -> int:
        return min(ranks.get(signal.end.block, len(ranks)) for signal in probe.signals)

    probes = program.observation.probes
    return sorted(probes, key=lambda name: rank(probes[name]))


def _value_or_reason(
    metric: Metric, series: Mapping[str, Series], world: World | None
) -> tuple[float | None, str]:
    """A metric's value, and why it has none where its formula failed."""
    try:
        return metric.value(series, world), ""
    except BaseException as error:  # noqa: BLE001 -- a user's metric may raise anything
        return (
            None,
            f"metric '{metric.name}' has no value: its formula failed: {raised_text(error)}",
        )


def evaluate(
    metrics: list[Metric],
    probes: Mapping[str, Recording],
    world: World | None = None,
    stopped_at: float | None = None,
) -> tuple[dict[str, float | None], list[str], list[str]]:
    """All metrics' values, the expectations that failed, and notes.

    An infinite value, such as the distance that a beam measures where it hits nothing, is compared
    with the expectations and then becomes None with a note: JSON and means cannot hold it.
    """
    series = {name: Series(r.t, r.values) for name, r in probes.items()}
    values: dict[str, float | None] = {}
    failures, notes = [], []
    for metric in metrics:
        if metric.own is None and metric.kind in OF_RUN:
            value, reason = of_run(metric.kind, metric.options, stopped_at), ""
        else:
            value, reason = _value_or_reason(metric, series, world)
        notes += [reason] if reason else []
        failures += [text] if (text := metric.expectation(value)) else []
        if value is not None and not math.isfinite(value):
            notes.append(f"metric '{metric.name}' is infinite ({value:g}): it counts as no value")
            value = None
        values[metric.name] = value
    return values, failures, notes
