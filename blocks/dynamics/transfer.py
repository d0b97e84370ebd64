"""Transfer functions in continuous time, of one input and one output, and a derivative.

A signal goes in, what the system makes of it comes out; the run's solver integrates the states::

    motor: {type: TransferFunction, numerator: [2.0], denominator: [0.1, 1.0]}  # 2 / (0.1 s + 1)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
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
    State,
    check_flat,
    check_sized,
    param,
)
from blocks.dynamics.discrete import DiscreteTransferFunction, check_rational
from blocks.dynamics.discretization import sampled_rational
from blocks.dynamics.linear import ContinuousSystem, sampled_system

READABLE = 4  # the degree up to which a sampled system is written as a transfer function


class _Rational(ContinuousSystem, ABC):
    """A system that is given as numerator and denominator in s."""

    @property
    @abstractmethod
    def rational(self) -> tuple[FloatArray, FloatArray]:
        """Coefficients of numerator and denominator, the highest power first."""

    def sizes(self) -> dict[str, int]:
        return {"n": max(1, len(self.rational[1]) - 1)}

    def discretized(self, method: str, step: float) -> Block:
        numerator, denominator = self.rational
        # Coefficients of a higher degree lose too many digits.
        if len(denominator) - 1 > READABLE:
            return sampled_system(self, method, step)
        b, a = sampled_rational(numerator, denominator, method, step)
        return DiscreteTransferFunction(numerator=b.tolist(), denominator=a.tolist())

    @property
    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The controllable canonical form."""
        numerator, denominator = self.rational
        a = denominator / denominator[0]
        b = np.zeros(len(a))
        significant = np.trim_zeros(numerator, "f")
        b[len(a) - len(significant) :] = significant / denominator[0]
        # A system without states, a gain, has one that stays zero.
        n = max(1, len(a) - 1)
        transition, inputs = np.eye(n, k=-1), np.zeros((n, 1))
        outputs = np.zeros((1, n))
        if len(a) > 1:
            transition[0] = -a[1:]
            inputs[0, 0] = 1.0
            outputs[0] = b[1:] - b[0] * a[1:]
        return transition, inputs, outputs, np.array([[b[0]]])


class TransferFunction(_Rational):
    """A linear system given as a transfer function in s.

        input ─▶ [ TransferFunction ] ─▶ out

    out(s) = (b0 s^m + ... + bm) / (a0 s^n + ... + an) input(s) with m <= n, in the controllable
    canonical form, at rest at the start. With m < n, ``out`` depends on the state alone and breaks
    loops.
    """

    numerator: FloatArray = param(shape=(None,), doc="b0, ..., bm: powers of s, the highest first")
    denominator: FloatArray = param(shape=(None,), doc="a0, ..., an: the highest first")

    def validate(self) -> None:
        check_rational(self.numerator, self.denominator)

    @property
    def rational(self) -> tuple[FloatArray, FloatArray]:
        return self.numerator, self.denominator


class ZeroPoleGain(_Rational):
    """A linear system given by its zeros, its poles and a gain.

        input ─▶ [ ZeroPoleGain ] ─▶ out

    out(s) = gain (s - z1) (s - z2) ... / ((s - p1) (s - p2) ...) input(s), with no more zeros than
    poles. A complex zero or pole is written as [real, imaginary] and stands for its conjugate, too.
    """

    real_zeros: FloatArray | None = param(None, shape=(None,), name="zeros", doc="real zeros")
    real_poles: FloatArray | None = param(None, shape=(None,), name="poles", doc="real poles")
    complex_zeros: FloatArray | None = param(
        None, shape=(None, 2), doc="pairs of complex zeros, [[real, imaginary], ...]"
    )
    complex_poles: FloatArray | None = param(
        None, shape=(None, 2), doc="pairs of complex poles, [[real, imaginary], ...]"
    )
    gain: float = param(1.0, doc="the gain")

    def validate(self) -> None:
        numerator, denominator = self.rational
        if len(numerator) > len(denominator):
            message = f"improper: expected at most {len(denominator) - 1} zeros, one per pole, "
            raise ParameterError([("zeros", f"{message}got {len(numerator) - 1}")])

    @property
    def rational(self) -> tuple[FloatArray, FloatArray]:
        numerator = _polynomial(self.real_zeros, self.complex_zeros)
        return self.gain * numerator, _polynomial(self.real_poles, self.complex_poles)


class SecondOrder(_Rational):
    """A second-order system, such as an actuator or a filter.

        input ─▶ [ SecondOrder ] ─▶ out

    out(s) = gain w^2 / (s^2 + 2 damping w s + w^2) input(s) with w = natural_frequency; at rest at
    the start. ``out`` depends on the state alone: it breaks loops.
    """

    natural_frequency: float = param(
        unit="rad/s", above=0.0, tunable=True, doc="undamped natural frequency"
    )
    damping: float = param(0.7, at_least=0.0, tunable=True, doc="damping ratio; 1: critical")
    gain: float = param(1.0, tunable=True, doc="gain at rest")

    @property
    def rational(self) -> tuple[FloatArray, FloatArray]:
        w = self.natural_frequency
        return np.array([self.gain * w * w]), np.array([1.0, 2.0 * self.damping * w, w * w])


