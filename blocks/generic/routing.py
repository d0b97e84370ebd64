"""Blocks that join and select signals."""

from __future__ import annotations

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Scalar,
    Vector,
    kernel_of,
)


class Concatenate(Block):
    """Join the components of any signals to one vector.

        inputs[0], inputs[1], ... ─▶ [ Concatenate ] ─▶ out

    out has the components of all inputs, in order: numbers, records and vectors of any length.
    """

    inputs = Input(Scalar, variadic=True, spread="n", doc="numbers, records or vectors")
    out = Output(Vector("n"), doc="all components, in order")

    def validate_in(self, context: BlockContext) -> None:
        if not all(context.terms["inputs"]):
            message = "an input's block is removed, which would shift the components after it"
            raise ParameterError([("inputs", f"{message}; bypass that block, or remove this one")])

    def start(self, state: BlockState) -> None:
        state.n = state.context.types["out"].shape[0]

    def output(self, state: BlockState, t: float, inputs: tuple[float, ...]) -> FloatArray:
        return np.array(inputs) if inputs else np.zeros(state.n)

    @kernel_of(output)
    def _output_kernel(self, state: BlockState, t: float, inputs: tuple[float, ...]) -> FloatArray:
        out = np.zeros(state.n)
        for i in range(len(inputs)):
            out[i] = inputs[i]
        return out
