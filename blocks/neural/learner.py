"""Learners: the ports, parameters and checks that all share, and an integrator as the simplest.

The input (d,), the error (k,) to reduce and a factor on it go in, what was learnt (k,) comes out.
An ensemble of neurons (:mod:`blocks.neural.adaptive`), MRAC and AdaptiveBias can therefore replace
each other in a graph, as in ``--replace snn=AdaptiveBias``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from functools import cached_property
from itertools import pairwise
from typing import final

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Scalar,
    State,
    Vector,
    dot,
    kernel_of,
    param,
    portable,
)
from blocks.core.portable import flush, flush_due
from blocks.neural.lif import LIF, lif_gain_and_bias, lif_rates
from blocks.neural.rules import pes_step

LARGEST_STEP = 2.0  # see Learner.diagnose
# Eighths of a run in which the learnt output has to grow by this factor to count as divergence.
GROWING, GROWTH = 4, 1.5


class Learner(Block, ABC):
    """The common ports and parameters, by which one kind of learner can replace another."""

    x = Input(Vector("d"), name="input", doc="what the neurons represent, the paper's a")
    error = Input(Vector("k"), doc="the error to reduce; positive lowers the output")
    learn = Input(Scalar, default=1.0, doc="factor on the error: 0 pauses learning")

    learnt = Output(Vector("k"), name="output", doc="what was learnt")

    learning_rate: float = param(
        1e-4, at_least=0.0, tunable=True, doc="kappa of PES, as Nengo scales it"
    )
    leak: float = param(
        0.0, unit="1/s", at_least=0.0, tunable=True, doc="rate at which the learnt output decays"
    )
    e_leak: float = param(
        0.0,
        at_least=0.0,
        tunable=True,
        doc="rate (1/s) at which it decays as well, per size of the error",
    )
    normalised: bool = param(
        False, doc="divide steps by the activity squared: the rate is then in 1/s, whoever learns"
    )
    limit: float = param(
        math.inf,
        above=0.0,
        finite=False,
        tunable=True,
        doc="largest size of each component of the output",
    )
    tau_rc: float = param(0.02, unit="s", above=0.0, doc="membrane time constant")
    tau_ref: float = param(0.002, unit="s", above=0.0, doc="refractory time; spikes: at least dt")
    max_rates: FloatArray = param(
        (200.0, 400.0), unit="Hz", above=0.0, shape=(2,), doc="range of the rates at input = radius"
    )
    intercepts: FloatArray = param(
        (-1.0, 0.9), below=1.0, shape=(2,), doc="range of the inputs where firing sets in"
    )

    @cached_property
    def model(self) -> LIF:
        """The neurons, or those that this learner replaces."""
        return LIF(tau_rc=self.tau_rc, tau_ref=self.tau_ref)

    def validate(self) -> None:
        problems = []
        for name in ("max_rates", "intercepts"):
            low, high = self.value(name)
            if low > high:
                problems.append((name, f"expected [low, high], got [{low:g}, {high:g}]"))
        slowest, fastest = self.model.slowest, self.model.fastest
        if self.max_rates[1] >= fastest:
            message = f"a refractory time of {self.tau_ref:g} s allows less than {fastest:g} Hz"
            problems.append(("max_rates", message))
        if self.max_rates[0] <= slowest:
            message = f"these time constants allow more than {slowest:.6g} Hz at the threshold"
            problems.append(("max_rates", message))
        if problems:
            raise ParameterError(problems)

    def diagnose(self, state: BlockState, ticks: int, watched: tuple[float, ...]) -> Iterable[str]:
        """Report steps that overshoot, and unbounded growth.

        With an error that is the output's own, one step of the rule multiplies it by 1 - g, where
        g is :meth:`gain_of_a_step`; for g above 2 it grows on each tick (Haykin, Adaptive Filter
        Theory: the bound on the step of LMS). Growth without bound is growth by half or more
        in each of the last four eighths of a run: faster than the cube of time.
        """
        gain = self.gain_of_a_step(state)
        if gain > LARGEST_STEP:
            yield (
                f"one step of learning changes the output by {gain:.3g} times the error; above "
                f"{LARGEST_STEP:g} it overshoots further each time; lower learning_rate"
            )
        last = watched[-GROWING - 1 :]
        grew = [b >= GROWTH * a > 0.0 for a, b in pairwise(last)]
        if len(grew) == GROWING and all(grew):
            yield (
                f"what it learnt grew {last[-1] / last[0]:.3g}-fold over the last half of the run, "
                "and ever faster: learning diverges; check the sign of the error, lower "
                "learning_rate or give it a leak or a limit"
            )

    def keep_of(self, state: BlockState, error: FloatArray) -> float:
        """The factor by which what was learnt decays in a step.

        exp(-(leak + e_leak |error|) dt), |error| the sum over the components: a leak, and
        e-modification (Narendra and Annaswamy, A New Adaptive Law for Robust Adaptation without
        Persistent Excitation, 1987), which acts while there is an error only.
        """
        rate = self.leak
        for k in range(len(error)):
            rate += self.e_leak * abs(error[k])
        return math.exp(-rate * state.dt)

    @abstractmethod
    def gain_of_a_step(self, state: BlockState) -> float:
        """How much one update changes the output, as a multiple of the error."""

    @abstractmethod
    def output(self, state: BlockState, t: float) -> FloatArray:
        """What was learnt up to this tick, (k,), each component within +-limit."""


def decode_activity(weights: FloatArray, activity: FloatArray, limit: float) -> FloatArray:
    """weights (k, n) times activity (n,), each component within +-limit, (k,)."""
    # Not by BLAS, whose order of summation depends on the processor. With k = 1, operands of equal
    # shape save NumPy the broadcasting, which takes longer than the products.
    decoded: FloatArray = np.add.reduce(weights * activity[None], 1)
    if limit == math.inf:
        return decoded
    return np.array([min(max(value, -limit), limit) for value in decoded.tolist()])


@kernel_of(decode_activity)
def _decode_kernel(weights: FloatArray, activity: FloatArray, limit: float) -> FloatArray:
    decoded = np.empty(len(weights))
    for row in range(len(weights)):
        total = dot(weights[row], activity)
        decoded[row] = total if limit == math.inf else min(max(total, -limit), limit)
    return decoded


def gain_and_bias(
    max_rates: FloatArray, intercepts: FloatArray, tau_rc: float, tau_ref: float
) -> tuple[FloatArray, FloatArray]:
    """Gain and bias of LIF neurons that start to fire at ``intercepts`` and reach ``max_rates``."""
    # 1 - exp loses up to five bits of what -expm1, in LIF.gain_and_bias, keeps: the published runs
    # of the paper's cases, one of them chaotic, were made with it.
    z = 1.0 / (1.0 - portable.exp((tau_ref - 1.0 / max_rates) / tau_rc))
    return lif_gain_and_bias(z, intercepts)


def mean_squared_rate(
    max_rates: FloatArray, intercepts: FloatArray, tau_rc: float, tau_ref: float, nodes: int = 100
) -> float:
    """Mean squared firing rate (Hz^2), at input 0, of a large population of LIF neurons.

    Their maximum rates and intercepts are uniform over the two ranges. The midpoint rule, with
    ``nodes`` squared neurons.
    """
    # A sum and not a draw: the integrator that replaces a network has to be the same in every run.
    middles = (np.arange(nodes) + 0.5) / nodes
    rates, starts = (low + (high - low) * middles for low, high in (max_rates, intercepts))
    _, bias = gain_and_bias(rates[:, None], starts[None, :], tau_rc, tau_ref)
    return float(np.mean(lif_rates(bias, tau_rc, tau_ref) ** 2))


class IntegratingLearner(Learner, ABC):
    """A learner without neurons, as fast as the ensemble that it replaces."""

    power: float | None = param(
        None, unit="Hz^2", above=0.0, doc="mean squared rate, instead of the computed one"
    )

    def start(self, state: BlockState) -> None:
        power = 1.0 if self.normalised else self.power
        if power is None:
            power = mean_squared_rate(self.max_rates, self.intercepts, self.tau_rc, self.tau_ref)
        state.step = self.learning_rate * power * state.dt


@final
class AdaptiveBias(IntegratingLearner):
    """Learn an output that is the same for all inputs: an integrator of the error, with a leak.

        input, error ─▶ [ AdaptiveBias ] ─▶ output

    output = b, each component within +-limit
    b(t_k+1) = keep b(t_k) - g error(t_k),  keep = exp(-(leak + e_leak |error|) dt)
    g = kappa power dt, or kappa dt if ``normalised``

    kappa is ``learning_rate``. An ensemble under PES with input 0 does the same, delayed by its
    synapse, with ``power`` the mean square of its neurons' rates. The default is computed for very
    many neurons with these rates, intercepts and time constants, so that the integrator learns as
    fast as the ensemble that it replaces does about 0, and the two differ only by the ensemble's
    response to its input. With a power of 1 it is a plain integrator of gain kappa. ``input`` is
    not read. The output depends on the state alone, so the block breaks loops.
    """

    bias = State("k", doc="what was learnt")

    def start(self, state: BlockState) -> None:
        super().start(state)
        # PES of one neuron whose activity is 1: the same text as for an ensemble, so that the two
        # cannot come apart.
        state.weights, state.activity = state.bias[:, None], np.ones(1)

    def watch(self, state: BlockState) -> float:
        """The norm of the learnt output."""
        return float(np.linalg.norm(state.bias))

    def gain_of_a_step(self, state: BlockState) -> float:
        """kappa power dt."""
        return float(state.step)

    def output(self, state: BlockState, t: float) -> FloatArray:
        return decode_activity(state.weights, state.activity, self.limit)

    def update(self, state: BlockState, t: float, error: FloatArray, learn: float) -> None:
        gamma, keep = state.step * learn, self.keep_of(state, error)
        pes_step(state.weights, state.activity, error, gamma, keep)
        if flush_due(t, state.dt):
            flush(state.bias)
