"""Direct adaptive control with one weight per input and a bias, in place of an ensemble."""

from __future__ import annotations

import math
from typing import final

import numpy as np

from blocks.core import BlockState, FloatArray, State, param
from blocks.core.portable import flush, flush_due
from blocks.learning.learner import Learner, mean_squared_rate


@final
class MRAC(Learner):
    """Model reference adaptive control with a linear regressor: a bias and a weight per input.

        input, error, learn ─▶ [ MRAC ] ─▶ output

    output = b + w s, each component within +-limit
    s is ``input`` behind a lowpass of time constant ``tau_syn``
    b(t_k+1) = keep b(t_k) - g error(t_k),  w(t_k+1) = keep w(t_k) - g error(t_k) s'
    g = kappa power dt, or kappa dt / (1 + |s|^2) if ``normalised``
    keep = exp(-(leak + e_leak |error|) dt)

    The law for a disturbance that is linear in known signals (Lavretsky and Wise, Robust and
    Adaptive Control, 2013; the reference model here is the path itself), with the leak of Ioannou's
    sigma-modification and, with ``e_leak``, Narendra and Annaswamy's e-modification. Of a turn rate
    as input, b learns a bias and w the share of the command that was lost.

    It has an ensemble's ports and most of its parameters; ``power`` is as in AdaptiveBias, so that
    it learns as fast as the ensemble that it replaces does about 0. The output depends on the state
    alone, so the block breaks loops.
    """

    power: float | None = param(
        None, unit="Hz^2", above=0.0, doc="mean squared rate, instead of the computed one"
    )
    tau_syn: float = param(0.01, unit="s", above=0.0, doc="time constant of the input's lowpass")
    bias = State("k", doc="what was learnt for input 0")
    weights = State("k", "d", doc="what was learnt per input")
    regressor = State("d", doc="the input behind its lowpass")

    def start(self, state: BlockState) -> None:
        power = 1.0 if self.normalised else self.power
        if power is None:
            power = mean_squared_rate(self.max_rates, self.intercepts, self.tau_rc, self.tau_ref)
        state.step = self.learning_rate * power * state.dt
        state.pass_on = -math.expm1(-state.dt / self.tau_syn)

    def watch(self, state: BlockState) -> float:
        """The norm of the weights."""
        return float(np.hypot(np.linalg.norm(state.bias), np.linalg.norm(state.weights)))

    def gain_of_a_step(self, state: BlockState) -> float:
        """g (1 + |s|^2)."""
        return float(state.step * (1.0 if self.normalised else self._power(state)))

    def _power(self, state: BlockState) -> float:
        """1 + |s|^2."""
        power = 1.0
        for j in range(len(state.regressor)):
            power += state.regressor[j] * state.regressor[j]
        return power

    def output(self, state: BlockState, t: float) -> FloatArray:
        found = np.empty(len(state.bias))
        for k in range(len(found)):
            total = state.bias[k]
            for j in range(len(state.regressor)):
                total += state.weights[k, j] * state.regressor[j]
            found[k] = min(max(total, -self.limit), self.limit)
        return found

    def update(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        keep, step = self.keep_of(state, error), state.step * learn
        if self.normalised:
            step /= self._power(state)
        for k in range(len(error)):
            slope = step * error[k]
            state.bias[k] = keep * state.bias[k] - slope
            for j in range(len(input)):
                state.weights[k, j] = keep * state.weights[k, j] - slope * state.regressor[j]
        for j in range(len(input)):
            state.regressor[j] += state.pass_on * (input[j] - state.regressor[j])
        if flush_due(t, state.dt):
            flush(state.regressor)
            flush(state.bias)
            flush(state.weights)
