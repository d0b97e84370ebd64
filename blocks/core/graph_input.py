"""What stands for an input of a graph that nothing is wired to: a signal that holds what was set.

In: an entry of a section ``inputs``. Out: a block that plans, engines, diagrams and linearizations
treat as any other::

    inputs: {push: {type: Scalar, unit: N, min: -10, max: 10, default: 0}}
    ->  GraphInput(type=Scalar, unit="N", min=-10, max=10, default=0), named "inputs.push"

Whoever drives the graph writes the array ``value`` of its state between two ticks.
"""

from __future__ import annotations

from collections.abc import Container
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core.block import Block
from blocks.core.block_state import BlockContext, BlockState
from blocks.core.declarations import Output, State
from blocks.core.elementwise import check_sized
from blocks.core.params import ParameterError, param
from blocks.core.signals import FloatArray, Same, SignalType

SHAPES = [(), (None,), (None, None)]  # of a value: a number, a list, a table


class GraphInput(Block):
    """An input of a graph: the default, until another value is written to its state.

    [ GraphInput ] ─▶ out
    """

    out = Output(Same("T"), doc="the value")

    signal: SignalType | None = param(
        None, name="type", doc="the signal type; default: that of what it is wired to"
    )
    default: FloatArray | None = param(
        None,
        shape=SHAPES,
        finite=False,
        doc="its value if nothing is wired to it: one number, or all of them",
    )
    low: FloatArray | None = param(
        None, name="min", shape=SHAPES, finite=False, doc="its smallest value"
    )
    high: FloatArray | None = param(
        None, name="max", shape=SHAPES, finite=False, doc="its largest value"
    )
    unit: str = param("", doc="its unit")
    doc: str = param("", doc="one line of documentation")
    optional: bool = param(False, doc="whether it may stay open, without a default")

    number = State(name="value", like="out", doc="what is written to it")

    def validate(self) -> None:
        problems = []
        for name, bound, is_out in (("min", self.low, np.less), ("max", self.high, np.greater)):
            try:
                if bound is None or self.default is None or not is_out(self.default, bound).any():
                    continue
            except ValueError:  # other lengths, which are compared with the type's in validate_in
                continue
            relation = "at least" if name == "min" else "at most"
            message = f"expected {relation} the {name}, {bound.tolist()}, got "
            problems.append(("default", f"{message}{self.default.tolist()}"))
        if self.signal is not None and self.signal.form == "record" and self.unit:
            message = f"the components of a {self.signal.name} have units of their own"
            problems.append(("unit", message))
        low, high = self.low, self.high
        if low is not None and high is not None and low.shape == high.shape and (low > high).any():
            message = f"expected at most the max, {high.tolist()}, got {low.tolist()}"
            problems.append(("min", message))
        if problems:
            raise ParameterError(problems)

    def validate_in(self, context: BlockContext) -> None:
        for name, bound in (("default", self.default), ("min", self.low), ("max", self.high)):
            check_sized(context.types["out"], name, bound)
        if self.default is not None and (message := context.types["out"].wrong(self.default)):
            raise ParameterError([("default", message)])

    @cached_property
    def kind(self) -> SignalType | None:
        """The signal type, if it is known; an open length is that of the default."""
        kind = self.signal
        if kind is not None and kind.symbol:
            return (
                None
                if self.default is None or not self.default.ndim
                else kind.sized(len(self.default))
            )
        return kind

    @property
    def variables(self) -> dict[str, SignalType]:
        return {} if self.kind is None else {"T": self.kind}

    def why_open(self, published: Container[str]) -> str:
        return "its signal type is open: write it, as in {type: Vector(3), default: 0.0}"

    def port_unit(self, name: str) -> str:
        return self.unit

    def start(self, state: BlockState) -> None:
        state.value = 0.0 if self.default is None else self.default
        state.pack = state.context.types["out"].pack

    def output(self, state: BlockState, t: float) -> Any:
        return state.pack(state.value)
