"""One run of a verb: simulated with progress, its folder written, the runs beside it as well.

In: a checked graph and the options of ``runtime run``. Out: an Outcome, which ``showing`` presents.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.cli.commands.changes import apply
from runtime.errors import SimulationError, UsageError
from runtime.terminal import tell

if TYPE_CHECKING:
    from blocks.core import FloatArray
    from runtime.engine import Interrupts, Profile
    from runtime.graph import Graph
    from runtime.runs import Draft, Pacing, Result


@dataclass
class Outcome:
    """What a run left: its result, its folder, the runs beside it, and how it ended.

    Parameters
    ----------
    failure : what ended the run early, if anything.
    code : the exit code so far; drawing may be interrupted.
    compared : the graphs of the runs beside it, by the change that makes them.
    others : their results; none after a failure.
    draws : whether there is time to draw, which a second Ctrl-C takes away.
    before : a run from before the graph was edited, which the figures show too.
    profile : rows of ``--profile``.
    """

    graph: Graph
    result: Result
    failure: SimulationError | None
    folder: Path
    code: int
    compared: Mapping[str, Graph]
    draws: bool
    before: Result | None = None
    others: dict[str, Result] = field(default_factory=dict)
    profile: list[dict[str, Any]] = field(default_factory=list)


def run_graph(
    options: Namespace,
    graph: Graph,
    before: Result | None = None,
    source: tuple[Path, Mapping[str, FloatArray]] | None = None,
) -> Outcome:
    """Simulate a graph and those that are compared with it, and write their folders.

    Parameters
    ----------
    before : a run from before the graph was edited.
    source : a checkpoint to go on from.

    Raises
    ------
    UsageError, GraphError : before anything runs, if the graph does not allow an option.
    """
    from runtime.engine import Interrupts, Profile
    from runtime.runs import Draft, link_latest, new_folder

    compared = rivals(graph, options.vs)
    _check_options(graph, options)
    pacing = pacing_of(options)
    profile = Profile() if options.profile else None
    quiet = options.quiet or options.json
    draft = Draft(new_folder(Path(options.out), graph.title))
    if not quiet:
        _report_leftovers(draft.folder.parent)
    with Interrupts() as interrupts:
        every = options.checkpoint or 0.0
        result, failure = simulate_graph(graph, quiet, profile, draft, every, source, pacing)
        folder = save_run(result, draft)
    in_place = folder == draft.folder
    if in_place:
        link_latest(folder)
    outcome = Outcome(
        graph=graph,
        result=result,
        failure=failure,
        folder=folder,
        code=_exit_code(result, failure, interrupts, in_place),
        compared=compared,
        draws=interrupts.leaves_time,
        before=before,
        profile=_profile_rows(profile, result.manifest) if profile else [],
    )
    if outcome.draws and failure is None and (options.vs or not options.no_plots):
        try:
            outcome.others = run_rivals(compared, graph, quiet, Path(options.out))
        except KeyboardInterrupt:
            outcome.code, outcome.draws = outcome.code or 130, False
    return outcome


def _exit_code(
    result: Result, failure: SimulationError | None, interrupts: Interrupts, in_place: bool
) -> int:
    """The exit code: of a failure, else of a signal, else of a folder that was not writable."""
    if failure is not None:
        return failure.exit_code
    if interrupts.caught is not None or result.status == "interrupted":
        return interrupts.exit_code
    if not in_place:
        return UsageError.exit_code
    return 1 if result.failures else 0


def _report_leftovers(folder: Path) -> None:
    """Report what killed runs of the same graph left behind."""
    from runtime.runs import leftovers

    found = leftovers(folder)
    if found:
        text = f"killed runs left {len(found)} hidden folder{'s' * (len(found) > 1)} in '{folder}'"
        tell(f"{text}, as '{found[0].path.name}'; 'runtime clean {folder}' lists them")


def _check_options(graph: Graph, options: Namespace) -> None:
    """Raise an error before the run if the graph does not allow an option."""
    if options.labels:
        names("", options.labels)
        if options.vs is None:
            raise UsageError(
                f"--labels {options.labels}: names the two runs of --vs, which is not given"
            )
    if options.animate:
        from runtime.plots import animated_plot

        animated_plot(graph.observation.plots, graph.network.world)
    if options.profile and graph.network.engine in ("compiled", "checked"):
        raise UsageError("--profile measures each block, which needs --engine python")


def _profile_rows(profile: Profile, manifest: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows of a profile; none of a run without a second tick."""
    later = manifest["ticks"] - 1
    return profile.rows(later, manifest["wall_s"] - manifest["ready_s"]) if later > 0 else []