class Butterworth(_Rational):
    """A Butterworth filter: flat in its band, falling by 20 dB per decade and order outside of it.

        input ─▶ [ Butterworth ] ─▶ out

    |out/input|^2 = 1 / (1 + (f / cutoff)^(2 order)) for a lowpass (scipy.signal.butter, analog);
    a bandpass or bandstop has twice as many states as its order. At rest at the start.
    """

    order: int = param(2, at_least=1, at_most=12, doc="order of the filter")
    cutoff: FloatArray = param(
        unit="Hz", shape=[(), (2,)], doc="where the power is halved; two for a band"
    )
    band: str = param(
        "lowpass", choices=("lowpass", "highpass", "bandpass", "bandstop"), doc="what passes"
    )

    def sizes(self) -> dict[str, int]:
        return {"n": self.order * (1 + self.band.startswith("band"))} if self.__dict__ else {}

    def validate(self) -> None:
        edges = self.cutoff.reshape(-1)
        wanted = 2 if self.band.startswith("band") else 1
        if len(edges) != wanted:
            message = f"expected {wanted} frequencies for a {self.band}, got {len(edges)}"
            raise ParameterError([("cutoff", message)])
        if edges[0] <= 0.0 or edges[-1] < edges[0] or (wanted == 2 and edges[0] == edges[1]):
            message = f"expected frequencies above 0 in ascending order, got {edges.tolist()}"
            raise ParameterError([("cutoff", message)])

    @cached_property
    def rational(self) -> tuple[FloatArray, FloatArray]:
        from scipy.signal import butter

        edges = 2.0 * np.pi * self.cutoff.reshape(-1)
        band = edges if len(edges) == 2 else edges[0]
        numerator, denominator = butter(self.order, band, self.band, analog=True)
        return np.asarray(numerator), np.asarray(denominator)


class Derivative(Block):
    """The derivative of a signal, with a filter that limits noise.

        input ─▶ [ Derivative ] ─▶ out

    out(s) = s / (tau s + 1) input(s), each component: out = (input - x) / tau, x' = out. The filter
    starts at ``initial``, the input's value at the start; with ``first``, at the input's value at
    the first tick, where ``out`` is then 0.
    """

    signal = Input(Same("T"), name="input", doc="a number, a record or a vector")
    out = Output(Same("T", own_unit=True), doc="its rate of change")

    tau: float = param(0.01, unit="s", above=0.0, tunable=True, doc="time constant of the filter")
    initial: FloatArray = param(
        0.0,
        shape=[(), (None,)],
        choices=("first",),
        doc="the input at the start, or one number per component",
    )

    x = State(like="out", name="x", continuous=True, doc="the filtered input")
    begun = State(1, doc="1 once the filter has started, else 0")

    @property
    def begins(self) -> bool:
        """Whether the filter starts with the input's first value."""
        return isinstance(self.initial, str)

    def validate_in(self, context: BlockContext) -> None:
        kind = context.types["out"]
        check_flat(kind, "input")
        if not self.begins:
            check_sized(kind, "initial", self.initial)

    def start(self, state: BlockState) -> None:
        kind = state.context.types["out"]
        state.form, state.pack = kind.form, kind.pack
        state.size = kind.shape[0] if kind.shape else 1
        state.x[...] = 0.0 if self.begins else self.initial
        state.begun[0] = 0.0 if self.begins else 1.0
        state.cells = state.x.reshape(-1)

    def slopes(self, state: BlockState, input: Any) -> FloatArray:
        """The rate of change of each component."""
        rates = np.zeros(state.size)
        if state.begun[0] > 0.0:
            for i in range(state.size):
                rates[i] = (input[i] - state.cells[i]) / self.tau
        return rates

    def output(self, state: BlockState, t: float, input: Any) -> Any:
        if state.form == "scalar":
            return self._slope(state, input)
        rates = self.slopes(state, input)
        if state.form == "array":
            return rates
        return state.pack(rates)

    def update(self, state: BlockState, t: float, input: Any) -> None:
        if state.begun[0] == 0.0:
            state.begun[0] = 1.0
            if state.form == "scalar":
                state.cells[0] = input
            else:
                for i in range(state.size):
                    state.cells[i] = input[i]

    def derivative(self, state: BlockState, t: float, input: Any) -> Any:
        if state.form == "scalar":
            return self._slope(state, input)
        return self.slopes(state, input)

    def _slope(self, state: BlockState, input: float) -> float:
        return float((input - state.cells[0]) / self.tau) if state.begun[0] > 0.0 else 0.0


def _polynomial(real: FloatArray | None, pairs: FloatArray | None) -> FloatArray:
    """The polynomial with these roots, the highest power first."""
    polynomial = np.ones(1)
    for root in () if real is None else real:
        polynomial = np.convolve(polynomial, [1.0, -root])
    for re, im in () if pairs is None else pairs:
        polynomial = np.convolve(polynomial, [1.0, -2.0 * re, re * re + im * im])
    return polynomial
