"""Adaptation without a network: what a learning ensemble comes to where its input stands still."""

from __future__ import annotations

import math
from typing import final

import numpy as np

from blocks.core import BlockState, FloatArray, State, kernel_of, param
from blocks.learning.learner import Learner
from blocks.learning.lif import mean_squared_rate


@final
class AdaptiveBias(Learner):
    """Learn an output that is the same for all inputs: an integrator of the error, with a leak.

        input, error ─▶ [ AdaptiveBias ] ─▶ output

    output = b, each component within +-limit
    b(t_k+1) = exp(-leak dt) b(t_k) - kappa power dt error(t_k)

    kappa is ``learning_rate``. An ensemble under PES whose input stays at 0 does just this, late
    by its synapse, where ``power`` is the mean square of its neurons' rates. By default that is
    worked out for very many neurons with these rates, intercepts and time constants, so that an
    integrator in the place of an ensemble learns as fast as that one does about 0, and what
    differs between the two is what the ensemble makes of its input. With a power of 1 it is a
    plain integrator of gain kappa. ``input`` is not read. The output depends on the state alone,
    so the block breaks loops.
    """

    power: float | None = param(
        None, unit="Hz^2", above=0.0, doc="mean squared rate, in place of the one worked out"
    )

    bias = State("k", doc="what was learnt")

    def start(self, state: BlockState) -> None:
        power = self.power
        if power is None:
            power = mean_squared_rate(self.max_rates, self.intercepts, self.tau_rc, self.tau_ref)
        state.keep = math.exp(-self.leak * state.dt)
        state.step = self.learning_rate * power * state.dt

    def watch(self, state: BlockState) -> float:
        """The size of what was learnt."""
        return float(np.linalg.norm(state.bias))

    def gain_of_a_step(self, state: BlockState) -> float:
        """kappa power dt."""
        return float(state.step)

    def output(self, state: BlockState, t: float) -> FloatArray:
        limited: FloatArray = np.clip(state.bias, -self.limit, self.limit)
        return limited

    def update(self, state: BlockState, t: float, error: FloatArray, learn: float) -> None:
        state.bias *= state.keep
        state.bias -= state.step * learn * error

    @kernel_of(output)
    def _output_kernel(self, state: BlockState, t: float) -> FloatArray:
        limited = np.empty(len(state.bias))
        for i in range(len(limited)):
            limited[i] = min(max(state.bias[i], -self.limit), self.limit)
        return limited

    @kernel_of(update)
    def _update_kernel(self, state: BlockState, t: float, error: FloatArray, learn: float) -> None:
        for i in range(len(state.bias)):
            state.bias[i] = state.keep * state.bias[i] - state.step * learn * error[i]