def simulate_graph(
    graph: Graph,
    quiet: bool,
    profile: Profile | None,
    draft: Draft,
    every: float = 0.0,
    source: tuple[Path, Mapping[str, FloatArray]] | None = None,
    pacing: Pacing | None = None,
) -> tuple[Result, SimulationError | None]:
    """The result, and the error that ended the run early, if any.

    ``every`` is the time between two checkpoints (s), ``source`` one to go on from, ``pacing``
    that of a run in real time.
    """
    from runtime.engine import silent
    from runtime.runs import Result, simulate
    from runtime.terminal import Progress

    progress = Progress(graph.title, wanted=not quiet)
    note = silent if quiet else tell
    try:
        folder = draft.recordings
        growing = every > 0.0 or source is not None
        prepared = graph.prepared(profiled=profile is not None, growing=growing)
        checkpoints = None
        if growing:
            from runtime.runs import Checkpoints

            checkpoints = Checkpoints(folder, every, source)
        return simulate(prepared, progress, note, profile, folder, checkpoints, pacing), None
    except SimulationError as error:
        if not isinstance(error.result, Result):
            draft.close()
            raise
        return error.result, error
    except BaseException:
        draft.close()
        raise
    finally:
        progress.close()


def save_run(result: Result, draft: Draft) -> Path:
    """Write the run folder; if that fails, write it to another place with enough room."""
    from runtime.runs import save_elsewhere

    try:
        folder = draft.save(result)
    except UsageError as error:
        try:
            folder = save_elsewhere(result, draft.folder.name)
        except UsageError as other:
            text = f"{error}; {other}"
            if draft.recordings.is_dir():
                text += f"; the recording is left in '{draft.partial}': free some space, then "
                text += "'runtime clean --recover' makes a run from it"
            else:
                draft.close()
            raise UsageError(text) from None
        tell(f"{error}; the run is kept in '{folder}'")
    draft.close()
    return folder


def run_rivals(
    graphs: Mapping[str, Graph], graph: Graph, quiet: bool, out: Path
) -> dict[str, Result]:
    """The results of the graphs that are compared with ``graph``, by change; their folders are
    written, and what a change dropped is told."""
    for change, rival in () if quiet else graphs.items():
        for note in rival.notes[len(graph.notes) :]:
            tell(f"note: {change}: {note}")
    return {change: _rival(rival, quiet, out) for change, rival in graphs.items()}


def _rival(graph: Graph, quiet: bool, out: Path) -> Result:
    from runtime.runs import Draft, new_folder

    draft = Draft(new_folder(out, graph.title))
    result, failure = simulate_graph(graph, quiet, None, draft)
    save_run(result, draft)
    if failure is not None:
        tell(f"the run that is compared with failed: {failure}")
    return result


def pacing_of(options: Namespace) -> Pacing | None:
    """The pacing of a run in real time; None for one that is as fast as it can be.

    Raises
    ------
    UsageError : an option of real time is given without it.
    """
    if options.real_time:
        from runtime.runs import Pacing

        overrun = options.overrun or "catch-up"
        return Pacing(options.speed or 1.0, overrun, options.priority)
    for name in ("speed", "overrun", "priority"):
        if getattr(options, name):
            raise UsageError(f"--{name}: is for runs that wait for the clock; add --real-time")
    return None


def rivals(graph: Graph, vs: str | None) -> dict[str, Graph]:
    """The graphs to compare with, by the change that makes them: of ``--vs``, or of the plots.

    Raises
    ------
    GraphError, UsageError : one of them cannot run.
    """
    from runtime.observation import CHANGES

    if vs is None:
        wanted = [plot.options.get("compare", "") for plot in graph.observation.plots]
        return {change: _changed(graph, change) for change in wanted if change}
    kind, equals, _ = vs.partition("=")
    if kind not in CHANGES or not equals:
        known = ", ".join(CHANGES)
        raise UsageError(f"--vs {vs}: expected CHANGE=VALUE with one of {known}")
    return {vs: _changed(graph, vs)}


def _changed(graph: Graph, change: str) -> Graph:
    kind, _, text = change.partition("=")
    return apply(graph, kind, text).check()


def names(change: str, labels: str = "") -> tuple[str, str]:
    """Short names of two runs that differ in one change: 'with snn', 'without snn'.

    Parameters
    ----------
    labels : names in their place, separated by a comma.

    Raises
    ------
    UsageError : there are not two labels.
    """
    if labels:
        first, comma, second = (text.strip() for text in labels.partition(","))
        if not (first and comma and second) or "," in second:
            raise UsageError(f"--labels {labels}: expected two names for --vs, as in 'mine,theirs'")
        return first, second
    kind, _, text = change.partition("=")
    if kind == "with":
        return "as written", f"with {Path(text).stem}"
    return (f"with {text}" if kind == "without" else "as written"), f"{kind} {text}"
