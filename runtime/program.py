"""All of a run that does not hang on its seed: made once, and shared by runs with many seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import CodeType
from typing import TYPE_CHECKING

from runtime.network import Network
from runtime.observe import Observation
from runtime.plan import Emitter, Plan, Recording, make_plan
from runtime.profile import ProfilingEmitter
from runtime.recorder import buffer_rows
from runtime.running import FILENAME

if TYPE_CHECKING:
    from runtime.compiled.template import Template


@dataclass
class Program:
    """A network's plan and its text, and what is recorded.

    Parameters
    ----------
    network : the checked graph.
    observation : what to record; ``gathered`` are the rows that are gathered in memory of those
        probes that go to disk.
    profiled : with a clock around each call of a block.

    Raises
    ------
    GraphError : naming every algebraic loop.
    """

    network: Network
    observation: Observation
    profiled: bool = False
    plan: Plan = field(init=False)
    gathered: dict[str, int] = field(init=False)
    emitter: Emitter = field(init=False)
    lines: dict[int, str] = field(init=False, default_factory=dict)
    template: Template | None = field(init=False, default=None)
    _codes: dict[tuple[bool, tuple[str, ...] | None], CodeType] = field(
        init=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        self.plan = make_plan(self.network)
        network, probes = self.network, self.observation.probes
        self.gathered = buffer_rows(probes, network.ticks, network.memory)
        emitter = ProfilingEmitter if self.profiled else Emitter
        self.emitter = emitter(self.plan, recordings(self.observation, self.gathered))

    def source(self) -> str:
        """The straight-line function, as it is executed."""
        return self.emitter.emit()

    def code(self, checked: bool, held: Sequence[str] | None = None) -> CodeType:
        """The function's text, compiled to Python's bytecode."""
        key = (checked, None if held is None else tuple(held))
        if key not in self._codes:
            self._codes[key] = compile(self.emitter.emit(checked, held), FILENAME, "exec")
            # The same for both: checks stand on the lines of the calls that they check.
            self.lines = self.emitter.lines
        return self._codes[key]


def recordings(observation: Observation, gathered: Mapping[str, int]) -> list[Recording]:
    """Which tick fills what of the arrays ``probe_0``, ``probe_1``, ... of the probes.

    ``gathered`` are the rows of those that are buffers.
    """
    made = []
    for i, probe in enumerate(observation.probes.values()):
        start = 0
        for signal in probe.signals:
            width = signal.shape[0] if signal.shape else 1
            columns = slice(start, start + width) if len(probe.signals) > 1 else None
            start += width
            made.append(
                Recording(
                    array=f"probe_{i}",
                    end=signal.end,
                    every=probe.every,
                    columns=columns,
                    is_state=signal.is_state,
                    is_event=signal.is_event,
                    constant=probe.constant,
                    rows=gathered.get(probe.name, 0),
                )
            )
    return made
