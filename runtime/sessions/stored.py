"""Saved sessions: the graph that a session began with, its log, and the run that came out.

    sessions/a/session.json     version, ticks, and each change with its tick
    sessions/a/graph.yaml       the graph before the first change, with the files that it names
    sessions/a/run/             the result, as a run folder

In: a session, or such a folder. Out: files, or a session that has come to the same tick by the same
changes, and so to the same bits.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blocks.core import show
from runtime.document import dump_yaml
from runtime.errors import UsageError
from runtime.files import (
    check_form,
    json_text,
    own_file,
    own_folder,
    read_text,
    system_errors,
    write_whole,
)
from runtime.graph import load
from runtime.runs import contents, portable
from runtime.sessions.session import CALLS, Session

if TYPE_CHECKING:
    from runtime.graph import Graph

SESSION, GRAPH, RUN, VERSION = "session.json", "graph.yaml", "run", 1
_CHANGE = {"tick": int, "call": str, "arguments": list}
_FORM = {"session": int, "ticks": int, "keep": (int, float, type(None)), "changes": [_CHANGE]}


def is_session(path: str | Path) -> bool:
    """Whether a path is the folder of a saved session."""
    return (Path(path) / SESSION).is_file()


def save(session: Session, folder: Path) -> Path:
    """Write a session into a folder that must not exist yet; returns the folder.

    Raises
    ------
    UsageError : the folder exists, or cannot be written.
    """
    changes = [
        {"tick": each.tick, "call": each.call, "arguments": list(each.arguments)}
        for each in session.log
    ]
    content = {"session": VERSION, "ticks": session.tick, "keep": session.keep, "changes": changes}
    result = session.result()
    if folder.exists():
        raise UsageError(f"'{folder}' exists already; choose another folder")
    with system_errors(f"write '{folder}'"):
        place = own_folder(folder)
        for name, data in _graph_files(session.first).items():
            write_whole(own_file(place / name), data)
        result.save(place / RUN)
        # Last: without it, the folder is no session.
        write_whole(own_file(place / SESSION), json_text(content))
    return place


def _graph_files(graph: Graph) -> dict[str, str | bytes]:
    plain: dict[str, Any] = graph.to_dict()
    renamed, files = portable(plain, graph.texts)
    return {GRAPH: dump_yaml(renamed), **contents(files, graph.texts)}


def open_session(folder: str | Path) -> Session:
    """Compute a saved session again: its graph, its changes at their ticks, up to its last tick.

    Raises
    ------
    UsageError : there is no session, or its files are damaged or of another version.
    """
    place = Path(folder)
    path = place / SESSION
    try:
        stored = json.loads(read_text(path))
    except ValueError as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    if not isinstance(stored, dict) or stored.get("session") != VERSION:
        raise UsageError(f"'{path}' is not a session of version {VERSION}, which this is")
    try:
        check_form(stored, _FORM)
    except ValueError as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    session = load(place / GRAPH).session(keep=stored["keep"])
    for each in stored["changes"]:
        if each["call"] not in CALLS:
            raise UsageError(f"'{path}': a session has no method {show(each['call'])}")
        session.step(each["tick"] - session.tick)
        getattr(session, each["call"])(*each["arguments"])
    return session.step(stored["ticks"] - session.tick)
