"""The part of a run that does not depend on its seed: shared by runs with many seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import CodeType, MappingProxyType

from blocks.core import BlockContext
from runtime.engine.profile import ProfilingEmitter
from runtime.engine.recorder import buffer_rows, buffered
from runtime.engine.schedule import Emitter, Plan, RecordSlot, make_plan
from runtime.network import Network, state_shape
from runtime.observation import Observation

FILENAME = "<the plan>"


@dataclass(frozen=True)
class Code:
    """The function's bytecode, and the block that each of its lines calls."""

    code: CodeType
    lines: Mapping[int, str]


@dataclass(frozen=True, eq=False)
class Program:
    """A network's plan and its text, and what is recorded; immutable and shared by threads.

    Texts are cached: each depends only on the program.

    Parameters
    ----------
    network : the checked graph.
    observation : what to record; ``gathered`` has the rows of the buffers of the probes that go
        to disk.
    profiled : with a clock around each call of a block.

    Raises
    ------
    GraphError : naming every algebraic loop.
    """

    network: Network
    observation: Observation
    profiled: bool = False
    plan: Plan = field(init=False)
    gathered: Mapping[str, int] = field(init=False)
    recordings: tuple[RecordSlot, ...] = field(init=False)
    _codes: dict[tuple[bool, tuple[str, ...] | None], Code] = field(
        init=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        network, probes = self.network, self.observation.probes
        gathered = buffer_rows(probes, network.ticks, network.memory)
        object.__setattr__(self, "plan", make_plan(network))
        object.__setattr__(self, "gathered", gathered)
        object.__setattr__(self, "recordings", tuple(recordings(self.observation, gathered)))

    @cached_property
    def contexts(self) -> Mapping[str, BlockContext]:
        """What each block knows about its place in the graph."""
        return {name: self.network.context(name) for name in self.network.entries}

    @cached_property
    def shapes(self) -> Mapping[str, Mapping[str, tuple[int, ...]]]:
        """The shapes of each block's states."""
        found = {}
        for name, entry in self.network.entries.items():
            context, spec = self.contexts[name], entry.cls.spec
            found[name] = {
                key: state_shape(entry.block, declared, context, spec)
                for key, declared in spec.states.items()
            }
        return found

    def emitter(self) -> Emitter:
        """A writer of the plan's function, for one text."""
        kind = ProfilingEmitter if self.profiled else Emitter
        return kind(self.plan, list(self.recordings), self.observation.stop)

    def source(self) -> str:
        """The text of the plan's function, as it is executed."""
        return self.emitter().emit()

    def code(self, checked: bool, held: Sequence[str] | None = None) -> Code:
        """The function's text, compiled to Python's bytecode.

        Two threads may compile the same text; the results are equal.
        """
        key = (checked, None if held is None else tuple(held))
        made = self._codes.get(key)
        if made is None:
            emitter = self.emitter()
            code = compile(emitter.emit(checked, held), FILENAME, "exec")
            made = self._codes[key] = Code(code, MappingProxyType(emitter.lines))
        return made


def recordings(observation: Observation, gathered: Mapping[str, int]) -> list[RecordSlot]:
    """The record slots of the probes' arrays ``probe_0``, ``probe_1``, ...

    ``gathered`` has the rows of those that are buffers.
    """
    made = []
    for i, probe in enumerate(observation.probes.values()):
        start = 0
        for signal in probe.signals:
            width = signal.shape[0] if signal.shape else 1
            columns = slice(start, start + width) if len(probe.signals) > 1 else None
            start += width
            made.append(
                RecordSlot(
                    array=f"probe_{i}",
                    end=signal.end,
                    every=probe.input_every,
                    columns=columns,
                    is_state=signal.is_state,
                    is_event=signal.is_event,
                    constant=probe.constant,
                    rows=buffered(probe, gathered),
                    publisher=signal.publisher,
                )
            )
    return made
