"""What is done with a graph that can run: simulate it, step it, linearize it.

In: a graph. Out: what comes of it; the rooms that do it are imported when they are first used.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from runtime.document import Node, Override, Value
    from runtime.engine import Program
    from runtime.network import Network
    from runtime.runs import Linearization, PreparedRun, Result, Trim
    from runtime.sessions import Session


class Runnable:
    """The part of :class:`runtime.Graph` that runs it."""

    if TYPE_CHECKING:

        @property
        def network(self) -> Network: ...
        @property
        def document(self) -> Node: ...
        @property
        def source(self) -> Path | None: ...
        @property
        def overrides(self) -> tuple[Override, ...]: ...
        @property
        def notes(self) -> tuple[str, ...]: ...
        @property
        def texts(self) -> Mapping[str, bytes]: ...
        def program(
            self,
            plots: Container[str] | None = None,
            profiled: bool = False,
            growing: bool = False,
        ) -> Program: ...
        def check(self) -> Self: ...
        def set(self, path: str, value: Value, *, origin: str = "") -> Self: ...
        def overlay(self, source: Any, unsaved: Mapping[Path, str] | None = None) -> Self: ...
        def with_seed(self, seed: int) -> Self: ...
        def to_dict(self, *, modules: bool = False) -> dict[str, Value]: ...
        def _set(self, path: str, value: Value, origin: str = "") -> Self: ...

    def run(
        self,
        *,
        seed: int | None = None,
        until: float | None = None,
        engine: str | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> Result:
        """Simulate; see :class:`runtime.runs.result.Result`.

        ``engine`` is "python", "compiled" or "auto", which compiles where it pays off.

        Raises
        ------
        GraphError : the graph cannot run.
        SimulationError : it failed; ``error.result`` holds what was recorded before.
        """
        from runtime.runs import simulate

        graph = self if seed is None else self.with_seed(seed)
        if until is not None:
            graph = graph._set("run.until", until)
        if engine is not None:
            graph = graph._set("run.engine", engine)
        return simulate(graph.prepared(), progress)

    def session(
        self, *, seed: int | None = None, engine: str | None = None, keep: float | None = None
    ) -> Session:
        """A run that is stepped, read, written to and changed; see :class:`runtime.Session`.

        ``engine`` is "python", "compiled" or "auto"; ``keep`` is ``run.keep``: how much of the
        recordings stays in memory, the last part; all by default.
        """
        from runtime.sessions import Session

        graph = self if seed is None else self.with_seed(seed)
        if engine is not None:
            graph = graph._set("run.engine", engine)
        return Session(graph if keep is None else graph._set("run.keep", keep))

    def linearize(
        self, inputs: Sequence[str] = (), outputs: Sequence[str] = (), **how: Any
    ) -> Linearization:
        """The graph as a linear system at an operating point; ``how`` as for
        :func:`runtime.runs.linearization.linearize`: ``at``, ``states``, ``opened``.
        """
        from runtime.runs import linearize

        return linearize(self.network, inputs, outputs, **how)

    def trim(self, inputs: Sequence[str] = (), outputs: Sequence[str] = (), **how: Any) -> Trim:
        """An equilibrium; ``how`` as for :func:`runtime.runs.equilibrium.trim`."""
        from runtime.runs import trim

        return trim(self.network, inputs, outputs, **how)

    def prepared(
        self,
        plots: Container[str] | None = None,
        profiled: bool = False,
        growing: bool = False,
    ) -> PreparedRun:
        """What a run needs of the graph; the parameters are those of :meth:`program`."""
        from runtime.runs import PreparedRun

        return PreparedRun(
            self.program(plots, profiled, growing),
            self.network,
            self.to_dict,
            self.source,
            self.texts,
            self.overrides,
            self.notes,
        )
