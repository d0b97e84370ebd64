"""Weights from neurons straight to neurons, with unsupervised learning.

Spikes (n,) go in, and those of the neurons behind (m,) for learning; a current (m,) comes out::

    w: {type: Weights, weights: "normal(0, 0.001)", learning: {rule: oja}}
    ring: {type: Weights, weights: exp(cos(2*pi*(i - j)/n))/n, probability: 0.2, delay: 0.002}
"""

from __future__ import annotations

import math
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
    product,
)
from blocks.core.portable import flush, flush_due
from blocks.neural.connections import PerConnection
from blocks.neural.decoded_function import DecodedFunction
from blocks.neural.decoder import Decoder
from blocks.neural.decoder_solvers import DecoderSolver
from blocks.neural.ensemble import Ensemble
from blocks.neural.rules import (
    BCM,
    Oja,
    WeightRule,
    bcm_step,
    oja_step,
    share_of_spikes,
    trace,
    trace_matrices,
    trace_order,
)
from blocks.neural.solving import decode
from blocks.neural.synapses import NoSynapse, Synapse, passed, remember

LONGEST = 100.0  # s, of a delay
TRACES = ("before", "after", "theta")


@final
class Weights(Block):
    """A matrix of weights from the spikes of one population to the currents of another.

        spikes, post, learn ─▶ [ Weights ] ─▶ current

    Current   J = h * (W spikes), h the synapse; with ``delay``, J_i of W_ij spikes_j(t - d_ij)
    Learning  bcm: W += kappa dt learn p (p - theta) s';
              oja: W += kappa dt learn (p s' - beta p^2 W);
              s and p the spikes before and after the weights through the rule's tau and post_tau

    Wire ``current`` to an Ensemble's input of that name, and for learning its spikes to ``post``.
    ``weights`` and ``delay`` are numbers, matrices, distributions, or rules of i, the neuron that a
    connection leads to, of m, and j, the one that it comes from, of n: exp(cos(2*pi*(i - j)/n)).
    With a ``solver`` in place of weights, W = encoders @ D / radius: encoders after the weights,
    whose spikes are wired to ``post``, and the decoders D of a function of what comes before.
    With ``probability``, each connection exists with that chance, and one that does not never
    learns. Delays are whole steps, one at least; rules of learning see spikes as they arrive here.
    """

    spikes = Input(Spikes("n"), doc="spikes before the weights")
    post = Input(Spikes("m"), variadic=True, doc="spikes after the weights, for learning")
    learn = Input(Scalar, default=1.0, doc="factor on the learning rate: 0 pauses learning")
    current = Output(Vector("m"), doc="current into the neurons after the weights")

    initial: PerConnection | None = param(
        None, name="weights", doc="weights, a row per neuron they lead to"
    )
    solver: DecoderSolver | None = param(
        None, doc="solver of weights between two ensembles, in place of weights that are given"
    )
    function: DecodedFunction | None = param(
        None, doc="with a solver: expressions of x, what comes before represents; default x itself"
    )
    probability: float | None = param(
        None, at_least=0.0, at_most=1.0, doc="of each connection to exist; default all of them do"
    )
    delay: PerConnection | None = param(
        None, unit="s", doc="from a spike to its current, one or for each weight; default none"
    )
    synapse: Synapse = param(0.005, unit="s", doc="filter of the current")
    learning: WeightRule | None = param(None, doc="rule, or rules, by which the weights learn")

    weights = State("m", "n", doc="the weights W")
    filtered = State("order", "m", doc="the synapse's states")
    coming = State("slots", "m", ring="head", doc="currents that arrive in the next steps")
    head = State(1, doc="how many steps were taken")
    steps = State("delayed", "n", doc="delays in steps")
    exists = State("some", "n", doc="1 where a connection exists, 0 elsewhere")
    before = State("n", unit="1/s", doc="filtered spikes s before the weights")
    after = State("m", unit="1/s", doc="filtered spikes p after the weights")
    theta = State("m", unit="1/s", doc="threshold of bcm")
    before_traced = State("before_order", "n", doc="the states of the filter of s")
    after_traced = State("after_order", "m", doc="the states of the filter of p")
    theta_traced = State("theta_order", "m", doc="the states of the filter of theta")

    def sizes(self) -> dict[str, int]:
        sizes: dict[str, int] = {}
        if (
            self.initial is not None
            and self.initial.fixed is not None
            and self.initial.fixed.ndim == 2
        ):
            sizes["m"], sizes["n"] = self.initial.fixed.shape
        return sizes

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        m = context.types["current"].shape[0]
        order = self.synapse.order_at(context.dt)
        none = dict.fromkeys(("slots", "delayed", *(f"{name}_order" for name in TRACES)), 0)
        sizes = {**self.sizes(), **none, "order": order}
        sizes["some"] = 0 if self.probability is None or self.learning is None else m
        for name, synapse in self._traces().items():
            sizes[f"{name}_order"] = trace_order(synapse, context.dt)
        if self.delay is not None:
            try:
                longest = min(self.delay.largest(m, context.types["spikes"].shape[0]), LONGEST)
            except ValueError:
                longest = 0.0  # of a rule that fails, which `validate_in` reports
            # One more than the longest, in steps: the slot of this step is still to be read.
            sizes |= {"slots": max(1, round(longest / context.dt)) + 1, "delayed": m}
        return sizes

    def _traces(self) -> dict[str, Synapse]:
        """The filters of what the rules see; several rules see the same."""
        found: dict[str, Synapse] = {}
        for rule in () if self.learning is None else self.learning.each:
            found |= {"before": rule.tau, "after": rule.after}
            if isinstance(rule, BCM):
                found["theta"] = rule.theta_tau
        return found

    def validate(self) -> None:
        if (self.initial is None) == (self.solver is None):
            message = "expected weights, or a solver of them; give one of the two"
            raise ParameterError([("weights", message)])
        if self.function is not None and self.solver is None:
            raise ParameterError([("function", "weights that are given are used as they are")])

    def validate_in(self, context: BlockContext) -> None:
        wires = len(context.terms["post"])
        if self.solver is not None:
            self._validate_solver(context)
        if self.learning is not None and not wires:
            message = "learns from the spikes after the weights: wire them to 'post'"
            raise ParameterError([("learning", f"{self.learning.label} {message}")])
        if wires and self.learning is None and self.solver is None:
            message = "'post' is wired but nothing learns; add {rule: bcm} or remove the wire"
            raise ParameterError([("learning", message)])
        m, n = context.types["current"].shape[0], context.types["spikes"].shape[0]
        # Drawn again in the run: this only finds a shape that does not fit, before anything runs.
        problems = []
        for name, pattern in (("weights", self.initial), ("delay", self.delay)):
            try:
                drawn = np.zeros(1)
                if pattern is not None:
                    drawn = pattern.draw(np.random.default_rng(0), m, n)
                if name == "delay" and pattern is not None:
                    problems += _wrong_delays(drawn, pattern.largest(m, n))
            except ValueError as error:
                problems.append((name, str(error)))
        if problems:
            raise ParameterError(problems)

    def _validate_solver(self, context: BlockContext) -> None:
        ends = [context.published.get(name) for name in ("spikes", "post")]
        for name, end in zip(("spikes", "post"), ends, strict=True):
            if not isinstance(end, Ensemble):
                message = f"a solver needs the spikes of an Ensemble at '{name}'"
                raise ParameterError([("solver", message)])
            if end.groups != 1:
                message = "expected ensembles without groups, for each of which weights are solved"
                raise ParameterError([("solver", message)])

    def _solved(self, state: BlockState) -> FloatArray:
        """Weights (m, n): the encoders after them times the decoders of what comes before."""
        before, after = state.published["spikes"], state.published["post"]
        decoders, _ = Decoder(function=self.function, solver=self.solver).solve(state.rng, before)
        if len(decoders) != after.dimensions:
            message = f"the function has {len(decoders)} components, and the ensemble behind it "
            message += f"{after.dimensions} dimensions"
            raise ParameterError([("function", message)], type(self).__name__)
        return product(after.encoders / after.radius, decoders)

    def start(self, state: BlockState) -> None:
        shape = state.weights.shape
        if self.initial is None:
            state.weights[...] = self._solved(state)
        else:
            state.weights[...] = self.initial.draw(state.rng, *shape)
        if self.probability is not None:
            exists = state.rng.random(shape) < self.probability
            state.weights *= exists
            if len(state.exists) > 0:
                state.exists[...] = exists
        if self.delay is not None:
            delays = self.delay.draw(state.rng, *shape)
            state.steps[...] = np.clip(np.rint(delays / state.dt), 1, len(state.coming) - 1)
        state.a, state.b = self.synapse.matrices(state.dt)
        self._start_learning(state)

    def _start_learning(self, state: BlockState) -> None:
        rules = {type(r): r for r in (() if self.learning is None else self.learning.each)}
        bcm, oja = rules.get(BCM), rules.get(Oja)
        state.learns, state.bcm, state.oja = bool(rules), bcm is not None, oja is not None
        state.beta = 0.0 if oja is None else oja.beta
        m = len(state.weights)
        state.bcm_rates = np.full(m, 0.0 if bcm is None else bcm.learning_rate * state.dt)
        state.oja_rate = 0.0 if oja is None else oja.learning_rate * state.dt
        state.rates = np.full(m, state.oja_rate)
        if self.solver is not None:
            # Nengo's solved weights have the neurons' gains in them, and its rules change those;
            # ours are multiplied by the gains in the Ensemble behind.
            gain = state.published["post"].gain
            state.rates[gain != 0.0] /= gain[gain != 0.0]
            state.bcm_rates[gain != 0.0] /= gain[gain != 0.0]
        taken = self._traces()
        for name in TRACES:
            synapse = taken.get(name, NoSynapse())
            a, b = trace_matrices(synapse, state.dt)
            setattr(state, f"{name}_a", a)
            setattr(state, f"{name}_b", b)
            setattr(state, f"{name}_share", share_of_spikes(synapse, state.dt))

    def facts(self, state: BlockState) -> Mapping[str, float]:
        return {"synapses": float(state.weights.size)}

    def output(self, state: BlockState, t: float, spikes: FloatArray) -> FloatArray:
        return passed(state.filtered, state.a, state.b, self._arriving(state, spikes))

    def _arriving(self, state: BlockState, spikes: FloatArray) -> FloatArray:
        """The currents of this step, before the synapse."""
        if len(state.coming) == 0:
            return decode(state.weights, spikes, 1)
        slot = int(state.head[0]) % len(state.coming)
        arriving: FloatArray = state.coming[slot].copy()
        return arriving

    def _send(self, state: BlockState, spikes: FloatArray) -> None:
        """Add the currents of these spikes to the steps in which they arrive."""
        slots, now = len(state.coming), int(state.head[0])
        state.coming[now % slots] = 0.0
        rows = np.arange(len(state.weights))
        for j in spikes.nonzero()[0].tolist():
            at = (now + state.steps[:, j].astype(np.int64)) % slots
            state.coming[at, rows] += state.weights[:, j] * spikes[j]
        state.head[0] += 1.0

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
            decoded = current if len(state.b) == 1 else self._arriving(state, spikes)
            remember(state.filtered, state.a, state.b, decoded, current)
        if len(state.coming) > 0:
            self._send(state, spikes)
        if state.learns:
            self._learn(state, spikes, post[0], learn)
            if len(state.exists) > 0:
                state.weights *= state.exists
        if flush_due(t, state.dt):
            flush(state.filtered)
            flush(state.before)
            flush(state.after)
            flush(state.theta)
            flush(state.before_traced)
            flush(state.after_traced)
            flush(state.theta_traced)
            if state.learns:
                flush(state.weights)

    def _learn(self, state: BlockState, spikes: FloatArray, post: FloatArray, learn: float) -> None:
        rows, column = state.before_a, state.before_b
        trace(state.before, state.before_traced, rows, column, spikes, state.before_share)
        rows, column = state.after_a, state.after_b
        trace(state.after, state.after_traced, rows, column, post, state.after_share)
        # The rule that depends on the weights comes first: both then change those of before.
        if state.oja:
            rates, forgets = learn * state.rates, state.oja_rate * learn * state.beta
            oja_step(state.weights, state.before, state.after, rates, forgets)
        if state.bcm:
            rows, column = state.theta_a, state.theta_b
            trace(state.theta, state.theta_traced, rows, column, post, state.theta_share)
            rates = learn * state.bcm_rates
            bcm_step(state.weights, state.before, state.after, state.theta, rates)


def _wrong_delays(drawn: FloatArray, longest: float) -> list[tuple[str, str]]:
    """What is wrong with delays (s)."""
    if not math.isfinite(longest) or longest > LONGEST:
        message = f"expected delays up to {LONGEST:g} s, so that their currents can be kept"
        return [("delay", f"{message}, got a largest one of {longest:g}")]
    if drawn.min() < 0.0:
        return [("delay", f"expected delays of 0 or more, got {drawn.min():g}")]
    return []
