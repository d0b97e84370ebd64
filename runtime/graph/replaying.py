"""Runs that go on, and sessions that are computed again, from what was saved of them.

In: the folder of a run with a checkpoint. Out: its graph, and the checkpoint with its rows. In: the
folder of a session. Out: a session that has come to the tick at which it was saved.

What goes on records into a folder of its own, and never into the one that it goes on from, so that
a kill at any moment leaves a checkpoint with its rows::

    run killed            .a-3f9a01.partial/recording
    resume                a, recovered           .b-77d0e2.partial/recording
      killed before its first checkpoint: goes on from a; later: b, recovered, and so on
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from blocks.core import hint
from blocks.files import lines
from blocks.limits import INDEX
from runtime.errors import UsageError
from runtime.files import check_form, parse_json, read_json, remove_tree, system_errors
from runtime.graph.graph import Graph
from runtime.graph.loading import load
from runtime.network import Network
from runtime.runs import (
    BEFORE,
    CHECKPOINT,
    MANIFEST,
    RECORDING,
    RESOLVED,
    Source,
    check_same_program,
    leftovers,
    program_of,
    read_checkpoint,
    read_run,
    recover,
    remove,
    run_folder,
)
from runtime.sessions import CALLS, CHANGES, GRAPH, SESSION, VERSION, Session, changes_of

_FORM = {"session": int, "ticks": int, "changes": int}


def is_session(path: str | Path) -> bool:
    """Whether a path is the folder of a saved session."""
    return (Path(path) / SESSION).is_file()


def open_session(folder: str | Path, modules: bool = True) -> Session:
    """Compute a saved session again: its graph, its changes at their ticks, up to its last tick.

    Raises
    ------
    UsageError : there is no session, or its files are damaged or of another version.
    """
    place = Path(folder)
    path = place / SESSION
    try:
        stored = read_json(path)
    except (OSError, ValueError) as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    if not isinstance(stored, dict) or stored.get("session") != VERSION:
        raise UsageError(f"'{path}' is not a session of version {VERSION}, which this is")
    try:
        check_form(stored, _FORM)
    except ValueError as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    session, path = load(place / GRAPH, modules=modules).session(), place / CHANGES
    with system_errors(f"read '{path}'"):
        try:
            _repeat(session, path)
        except ValueError as error:
            raise UsageError(f"'{path}' is damaged: {error}") from None
    if len(session.log) != stored["changes"]:
        raise UsageError(f"'{path}' has not the {stored['changes']} changes that were saved")
    return session.step(stored["ticks"] - session.tick)


def _repeat(session: Session, path: Path) -> None:
    """Make the changes of a log again; ValueError if they cannot be read."""
    for number, line in enumerate(lines(path, INDEX), 1):
        try:
            for tick, call, arguments in changes_of(parse_json(line)):
                if call not in CALLS:
                    raise ValueError(f"a session has no method '{call}'{hint(call, CALLS)}")
                session.step(tick - session.tick)
                getattr(session, call)(*arguments)
        except (TypeError, ValueError) as error:
            raise UsageError(f"'{path}', line {number}: {error}") from None


@dataclass(frozen=True)
class Resumable:
    """A run that can go on: its folder, its graph, a checkpoint, and the rows before it."""

    folder: Path
    graph: Graph
    source: Source


def resumable(
    path: str | Path, until: float | None = None, mixed: bool = False, modules: bool = True
) -> Resumable:
    """A run that can go on from its last checkpoint that can be read.

    Parameters
    ----------
    path : of a run folder, or of the folder of a graph's runs: the newest one there, one that was
        killed included.
    until : a longer end of the run, in its unit of time.
    mixed : whether it may go on although another version of the program began it.
    modules : whether what the graph names is executed.

    Raises
    ------
    UsageError : there is no run, no checkpoint that can be used, or nothing is left to run; or
        another program began it.
    """
    folder = _newest(Path(path)) or run_folder(path)
    run = read_run(folder)
    graph = load(folder / RESOLVED, modules=modules)
    if until is not None:
        graph = graph.set("run.until", until)
    source, header = _last(folder)
    if run.status == "stopped":
        raise UsageError(f"run.stop ended '{folder}' at t = {run.manifest['stopped_at']:g}")
    if run.status == "complete" and run.ticks >= graph.network.ticks:
        end, unit = graph.network.until, graph.network.time_unit
        raise UsageError(f"'{folder}' is complete up to {end:g} {unit}; --until is how it goes on")
    # A run that was killed while it was written has nothing left to run, but no metrics yet.
    if header["tick"] > graph.network.ticks:
        end = header["tick"] * graph.network.dt
        raise UsageError(f"'{folder}' has come to {end:g} already; --until is how it goes on")
    way_out = "'runtime replay' computes all of it again; --mixed goes on all the same"
    _check_program(header, graph.network, f"'{folder}'", way_out, mixed)
    return Resumable(folder, graph, source)


def last_checkpoint(place: Path, network: Network) -> Source | None:
    """What a run goes on from whose attempts, all killed, are alone in a folder; None if nothing.

    What is older is removed.

    Raises
    ------
    UsageError : the checkpoints are damaged, or of another program.
    """
    folder = _newest(place)
    for each in leftovers(place) if place.is_dir() else ():
        remove(each)
    for older in place.glob(f"*/{MANIFEST}"):
        if older.parent != folder:
            remove_tree(older.parent)
    if folder is None or not _checkpoints(folder):
        return None
    source, header = _last(folder)
    _check_program(header, network, "what was there", "its trial begins again")
    return source


def _check_program(
    header: Mapping[str, Any], network: Network, what: str, way_out: str, mixed: bool = False
) -> None:
    """Check that the header of a checkpoint was written by the program that computes a graph."""
    check_same_program([header.get("program", "")], program_of(network), what, way_out, mixed)


def _checkpoints(folder: Path) -> list[Path]:
    """The checkpoints in a folder, the last one first."""
    return [folder / name for name in (CHECKPOINT, BEFORE) if (folder / name).is_file()]


def _last(folder: Path) -> tuple[Source, dict[str, Any]]:
    """The last checkpoint of a run that can be read, with its rows, and its header."""
    checkpoints = _checkpoints(folder)
    if not checkpoints:
        raise UsageError(
            f"'{folder}' has no checkpoint; a run with --checkpoint 60s writes one a minute. "
            "'--from' begins a new run with the states that one ended with"
        )
    rows = {name: recording.values for name, recording in read_run(folder).probes.items()}
    wrong: list[str] = []
    for checkpoint in checkpoints:
        try:
            return (checkpoint, rows), read_checkpoint(checkpoint, rows)[1]
        except UsageError as error:
            wrong.append(str(error))
    raise UsageError("; ".join(wrong))


def _newest(path: Path) -> Path | None:
    """The folder of the newest run in a folder of runs; one that was killed is recovered first."""
    if path.is_dir() and not (path / MANIFEST).is_file():
        # 'latest' is a link to one of them.
        runs = [m for m in path.glob(f"*/{MANIFEST}") if not m.parent.is_symlink()]
        complete = {_age(m.parent.name, m.stat().st_mtime): m.parent for m in runs}
        killed = {
            _age(each.name, each.changed_at): each
            for each in leftovers(path)
            if each.has_recording and not (path / each.name).exists()
        }
        # One that was killed before its first checkpoint has nothing that an older one has not.
        begun = {age for age, each in killed.items() if _checkpoints(each.path / RECORDING)}
        newest = max(begun | complete.keys(), default=max(killed, default=None))
        if newest in complete:
            return complete[newest]
        if newest is not None:
            folder = recover(killed[newest])
            remove(killed[newest])
            return folder
    return None


def _age(name: str, changed_at: float) -> tuple[str, float, str]:
    """By what runs are sorted: names begin with date and time, but two may share a second."""
    return name[: len("20260131-235959")], changed_at, name
