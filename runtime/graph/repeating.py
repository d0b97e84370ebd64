"""A graph that runs many times, with other numbers and seeds: the trials of an experiment.

In: a graph, then values by path and a seed for each run. Out: results with the bits that a graph
with these values has, at the cost of its ticks if the last run's engine can begin again::

    runs = RepeatedRuns(graph)
    runs.run({"pid.kp": 2.0}, seed=1)     # checks the graph, plans it, starts its blocks
    runs.run({"pid.kp": 2.5}, seed=1)     # makes one block and starts it
    runs.run({"pid.kp": null}, seed=1)    # prepares the run anew, as what is no number does

Without this, compiled trials of short controllers take 2.5 to 4.7 times as long for another number,
and 1.1 to 2.1 times for another seed; those of the Python engine 1.0 to 1.1 times.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from blocks.core import Block
from runtime.document import Value
from runtime.engine import Engine, begin_again
from runtime.errors import UsageError
from runtime.files import remove_tree
from runtime.graph.graph import Graph
from runtime.graph.numbers import Numbers
from runtime.graph.replaying import last_checkpoint
from runtime.observation import Metric
from runtime.runs import (
    Checkpoints,
    Draft,
    PreparedRun,
    Result,
    chosen_runner,
    new_folder,
    simulate,
)


@dataclass
class _Prepared:
    """A run that was prepared, with its values by path, and the engine that has run it."""

    graph: Graph
    prepared: PreparedRun
    engine: Engine
    values: Mapping[str, Value]

    def __post_init__(self) -> None:
        self.blocks: Mapping[str, Block] = {}
        self.present = repr(self.values)

    @cached_property
    def numbers(self) -> Numbers:
        return Numbers.of(self.graph.document, self.graph.network, self.values)

    def begin_again(self, values: Mapping[str, Value], seed: int) -> bool:
        """Let the engine begin again with other values; False if that takes a new one."""
        if repr(values) != self.present:
            if values.keys() != self.values.keys():
                return False
            varied = {path: values[path] for path in self.numbers.values}
            if any(
                repr(values[path]) != repr(value)
                for path, value in self.values.items()
                if path not in varied
            ):
                return False
            blocks = self.numbers.changed(varied)
            if blocks is None:
                return False
            self.blocks, self.present = blocks, repr(values)
        return begin_again(self.engine, self.blocks, seed)


@dataclass
class RepeatedRuns:
    """Runs of one graph.

    Parameters
    ----------
    graph : before its values are set.
    plots : the kinds of plots whose probes are recorded beside those of the metrics; None for all.
    key : what its owner knows it by.

    ``metrics`` are those of the last run. The recordings of a result are valid until the next run.
    """

    graph: Graph
    plots: Container[str] | None = None
    key: object = None
    metrics: list[Metric] = field(init=False, default_factory=list)
    _checked: tuple[str, Graph] | None = field(init=False, default=None)
    _last: _Prepared | None = field(init=False, default=None)

    def run(
        self,
        values: Mapping[str, Value],
        seed: int,
        progress: Callable[[int, int], None] | None = None,
        whole: bool = True,
    ) -> Result:
        """Run the graph with other entries.

        Parameters
        ----------
        whole : whether the result shall have the document and the notes of a run with these
            entries, which takes a check of the graph, or its probes and metrics alone.

        Raises
        ------
        GraphError : it is wrong. SimulationError : it failed.
        """
        last, prepared = self._prepare(values, seed, whole)
        result = simulate(prepared, progress, engine=last.engine, whole=whole)
        if result.status in ("complete", "stopped"):
            self._last = last  # after anything else, a tick may be half done
        return result

    def _prepare(
        self, values: Mapping[str, Value], seed: int, whole: bool
    ) -> tuple[_Prepared, PreparedRun]:
        """What runs next, in the engine of the last run if it can begin again, and the run."""
        last, self._last = self._last, None
        is_again = last is not None and last.begin_again(values, seed)
        if last is None or whole or not is_again:
            graph = self._changed(values).with_seed(seed)
            prepared = graph.prepared(self.plots)
        else:
            prepared = replace(last.prepared, network=last.engine.network)
        if last is None or not is_again:
            engine = Engine(prepared.program, seed, chosen_runner(graph.network), repeats=True)
            last = _Prepared(graph, prepared, engine, values)
        self.metrics = prepared.program.observation.metrics
        return last, prepared

    def run_with_checkpoints(
        self,
        values: Mapping[str, Value],
        seed: int,
        checkpoints: tuple[Path, float],
        progress: Callable[[int, int], None] | None = None,
        whole: bool = True,
    ) -> Result:
        """As :meth:`run`, but recorded on disk, from the last checkpoint of an earlier attempt.

        In an engine of its own: what is worth a checkpoint takes long beside preparing it.

        Parameters
        ----------
        checkpoints : the folder of this run's attempts, which is removed when it has ended, and
            the time between two checkpoints (s of the clock).

        Raises
        ------
        UsageError : the recording cannot be written.
        """
        place, every = checkpoints
        try:
            source, wrong = last_checkpoint(place, self.graph.network), []
        except UsageError as error:
            source, wrong = None, [f"began anew, since {error}"]
        draft = Draft(new_folder(place.parent, place.name))
        folder = draft.recordings
        written = Checkpoints(folder, every, source, notes=wrong)
        try:
            prepared = self._changed(values).with_seed(seed).prepared(self.plots, growing=True)
            self.metrics = prepared.program.observation.metrics
            return simulate(prepared, progress, folder=folder, checkpoints=written, whole=whole)
        finally:
            # What is mapped of a file that is removed stays.
            draft.close()
            remove_tree(place)

    def _changed(self, values: Mapping[str, Value]) -> Graph:
        """The graph with other entries, checked once for all seeds."""
        if self._checked is None or self._checked[0] != repr(values):
            graph = self.graph
            for path, value in values.items():
                graph = graph.set(path, value, origin=path)
            _ = graph.network  # raises what is wrong
            self._checked = repr(values), graph
        return self._checked[1]
