"""The text that evaluates a graph at one point in time, for its linearization."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from blocks.core import Input, SignalType
from runtime.engine.engine import Engine
from runtime.engine.program import FILENAME
from runtime.engine.schedule import Emitter, Plan
from runtime.network import Endpoint

Port = tuple[str, str]
# Derivatives of all continuous states and the outputs, of offsets of the inputs.
Flow = Callable[[Sequence[float]], tuple[list[float], list[float]]]


@dataclass(frozen=True)
class Watched:
    """An output, or a continuous state, of a linearization."""

    end: Endpoint
    is_state: bool = False


class PointEmitter(Emitter):
    """Writes ``point(k, t, held)``, which returns a function of offsets of some signals.

    Parameters
    ----------
    offsets : the first offset of each signal that gets some: inputs and outputs of blocks.
    """

    def __init__(self, plan: Plan, offsets: Mapping[Port, int]) -> None:
        super().__init__(plan, [])
        self.offsets = offsets
        self.is_inside = False

    def point(self, watched: Sequence[Watched]) -> str:
        """The text: all outputs as of a tick, then those that the offsets or states change."""
        part = self.plan.continuous
        if part is None:
            raise ValueError("the graph has no continuous states")
        held = self.held()
        self.line(0, "def point(k, t, held):")
        if held:
            self.line(1, f"({', '.join(held)},) = held")
        self.depth = 1
        for step in self.plan.steps:
            if not step.constant:
                self.step(step)
        self.at(1)
        self.line(1, "def flow(offset):")
        self.depth, self.is_inside = 2, True
        if held:
            self.line(2, f"nonlocal {', '.join(held)}")
        self.code("stage = 0")
        for step in self.plan.steps:
            entry = self.network.entries[step.block]
            if not step.constant and (entry.cls.spec.continuous or entry.is_memoryless):
                self.step(step)
        for block, derivative in part.derivatives:
            self.slope(part, block, derivative, checked=False)
        self.code("seen = []")
        for each in watched:
            value = self.state_value(each.end) if each.is_state else self.value(each.end)
            self.code(f"seen += array({value}).ravel().tolist()")
        self.code("return slopes[0].tolist(), seen")
        self.line(1, "return flow")
        return "\n".join(self.text) + "\n"

    def argument(self, block: str, port: str, declared: Input) -> str:
        text = super().argument(block, port, declared)
        return self.moved(text, (block, port))

    def value(self, end: Endpoint, target: SignalType | None = None) -> str:
        text = super().value(end, target)
        return text if end.component else self.moved(text, (end.block, end.port))

    def moved(self, text: str, port: Port) -> str:
        """An expression plus its offsets."""
        if not self.is_inside or port not in self.offsets:
            return text
        first, kind = self.offsets[port], self.network.types[port]
        if kind.form == "scalar":
            return f"({text} + offset[{first}])"
        if kind.form == "record":
            parts = [f"({text})[{i}] + offset[{first + i}]" for i in range(len(kind.components))]
            return f"({', '.join(parts)},)"
        size = 1
        for length in kind.shape:
            size *= length
        return f"({text} + array(offset[{first}:{first + size}]).reshape({kind.shape!r}))"


def flow_at(
    engine: Engine, tick: int, offsets: Mapping[Port, int], watched: Sequence[Watched]
) -> Flow:
    """The function of a graph whose engine has run so many ticks."""
    text = PointEmitter(engine.plan, offsets).point(watched)
    exec(compile(text, FILENAME, "exec"), engine.namespace)
    held: Any = engine.state.held
    flow: Flow = engine.namespace["point"](tick, tick * engine.network.dt, held)
    return flow
