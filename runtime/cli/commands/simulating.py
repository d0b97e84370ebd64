"""One run of the command line: simulated with progress, and its folder written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from runtime.errors import SimulationError, UsageError
from runtime.terminal import tell

if TYPE_CHECKING:
    from collections.abc import Mapping

    from blocks.core import FloatArray
    from runtime.engine import Profile
    from runtime.graph import Graph
    from runtime.runs import Draft, Result


def simulated(
    graph: Graph,
    quiet: bool,
    profile: Profile | None,
    draft: Draft,
    every: float = 0.0,
    source: tuple[Path, Mapping[str, FloatArray]] | None = None,
) -> tuple[Result, SimulationError | None]:
    """The result, and the error that ended the run early, if any.

    ``every`` is the time between two checkpoints (s), ``source`` one to go on from.
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
        return simulate(prepared, progress, note, profile, folder, checkpoints), None
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


def saved(result: Result, draft: Draft) -> Path:
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
