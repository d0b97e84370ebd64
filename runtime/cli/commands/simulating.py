"""One run of the command line: its options, simulated with progress, and its folder written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from runtime.arguments import Once, at_least, rare
from runtime.errors import SimulationError, UsageError
from runtime.terminal import tell

if TYPE_CHECKING:
    from argparse import ArgumentParser, Namespace
    from collections.abc import Mapping

    from blocks.core import FloatArray
    from runtime.engine import Profile
    from runtime.graph import Graph
    from runtime.runs import Draft, Pacing, Result


def add_real_time(parser: ArgumentParser) -> None:
    """Declare the options of a run in real time."""
    group = rare(parser)
    group.add_argument(
        "--real-time",
        action="store_true",
        help="let every tick wait for the clock, and report how late ticks were",
    )
    group.add_argument(
        "--speed",
        action=Once,
        type=at_least(0.0, above=True),
        metavar="FACTOR",
        help="with --real-time: seconds of the graph in one of the clock (1)",
    )
    group.add_argument(
        "--overrun",
        choices=("catch-up", "skip"),
        help="with --real-time, where ticks end after the next are due: run without waiting "
        "until the clock is reached (catch-up, the default), or leave out the due times that "
        "have passed, and stay behind (skip)",
    )
    group.add_argument(
        "--priority",
        action="store_true",
        help="with --real-time: run under SCHED_FIFO, if the system has and allows it",
    )


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
