"""The folder of a session: the graph that it began with, its log, and its result.

In: what a session has. Out: a folder that must not exist yet::

    a/session.json     version and ticks
    a/log.jsonl        each change with its tick, or some writes, on a line
    a/graph.yaml       the graph before the first change, with the files that it names
    a/run/             the result, as a run folder
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

from runtime.document import dump_yaml
from runtime.errors import UsageError
from runtime.files import Content, refuse_link, remove_tree, system_errors, write_files
from runtime.runs import Result, contents, portable
from runtime.sessions.kept import ChangeableGraph
from runtime.sessions.log import Log

SESSION, CHANGES, GRAPH, RUN, VERSION = "session.json", "log.jsonl", "graph.yaml", "run", 3


def save_session(
    place: Path, first: ChangeableGraph, log: Log, ticks: int, result_of: Callable[[], Result]
) -> Path:
    """Write a session into a folder; see :meth:`runtime.sessions.Session.save`."""
    try:  # infinity included, which json reads again
        lines = "".join(f"{json.dumps(entry)}\n" for entry in log.entries())
    except TypeError as error:
        raise UsageError(f"a change has a value that no file can hold: {error}") from None
    content = {"session": VERSION, "ticks": ticks, "changes": len(log)}
    result = result_of()
    if place.exists():
        raise UsageError(f"'{place}' exists already; choose another folder")
    plain, named = portable(first.to_dict(modules=True), first.texts)
    with system_errors(f"write '{place}'"):
        beside = contents(named, first.texts)
        refuse_link(place)
        fresh = place.with_name(f".{place.name}-{os.urandom(3).hex()}.partial")
        try:
            written: dict[str, Content] = {
                GRAPH: dump_yaml(plain),
                CHANGES: lines,
                SESSION: json.dumps(content),
            }
            written |= beside
            write_files({fresh / name: data for name, data in written.items()}, True)
            result.save(fresh / RUN)
            fresh.rename(place)
        except BaseException:
            remove_tree(fresh)
            raise
    return place
