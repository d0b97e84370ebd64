"""The text that evaluates a graph at one point in time, for its linearization."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from blocks.core import SignalType
from runtime.engine.engine import Engine
from runtime.engine.program import FILENAME, Program
from runtime.engine.python_text import PythonText
from runtime.network import Endpoint
from runtime.plan import ALWAYS, Argument, Call, Integrate, Port, Signal, Solve, Source, Test, Zero

# Derivatives of all continuous states and the outputs, of offsets of the inputs.
Flow = Callable[[Sequence[float]], tuple[list[float], list[float]]]


@dataclass(frozen=True)
class Watched:
    """An output, or a continuous state, of a linearization."""

    end: Endpoint
    is_state: bool = False


class PointText(PythonText):
    """Writes ``point(k, t, held)``, which returns a function of offsets of some signals.

    Parameters
    ----------
    offsets : the first offset of each signal that gets some: inputs and outputs of blocks.
    """

    def __init__(self, program: Program, offsets: Mapping[Port, int]) -> None:
        super().__init__(program.plan, program.names)
        self.program = program
        self.offsets: Mapping[Port, int] = {}
        self.inside = offsets

    def point(self, part: Integrate, watched: Sequence[Source]) -> str:
        """The text: all outputs as of a tick, then those that the offsets or states change."""
        entries, held = self.program.network.entries, ", ".join(self.program.held)
        moving = {n for n, e in entries.items() if e.cls.spec.continuous or e.is_memoryless}
        outputs = [
            each
            for each in self.plan.operations
            if isinstance(each, (Call, Solve, Test, Zero)) and each.outputs
        ]
        derivatives = [
            each for each in part.stage if isinstance(each, (Call, Zero)) and not each.outputs
        ]
        self.line(0, "def point(k, t, held):")
        if held:
            self.line(1, f"({held},) = held")
        self.depth = 1
        self.operations(outputs)
        self.at(ALWAYS)
        self.line(1, "def flow(offset):")
        self.depth, self.offsets = 2, self.inside
        if held:
            self.line(2, f"nonlocal {held}")
        self.code("stage = 0")
        again = [each for each in outputs if each.block in moving or isinstance(each, Solve)]
        self.operations(again)
        self.operations(derivatives)
        self.code("seen = []")
        for source in watched:
            self.code(f"seen += array({self.source(source)}).ravel().tolist()")
        self.code("return slopes[0].tolist(), seen")
        self.line(1, "return flow")
        return "\n".join(self.text) + "\n"

    def argument(self, argument: Argument) -> str:
        text = super().argument(argument)
        return self.moved(text, (argument.block, argument.port), argument.kind)

    def source(self, source: Source, target: SignalType | None = None) -> str:
        text, whole = super().source(source, target), source.whole
        if source.component or not isinstance(whole, Signal):
            return text
        return self.moved(text, whole.key, whole.kind)

    def moved(self, text: str, port: Port, kind: SignalType) -> str:
        """An expression plus its offsets."""
        if port not in self.offsets:
            return text
        first = self.offsets[port]
        if kind.form == "scalar":
            return f"({text} + offset[{first}])"
        if kind.form == "record":
            parts = [f"({text})[{i}] + offset[{first + i}]" for i in range(len(kind.components))]
            return f"({', '.join(parts)},)"
        size = math.prod(kind.shape)
        return f"({text} + array(offset[{first}:{first + size}]).reshape({kind.shape!r}))"


def flow_at(
    engine: Engine, tick: int, offsets: Mapping[Port, int], watched: Sequence[Watched]
) -> Flow:
    """The function of a graph whose engine has run so many ticks.

    Raises
    ------
    ValueError : the graph has no continuous states.
    """
    plan = engine.plan
    if plan.integration is None:
        raise ValueError("the graph has no continuous states")
    sources = [_source(engine, each) for each in watched]
    text = PointText(engine.program, offsets).point(plan.integration, sources)
    exec(compile(text, FILENAME, "exec"), engine.namespace)
    held: Any = engine.state.held
    flow: Flow = engine.namespace["point"](tick, tick * engine.network.dt, held)
    return flow


def _source(engine: Engine, watched: Watched) -> Source:
    end = watched.end
    if not watched.is_state:
        kind = engine.network.types[end.block, end.port]
        return Source(Signal(end.block, end.port, kind), end.component)
    states = {state.name: state for state in engine.plan.states[end.block]}
    return Source(states[end.port], end.component)
