"""The discrete Fourier transform of a vector, and its inverse."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Vector,
    param,
    portable,
    times,
)


def waves(n: int) -> tuple[FloatArray, FloatArray]:
    """cos(2 pi k i / n) and sin(2 pi k i / n), (n // 2 + 1, n), for frequencies k of places i."""
    # Exact multiples of a turn are taken off first, so that the angles keep their precision.
    turns = np.outer(np.arange(n // 2 + 1), np.arange(n)) % n
    angles = 2.0 * np.pi * turns / n
    return portable.cos(angles), portable.sin(angles)


class FourierTransform(Block):
    """The discrete Fourier transform of a vector of real numbers.

        input ─▶ [ FourierTransform ] ─▶ re, im

    re_k + i im_k = sum_j input_j exp(-2 pi i j k / n), for k from 0 to n // 2: the others are the
    complex conjugates of these. As NumPy's ``rfft``.
    """

    signal = Input(Vector("n"), name="input", doc="n real numbers")
    re = Output(Vector("m"), doc="real parts of the n // 2 + 1 coefficients")
    im = Output(Vector("m"), doc="imaginary parts")

    def infer(self, lengths: Mapping[str, int]) -> Mapping[str, int]:
        return {"m": lengths["n"] // 2 + 1} if "n" in lengths else {}

    def start(self, state: BlockState) -> None:
        cosines, sines = waves(state.context.types["input"].shape[0])
        state.cosines, state.sines = cosines, -sines

    def output(
        self, state: BlockState, t: float, input: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        return times(state.cosines, input), times(state.sines, input)


class InverseFourierTransform(Block):
    """The vector of real numbers that has a discrete Fourier transform.

        re, im ─▶ [ InverseFourierTransform ] ─▶ out

    out_j = 1/n sum_k (re_k + i im_k) exp(2 pi i j k / n) over all n coefficients, of which the
    inputs have those from 0 to n // 2. As NumPy's ``irfft``.
    """

    re = Input(Vector("m"), doc="real parts of the coefficients from 0 to n // 2")
    im = Input(Vector("m"), doc="imaginary parts")
    out = Output(Vector("n"), doc="n real numbers")

    odd: bool = param(False, doc="whether n is odd: 2 m - 1 in place of 2 m - 2, m coefficients")

    def infer(self, lengths: Mapping[str, int]) -> Mapping[str, int]:
        return {"n": 2 * lengths["m"] - 2 + self.odd} if "m" in lengths else {}

    def validate_in(self, context: BlockContext) -> None:
        if context.types["out"].shape[0] < 1:
            raise ParameterError([("odd", "one coefficient is that of one number: odd: true")])

    def start(self, state: BlockState) -> None:
        n = state.context.types["out"].shape[0]
        cosines, sines = waves(n)
        weight = np.full((len(cosines), 1), 2.0 / n)
        weight[0] = 1.0 / n
        if n % 2 == 0:
            weight[-1] = 1.0 / n  # the only one without a conjugate, beside the mean
        state.cosines, state.sines = (weight * cosines).T.copy(), (-weight * sines).T.copy()

    def output(self, state: BlockState, t: float, re: FloatArray, im: FloatArray) -> FloatArray:
        return times(state.cosines, re) + times(state.sines, im)
