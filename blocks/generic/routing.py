"""Blocks that join and select signals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    Vector,
    nearest,
    param,
)


class Select(Block):
    """Pick components of signals, in any order, or leave some out.

        inputs[0], inputs[1], ... ─▶ [ Select ] ─▶ out

    out = the components of all inputs, counted through from 0, at the given indices: a vector with
    as many components as indices. With ``without`` in place of ``indices``, all others in their
    order. One component of a signal, or a range of them, needs no block: ``a.out[1]``,
    ``a.out[0:4]``.
    """

    inputs = Input(Scalar, variadic=True, spread="inputs", doc="numbers, records or vectors")
    out = Output(Vector("chosen"), doc="the chosen components")

    indices: FloatArray | None = param(
        None,
        at_least=0.0,
        shape=(None,),
        doc="which components, from 0: a list, or '[i for i in range(8) if i != 3]'",
    )
    without: FloatArray | None = param(
        None, at_least=0.0, shape=(None,), doc="which components to leave out, from 0"
    )

    def validate(self) -> None:
        if (self.indices is None) == (self.without is None):
            given = "neither" if self.indices is None else "both"
            message = f"expected either indices or without, got {given}"
            raise ParameterError([("indices", message)])
        name, numbers = self._given
        if (numbers % 1.0).any() or not len(numbers):
            message = f"expected a list of integers, got {numbers.tolist()}"
            raise ParameterError([(name, message)])

    @property
    def _given(self) -> tuple[str, FloatArray]:
        if self.indices is not None:
            return "indices", self.indices
        return "without", np.zeros(0) if self.without is None else self.without

    def sizes(self) -> dict[str, int]:
        indices = self.__dict__.get("indices")
        return {} if indices is None else {"chosen": len(indices)}

    def infer(self, lengths: Mapping[str, int]) -> Mapping[str, int]:
        if self.without is None or "inputs" not in lengths:
            return {}
        return {"chosen": max(lengths["inputs"] - len(np.unique(self.without)), 0)}

    def validate_in(self, context: BlockContext) -> None:
        count, (name, numbers) = context.count("inputs"), self._given
        if not count:
            raise ParameterError([("inputs", "expected at least one signal to choose from")])
        if numbers.max() >= count:
            message = f"expected numbers from 0 to {count - 1}, since the inputs have "
            message += f"{count} components, got {numbers.max():g}"
            raise ParameterError([(name, message)])
        if self.indices is None and len(np.unique(numbers)) == count:
            raise ParameterError([(name, f"leaves none of the {count} components")])

    def start(self, state: BlockState) -> None:
        name, numbers = self._given
        if name == "without":
            numbers = np.setdiff1d(np.arange(state.context.count("inputs")), numbers)
        state.count = len(numbers)
        state.indices = numbers.astype(np.int64)

    def output(self, state: BlockState, t: float, inputs: tuple[float, ...]) -> FloatArray:
        out = np.zeros(state.count)
        # Compiled, an index into an empty tuple has no type; `validate_in` refuses it anyway.
        if len(inputs) == 0:
            return out
        for i in range(state.count):
            out[i] = inputs[state.indices[i]]
        return out


class Broadcast(Block):
    """A number for every component of a vector, as a factor of a Product.

        input ─▶ [ Broadcast ] ─▶ out

    out[i] = input, for as many components as what it is wired to takes.
    """

    number = Input(Scalar, name="input", doc="the number")
    out = Output(Vector("n"), doc="the number in all components")

    n: int | None = param(
        None, at_least=1, doc="how many components; default what it is wired to takes"
    )

    def sizes(self) -> dict[str, int]:
        return {} if self.__dict__.get("n") is None else {"n": self.n or 0}

    def start(self, state: BlockState) -> None:
        state.n = state.context.types["out"].shape[0]

    def output(self, state: BlockState, t: float, input: float) -> FloatArray:
        out = np.empty(state.n)
        for i in range(state.n):
            out[i] = input
        return out


class MultiportSwitch(Block):
    """Pass on one of many signals, by its number.

        select, inputs[0], inputs[1], ... ─▶ [ MultiportSwitch ] ─▶ out

    out = inputs[i] with i the integer nearest to ``select``, at least 0 and at most the last one.
    All signals are computed all the time.
    """

    select = Input(Scalar, doc="number of the signal, from 0")
    inputs = Input(Same("T"), variadic=True, doc="the signals, of one type")
    out = Output(Same("T"), doc="the selected signal")

    def validate_in(self, context: BlockContext) -> None:
        if not context.count("inputs"):
            raise ParameterError([("inputs", "expected at least one signal to choose from")])

    def start(self, state: BlockState) -> None:
        state.zero = state.context.types["out"].zero()

    def output(self, state: BlockState, t: float, select: float, inputs: tuple[Any, ...]) -> Any:
        if len(inputs) == 0:
            return state.zero
        i = min(max(nearest(select), 0.0), len(inputs) - 1.0)
        return inputs[int(i)]


class Concatenate(Block):
    """Join the components of any signals to one vector.

        inputs[0], inputs[1], ... ─▶ [ Concatenate ] ─▶ out

    out has the components of all inputs, in order: numbers, records and vectors of any length.
    """

    inputs = Input(Scalar, variadic=True, spread="n", doc="numbers, records or vectors")
    out = Output(Vector("n"), doc="all components, in order")

    def validate_in(self, context: BlockContext) -> None:
        context.count("inputs")

    def start(self, state: BlockState) -> None:
        state.n = state.context.types["out"].shape[0]

    def output(self, state: BlockState, t: float, inputs: tuple[float, ...]) -> FloatArray:
        return np.array(inputs) if inputs else np.zeros(state.n)
