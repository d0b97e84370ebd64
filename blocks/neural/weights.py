"""Weights from neurons straight to neurons, with unsupervised learning.

Spikes (n,) go in, and those of the neurons behind (m,) for learning; a current (m,) comes out::

    w: {type: Weights, weights: "normal(0, 0.001)", learning: {rule: oja}}
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import final

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
    Spikes,
    State,
    Vector,
    param,
)
from blocks.core.portable import flush, flush_due, share_of
from blocks.neural.distributions import Distribution
from blocks.neural.rules import BCM, Oja, WeightRule, bcm_step, follow, oja_step
from blocks.neural.solving import decode
from blocks.neural.synapses import Synapse, passed, remember


@final
class Weights(Block):
    """A full matrix of weights from the spikes of one population to the currents of another.

        spikes, post, learn ─▶ [ Weights ] ─▶ current

    Current   J = h * (W spikes), h the synapse
    Learning  bcm: W += kappa dt learn p (p - theta) s';
              oja: W += kappa dt learn (p s' - beta p^2 W);
              s and p the spikes before and after the weights through a lowpass of the rule's tau

    Wire ``current`` to an Ensemble's input of that name, and for learning its spikes to ``post``.
    """

    spikes = Input(Spikes("n"), doc="spikes before the weights")
    post = Input(Spikes("m"), variadic=True, doc="spikes after the weights, for learning")
    learn = Input(Scalar, default=1.0, doc="factor on the learning rate: 0 pauses learning")
    current = Output(Vector("m"), doc="current into the neurons after the weights")

    initial: Distribution = param(name="weights", doc="weights, a row per neuron they lead to")
    synapse: Synapse = param(0.005, unit="s", doc="filter of the current")
    learning: WeightRule | None = param(None, doc="rule by which the weights learn")

    weights = State("m", "n", doc="the weights W")
    filtered = State("order", "m", doc="the synapse's states")
    before = State("n", unit="1/s", doc="filtered spikes s before the weights")
    after = State("m", unit="1/s", doc="filtered spikes p after the weights")
    theta = State("m", unit="1/s", doc="threshold of bcm")

    def sizes(self) -> dict[str, int]:
        sizes = {"order": self.synapse.order}
        if self.initial.fixed is not None and self.initial.fixed.ndim == 2:
            sizes["m"], sizes["n"] = self.initial.fixed.shape
        return sizes

    def validate_in(self, context: BlockContext) -> None:
        wires = len(context.terms["post"])
        if self.learning is not None and not wires:
            message = "learns from the spikes after the weights: wire them to 'post'"
            raise ParameterError([("learning", f"{self.learning.label} {message}")])
        if wires and self.learning is None:
            message = "'post' is wired but nothing learns; add {rule: bcm} or remove the wire"
            raise ParameterError([("learning", message)])
        m, n = context.types["current"].shape[0], context.types["spikes"].shape[0]
        # Drawn again in the run: this only finds a shape that does not fit, before anything runs.
        try:
            self.initial.draw(np.random.default_rng(0), m, n)
        except ValueError as error:
            raise ParameterError([("weights", str(error))]) from None

    def start(self, state: BlockState) -> None:
        state.weights[...] = self.initial.draw(state.rng, *state.weights.shape)
        state.a, state.b = self.synapse.matrices(state.dt)
        state.rule = "" if self.learning is None else self.learning.label
        state.rate = state.share = state.slow = state.beta = 0.0
        if self.learning is not None:
            state.rate = self.learning.learning_rate * state.dt
            state.share = share_of(self.learning.tau, state.dt)
        if isinstance(self.learning, BCM):
            state.slow = share_of(self.learning.theta_tau, state.dt)
        if isinstance(self.learning, Oja):
            state.beta = self.learning.beta

    def facts(self, state: BlockState) -> Mapping[str, float]:
        return {"synapses": float(state.weights.size)}

    def output(self, state: BlockState, t: float, spikes: FloatArray) -> FloatArray:
        return passed(state.filtered, state.a, state.b, decode(state.weights, spikes, 1))

    def update(
        self,
        state: BlockState,
        t: float,
        spikes: FloatArray,
        post: tuple[FloatArray, ...],
        learn: float,
        current: FloatArray,
    ) -> None:
        if len(state.b) > 0:
            # A first-order synapse's state is its output: only the second order needs its input.
            decoded = current if len(state.b) == 1 else decode(state.weights, spikes, 1)
            remember(state.filtered, state.a, state.b, decoded, current)
        if len(post) > 0:
            follow(state.before, spikes, state.share)
            follow(state.after, post[0], state.share)
            rate = state.rate * learn
            if state.rule == "bcm":
                follow(state.theta, post[0], state.slow)
                bcm_step(state.weights, state.before, state.after, state.theta, rate)
            if state.rule == "oja":
                oja_step(state.weights, state.before, state.after, rate, state.beta)
        if flush_due(t, state.dt):
            flush(state.filtered)
            flush(state.before)
            flush(state.after)
            flush(state.theta)
            if state.rule != "":
                flush(state.weights)
