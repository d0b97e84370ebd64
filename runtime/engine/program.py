"""The part of a run that does not depend on its seed: shared by runs with many seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import CodeType, MappingProxyType

from blocks.core import BlockContext
from runtime.engine.naming import Names, names_of
from runtime.engine.python_text import PythonText
from runtime.engine.recorder import buffer_rows, buffered
from runtime.network import Network
from runtime.observation import Observation
from runtime.plan import Plan, make_plan

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
    names: Names = field(init=False)
    _codes: dict[tuple[bool, tuple[str, ...] | None], Code] = field(
        init=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        network, probes = self.network, self.observation.probes
        gathered = buffer_rows(probes, network.ticks, network.memory)
        buffers = {name: buffered(probe, gathered) for name, probe in probes.items()}
        plan = make_plan(network, self.observation, buffers)
        object.__setattr__(self, "gathered", gathered)
        object.__setattr__(self, "plan", plan)
        object.__setattr__(self, "names", names_of(plan))

    @cached_property
    def contexts(self) -> Mapping[str, BlockContext]:
        """What each block knows about its place in the graph."""
        return {name: self.network.context(name) for name in self.network.entries}

    @cached_property
    def held(self) -> tuple[str, ...]:
        """The variables that outlive a tick."""
        return tuple(map(self.names.of, self.plan.held))

    def printer(self, checked: bool = False) -> PythonText:
        """A printer of the plan as Python, for one text."""
        return PythonText(self.plan, self.names, checked, self.profiled)

    def source(self) -> str:
        """The text of the plan's function, as it is executed."""
        return self.printer().function(self.plan.operations, self.held, self.held)

    def code(self, checked: bool, held: Sequence[str] | None = None) -> Code:
        """The function's text, compiled to Python's bytecode.

        ``held`` are the variables that it returns, by default those that it takes.

        Two threads may compile the same text; the results are equal.
        """
        key = (checked, None if held is None else tuple(held))
        made = self._codes.get(key)
        if made is None:
            printer, outgoing = self.printer(checked), self.held if held is None else held
            text = printer.function(self.plan.operations, self.held, outgoing)
            code = compile(text, FILENAME, "exec")
            made = self._codes[key] = Code(code, MappingProxyType(printer.lines))
        return made
