"""One run of a verb: simulated with progress, its folder written, the runs beside it as well.

In: a checked graph and the options of ``runtime run``. Out: an Outcome, which ``showing`` presents.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.cli.commands.rivals import names, rivals, run_rivals
from runtime.cli.commands.simulating import pacing_of, save_run, simulate_graph
from runtime.errors import SimulationError, UsageError
from runtime.terminal import tell

if TYPE_CHECKING:
    from blocks.core import FloatArray
    from runtime.engine import Interrupts, Profile
    from runtime.graph import Graph
    from runtime.runs import Result


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
