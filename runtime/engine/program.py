"""The part of a run that does not depend on its seed: shared by runs with many seeds.

In go a checked network and what is observed; out come the plan, its names and its text as Python's
bytecode, each made when it is first asked for. ``program.source()`` is the function that
``runtime explain --code`` shows.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import InitVar, dataclass, field
from functools import cached_property
from types import CodeType

from blocks.core import Block, BlockContext
from blocks.library.registry import is_built_in
from runtime.engine.naming import Names, names_of
from runtime.engine.python_text import PythonText
from runtime.engine.recorder import buffer_rows, buffered, growing_rows
from runtime.engine.stack_text import StackedText
from runtime.network import Network
from runtime.observation import Observation
from runtime.plan import Integrate, Plan, Stacking, make_plan

FILENAME = "<the plan>"


@dataclass(frozen=True)
class Code:
    """Bytecode in pieces, and the block that each of its lines calls.

    integration : the piece that integrates, which compiled code can do instead; -1 for none.
    """

    pieces: tuple[CodeType, ...]
    lines: Mapping[int, str]
    integration: int = -1


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
    earlier : a program whose texts are used again if its plan is the same, as that of a graph with
        other numbers is.
    growing : for a run whose length is not known, as that of a session.

    Raises
    ------
    GraphError : naming every algebraic loop.
    """

    network: Network
    observation: Observation
    profiled: bool = False
    earlier: InitVar[Program | None] = None
    growing: bool = False
    plan: Plan = field(init=False)
    gathered: Mapping[str, int] = field(init=False)
    names: Names = field(init=False)
    _origin: Program | None = field(init=False)

    def __post_init__(self, earlier: Program | None) -> None:
        network, probes = self.network, self.observation.probes
        gathered = (
            growing_rows(probes)
            if self.growing
            else buffer_rows(probes, network.ticks, network.memory)
        )
        buffers = {name: buffered(probe, gathered) for name, probe in probes.items()}
        plan = make_plan(network, self.observation, buffers)
        if earlier is not None and not (
            earlier.profiled == self.profiled and _is_same(earlier.plan, plan)
        ):
            earlier = None
        object.__setattr__(self, "gathered", gathered)
        object.__setattr__(self, "plan", plan)
        object.__setattr__(self, "names", names_of(plan) if earlier is None else earlier.names)
        object.__setattr__(self, "_origin", None if earlier is None else earlier.origin)

    @property
    def origin(self) -> Program:
        """The first program with this plan, whose texts the others use."""
        return self if self._origin is None else self._origin

    @cached_property
    def contexts(self) -> Mapping[str, BlockContext]:
        """What each block knows about its place in the graph."""
        return {name: self.network.context(name) for name in self.network.entries}

    @cached_property
    def held(self) -> tuple[str, ...]:
        """The variables that outlive a tick."""
        return tuple(map(self.names.of, self.plan.held))

    @cached_property
    def stacking(self) -> Stacking:
        """The plan with equal calls of built-in blocks as one."""
        keys: dict[str, Hashable] = {}
        for name, entry in self.network.entries.items():
            if entry.cls.stack_key is not Block.stack_key and is_built_in(entry.cls):
                key = entry.block.stack_key(self.contexts[name])
                keys |= {} if key is None else {name: (entry.cls, key)}
        return Stacking(self.plan, keys)

    def printer(self, checked: bool = False) -> PythonText:
        """A printer of the plan as Python, for one text."""
        return PythonText(self.plan, self.names, checked, self.profiled)

    def source(self) -> str:
        """The text of the plan's function, as it is executed."""
        return self._stacked().function(self.stacking.steps, self.held, self.held)

    def _stacked(self) -> StackedText:
        return StackedText(self.plan, self.names, profiled=self.profiled)

    @cached_property
    def code(self) -> Code:
        """The function's bytecode."""
        # Which calls are stacked depends on numbers, too.
        if self._origin is not None and self._origin.stacking.steps == self.stacking.steps:
            return self._origin.code
        printer = self._stacked()
        text = printer.function(self.stacking.steps, self.held, self.held)
        return Code((compile(text, FILENAME, "exec"),), printer.lines)

    @cached_property
    def first(self) -> Code:
        """The first tick, with checks of every value's form, as statements in pieces."""
        if self._origin is not None:
            return self._origin.first
        printer = self.printer(checked=True)
        before = next(
            (i for i, each in enumerate(self.plan.operations) if isinstance(each, Integrate)), None
        )
        pieces = list(printer.pieces(self.plan.operations[:before]))
        number = -1 if before is None else len(pieces)
        pieces += [] if before is None else printer.pieces(self.plan.operations[before:])
        code = tuple(compile(each, FILENAME, "exec") for each in pieces)
        return Code(code, printer.lines, number)


def _is_same(one: Plan, other: Plan) -> bool:
    """Whether two plans have the same texts.

    Plans are equal whatever the coupling of their states and the edges of their sources are.
    """
    here, there = one.integration, other.integration
    if here is None or there is None:
        return one == other
    edges = len(here.edges) == len(there.edges)
    return one == other and edges and here.coupling is None and there.coupling is None
