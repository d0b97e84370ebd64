"""What a session is told and what it gives back: the graph that it runs, and its snapshots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Protocol

from runtime.document import Node, difference
from runtime.engine import Carried, Engine, with_rows, without_rows
from runtime.errors import UsageError
from runtime.network import Network
from runtime.runs import PreparedRun
from runtime.sessions.log import Log


class ChangeableGraph(Protocol):
    """A graph as a session needs it: :class:`runtime.Graph`, whose changes are copies."""

    @property
    def network(self) -> Network: ...
    @property
    def document(self) -> Node: ...
    @property
    def texts(self) -> Mapping[str, bytes]: ...
    def prepared(self, *, growing: bool) -> PreparedRun: ...
    def check(self) -> Any: ...
    def set(self, path: str, value: Any, *, origin: str) -> Any: ...
    def overlay(self, source: Any) -> Any: ...
    def to_dict(self, *, modules: bool = False) -> dict[str, Any]: ...


# Which recording a session has: what it was from which tick on, since restoring and branching
# each begin another one.
Course = tuple[tuple[object, int], ...]


@dataclass(frozen=True)
class Became:
    """What an edited graph changed in a session.

    numbers : paths of parameters that changed in the running engine, such as ``blocks.gain.gain``;
        if that was all, every block kept its state.
    kept : the blocks that kept their state. begun : those that began anew. gone : those that are
        no more.
    """

    numbers: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    begun: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SessionSnapshot:
    """The state of a session at one time; it can be restored any number of times.

    ``carried`` is without rows if not ``has_rows``; ``course`` is that of the session.
    """

    t: float
    first: ChangeableGraph
    graph: ChangeableGraph
    engine: Engine
    carried: Carried
    log: Log
    course: Course
    has_rows: bool = True

    def small(self) -> SessionSnapshot:
        """The same without rows."""
        return replace(self, carried=without_rows(self.carried), has_rows=False)

    def complete(self, engine: Engine, course: Course) -> Carried:
        """The state with the rows that an engine has, as far as its course is that of this one."""
        if self.has_rows:
            return self.carried
        last, tick = self.course[-1][0], self.carried.tick
        ends = [end for (each, _), (_, end) in pairwise(course) if each is last]
        if course[-1][0] is last:
            ends = [engine.state.tick]
        is_ours = bool(ends) and tick <= ends[0]
        return with_rows(self.carried, self.engine.recorder.probes, engine if is_ours else None)


def change_between(now: ChangeableGraph, graph: ChangeableGraph) -> Node:
    """What makes one graph the other one, as a document that is merged over it.

    Raises
    ------
    UsageError : a session cannot go on as the other one.
    """
    if now.network.dt != graph.network.dt:
        raise UsageError("run.dt cannot change in a session: ticks count its time")
    try:
        return difference(now.document, graph.document)
    except ValueError as error:
        raise UsageError(f"the session cannot become that graph: {error}") from None
