"""Saved sessions, computed again: the same changes at the same ticks, and so the same bits.

In: the folder of a session. Out: a session that has come to the tick at which it was saved.
"""

from __future__ import annotations

import json
from pathlib import Path

from blocks.core import show
from runtime.errors import UsageError
from runtime.files import check_form, read_text
from runtime.graph.loading import load
from runtime.sessions import CALLS, GRAPH, SESSION, VERSION, Session

_CHANGE = {"tick": int, "call": str, "arguments": list}
_FORM = {"session": int, "ticks": int, "keep": (int, float, type(None)), "changes": [_CHANGE]}


def is_session(path: str | Path) -> bool:
    """Whether a path is the folder of a saved session."""
    return (Path(path) / SESSION).is_file()


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
