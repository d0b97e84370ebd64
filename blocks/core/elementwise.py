"""The base of blocks that treat each component of a signal alike, and checks of their parameters.

A number, a record or a vector goes in, the same form comes out; a block says what it is of one::

    class Doubled(Elementwise):
        def of(self, state, x, i):
            return 2.0 * x
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from blocks.core.block import Block
from blocks.core.block_state import BlockContext, BlockState
from blocks.core.declarations import Input, Output
from blocks.core.params import ParameterError
from blocks.core.signals import FloatArray, Same, SignalType


class Componentwise(Block, ABC):
    """A block whose input is a number, a record or a vector, and ``out`` of the same type."""

    signal = Input(Same("T"), name="input", doc="a number, a record or a vector")

    def validate_in(self, context: BlockContext) -> None:
        check_flat(context.types["out"], "input")

    def start(self, state: BlockState) -> None:
        kind = state.context.types["out"]
        state.form, state.pack = kind.form, kind.pack
        state.size = kind.shape[0] if kind.shape else 1

    def packed(self, state: BlockState, cells: FloatArray) -> Any:
        """Numbers, one per component, in the signal's own form."""
        if state.form == "scalar":
            return float(cells[0])
        if state.form == "array":
            return cells
        return state.pack(cells)

    def store(self, state: BlockState, cells: FloatArray, input: Any) -> None:
        """Write a signal into numbers, one per component."""
        if state.form == "scalar":
            cells[0] = input
        else:
            for i in range(state.size):
                cells[i] = input[i]


class Elementwise(Componentwise, ABC):
    """A block that computes each component of its output by :meth:`of` from that of its input.

    Numbers, records and vectors; the two forms of ``output`` are one text for both engines.
    """

    out = Output(Same("T"), through="input", doc="of each component")

    def output(self, state: BlockState, t: float, input: Any) -> Any:
        # Not one array for all forms: a float that stays a float costs Python far less than an
        # array of one number.
        if state.form == "scalar":
            return self.of(state, input, 0)
        out = np.empty(state.size)
        for i in range(state.size):
            out[i] = self.of(state, float(input[i]), i)
        if state.form == "array":
            return out
        return state.pack(out)

    @abstractmethod
    def of(self, state: BlockState, x: float, i: int) -> float:
        """The output's component ``i``, where that of the input is x."""


def check_flat(kind: SignalType, name: str) -> None:
    """Check that signals of a type are numbers, records or vectors, for the parameter or input
    ``name``.

    Raises
    ------
    ParameterError : they are tables of numbers, or paths.
    """
    if len(kind.shape) > 1:
        message = f"expected a number, a record or a vector, got {kind}"
        raise ParameterError([(name, message)])


def check_sized(kind: SignalType, name: str, value: FloatArray | None) -> None:
    """Check that the array parameter ``name`` is one number, or has one per component of a type.

    Raises
    ------
    ParameterError : it is neither.
    """
    if value is not None and value.shape not in ((), kind.shape):
        expected = f"a number or {kind.numbers}" if kind.shape else "a number"
        message = f"expected {expected} for {kind}, got {value.tolist()}"
        raise ParameterError([(name, message)])


def spread_to(value: FloatArray | float | None, size: int, absent: float = 0.0) -> FloatArray:
    """A parameter as ``size`` numbers: one for all components, or one for each."""
    # By 1.0 and not by a dtype: an export traces this with stand-ins for numbers.
    return np.broadcast_to(1.0 * np.asarray(absent if value is None else value), (size,)).copy()


def check_ascending(points: FloatArray, name: str, what: str = "numbers", unit: str = "") -> None:
    """Check that there are two or more points, in ascending order.

    Raises
    ------
    ParameterError : there are not; ``what`` and ``unit`` are those of the message.
    """
    if len(points) < 2:
        some = "points" if what == "numbers" else what
        raise ParameterError([(name, f"expected at least two {some}, got {len(points)}")])
    wrong = np.flatnonzero(np.diff(points) <= 0.0)
    if wrong.size:
        i, unit = int(wrong[0]), f" {unit}" if unit else ""
        pair = f"got {points[i]:g}{unit} before {points[i + 1]:g}{unit}"
        raise ParameterError([(name, f"expected {what} in ascending order, {pair}")])


def piece(points: FloatArray, x: float) -> int:
    """The piece between ascending points that holds x, by bisection; outside: the outermost."""
    low, high = 0, len(points) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x < points[middle]:
            high = middle
        else:
            low = middle
    return low
