"""Direct adaptive control with one weight per input and a bias, in place of an ensemble.

The ports are those of :mod:`blocks.neural.learner`::

    adaptive: {type: MRAC, learning_rate: 5, normalised: true, limit: 0.5}
"""

from __future__ import annotations

from typing import final

import numpy as np

from blocks.core import BlockState, FloatArray, State, param
from blocks.core.portable import flush, flush_due, share_of
from blocks.neural.learner import IntegratingLearner
from blocks.neural.rules import follow, pes_step


@final
class MRAC(IntegratingLearner):
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

    tau_syn: float = param(0.01, unit="s", above=0.0, doc="time constant of the input's lowpass")
    bias = State("k", doc="what was learnt for input 0")
    weights = State("k", "d", doc="what was learnt per input")
    regressor = State("d", doc="the input behind its lowpass")

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.pass_on = share_of(self.tau_syn, state.dt)
        # The bias is the weight of an input that is always 1.
        state.bias_weights, state.one = state.bias[:, None], np.ones(1)

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
        value = np.empty(len(state.bias))
        for k in range(len(value)):
            total = state.bias[k]
            for j in range(len(state.regressor)):
                total += state.weights[k, j] * state.regressor[j]
            value[k] = min(max(total, -self.limit), self.limit)
        return value

    def update(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        # The regressor of the output that made this error, before it moves on with the input.
        keep, step = self.keep_of(state, error), state.step * learn
        if self.normalised:
            step /= self._power(state)
        pes_step(state.bias_weights, state.one, error, step, keep)
        pes_step(state.weights, state.regressor, error, step, keep)
        follow(state.regressor, input, state.pass_on)
        if flush_due(t, state.dt):
            flush(state.regressor)
            flush(state.bias)
            flush(state.weights)
