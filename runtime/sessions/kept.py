"""What a session is told and what it gives back: the graph that it runs, and its snapshots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from runtime.engine import Carried, Engine
from runtime.network import Network
from runtime.runs import PreparedRun
from runtime.sessions.log import Log


class ChangeableGraph(Protocol):
    """A graph as a session needs it: :class:`runtime.Graph`, whose changes are copies."""

    @property
    def network(self) -> Network: ...
    @property
    def texts(self) -> Mapping[str, bytes]: ...
    def prepared(self, *, growing: bool) -> PreparedRun: ...
    def check(self) -> Any: ...
    def set(self, path: str, value: Any, *, origin: str) -> Any: ...
    def to_dict(self, *, modules: bool = False) -> dict[str, Any]: ...


@dataclass(frozen=True, eq=False)
class SessionSnapshot:
    """The state of a session at one time; it can be restored any number of times."""

    t: float
    first: ChangeableGraph
    graph: ChangeableGraph
    engine: Engine
    carried: Carried
    log: Log
