"""Decoders: from the spikes of an ensemble to a function of what it represents.

Spikes (n,) and an error (k,) go in, the value (k,) comes out::

    square: {type: Decoder, function: "x**2", synapse: 0.02, learning: {rule: pes}}
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any, final

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    ParameterError,
    Scalar,
    SettingError,
    State,
    Vector,
    kernel_of,
    param,
)
from blocks.core.portable import flush, flush_due
from blocks.neural.ensemble import Ensemble
from blocks.neural.models import Direct
from blocks.neural.published_tuning import Tuning
from blocks.neural.rules import (
    DecoderRule,
    follow,
    pes_each,
    pes_step,
    rls_step,
    share_of_spikes,
    trace,
    trace_matrices,
    trace_order,
)
from blocks.neural.solving import Solved, decode, decode_each
from blocks.neural.synapses import Synapse, passed, remember


@final
class Decoder(Solved):
    """Decode a function of what an ensemble represents from its spikes, and learn it online.

        spikes, error, learn ─▶ [ Decoder ] ─▶ value

    Decoding  value = h * (W spikes), h the synapse
    Weights   W from the solver: decoders of the tuning curves, A D = f(points), times transform
    Learning  pes: W -= (kappa dt / n) learn error s';  rls: recursive least squares;
              s the spikes through the rule's tau

    The weights follow from the tuning of the ensemble whose spikes are wired here, on points drawn
    evenly within its radius, unless ``weights`` are given. The synapse is discretised exactly for
    an input that holds: with a lowpass, s += (1 - exp(-dt / tau)) (W spikes - s). Spikes between
    t_k-1 and t_k are in the value at t_k. All of it is Nengo's arithmetic, tick by tick. With
    ``filter: spikes``, the synapse is before the weights, and its output is what the rule sees:
    an AdaptiveEnsemble is such a pair of Ensemble and Decoder.
    """

    error = Input(Vector("k"), variadic=True, doc="what to reduce, with ``learning``; wires add up")
    learn = Input(Scalar, default=1.0, doc="factor on the learning rate: 0 pauses learning")

    synapse: Synapse = param(0.005, unit="s", doc="filter of the value")
    filter: str = param("value", choices=("value", "spikes"), doc="what the synapse filters")
    learning: DecoderRule | None = param(None, doc="rule by which the weights learn")

    filtered = State("order", "k", doc="the synapse's states")
    activity = State("active", unit="1/s", doc="filtered spikes s")
    traced = State("trace_order", "active", doc="the states of the rule's filter")
    pending = State("errors", doc="learn times the error of the last tick")
    inverse = State("squared", "squared", doc="P of recursive least squares")

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        order = self.synapse.order_at(context.dt) if self.filter == "value" else 0
        traced = 0
        if self.learning is not None and self.filter == "value":
            traced = trace_order(self.learning.tau, context.dt)
        return {**self.sizes(), "order": order, "trace_order": traced}

    def infer(self, lengths: Mapping[str, int]) -> Mapping[str, int]:
        inferred = dict(super().infer(lengths))
        known = {**lengths, **inferred}
        learns = self.learning is not None
        if "n" in known:
            inferred["active"] = known["n"] if learns or self.filter == "spikes" else 0
            inferred["squared"] = known["n"] if learns and self._rule == "rls" else 0
        if "k" in known:
            inferred["errors"] = known["k"] if learns else 0
        return inferred

    @property
    def _rule(self) -> str:
        return "" if self.learning is None else self.learning.label

    def validate(self) -> None:
        super().validate()
        if self.filter == "spikes" and self.synapse.order != 1:
            message = f"expected a lowpass for 'filter: spikes', got {self.synapse!r}"
            raise ParameterError([("synapse", message)])

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        wires = len(context.terms["error"])
        if wires and self.learning is None:
            message = "'error' is wired but nothing learns; add {rule: pes} or remove the wire"
            raise ParameterError([("learning", message)])
        if self.learning is not None and not wires:
            message = f"{self._rule} learns from an error, and the input 'error' is not connected"
            raise ParameterError([("learning", message)])
        if self.learning is not None and self.groups_out(context.lengths) < context.lengths.get(
            "groups", 1
        ):
            message = (
                "a matrix that mixes groups does not learn; let the Decoder learn, and a Gain mix"
            )
            raise ParameterError([("transform", message)])
        source = context.published.get("spikes")
        if isinstance(source, Ensemble) and source.direct and self.weights_given is None:
            self._validate_exact(context.lengths["d"] // context.lengths["groups"])
        # P would be block-diagonal, one n x n block per group, and is declared as one matrix.
        if self._rule == "rls" and context.lengths.get("groups", 1) > 1:
            raise ParameterError([("learning", "rls does not learn in groups; use pes")])

    def _validate_exact(self, d: int) -> None:
        """Whether the value can be computed without neurons."""
        if self.learning is not None:
            message = "there are no neurons (Direct) whose decoders could be learnt"
            raise ParameterError([("learning", message)])
        if self.filter == "spikes":
            raise ParameterError([("filter", "there are no spikes (Direct); filter the value")])
        try:
            if self.function is not None:
                self.function.exact(d, self._own_names)
        except SettingError as error:
            raise ParameterError([("function", error.problems[0][1])]) from None

    def start(self, state: BlockState) -> None:
        a, b = self.synapse.matrices(state.dt)
        state.a, state.b = a, b
        state.groups, state.error, state.exact = 1, math.nan, False
        state.rule, state.by_spikes = self._rule, self.filter == "spikes"
        source = state.published.get("spikes")
        state.ahead = isinstance(source, Tuning) and source.ahead
        if self.weights_given is not None:
            state.weights[...], state.groups = self.weights_given, self.groups_given
        else:
            tuning: Tuning = state.published["spikes"]
            state.groups = self.groups_out(state.context.lengths)
            state.exact = isinstance(tuning.neuron, Direct)
            if not state.exact:
                state.weights[...], state.error = self.solve(state.rng, tuning)
            if state.exact:
                self._start_exact(state, tuning)
        state.gamma = state.quick = 0.0
        state.trace_a, state.trace_b = np.zeros((0, 0)), np.zeros(0)
        if self.learning is not None:
            n = state.weights.shape[1] // state.groups
            state.gamma = self.learning.learning_rate * state.dt / n
            state.quick = (
                float(b[0]) if state.by_spikes else share_of_spikes(self.learning.tau, state.dt)
            )
            if not state.by_spikes:
                state.trace_a, state.trace_b = trace_matrices(self.learning.tau, state.dt)
            if self._rule == "rls":
                # The first step is then that of PES.
                np.fill_diagonal(state.inverse, state.gamma)
        elif state.by_spikes:
            state.quick = float(b[0])

    def _start_exact(self, state: BlockState, tuning: Tuning) -> None:
        d = tuning.dimensions
        inside, matrix = self._components(d), self.transform
        state.d, state.inside, state.takes = d, inside, "itself"
        if self.function is not None:
            state.evaluate, of_number = self.function.exact(d, self._own_names)
            state.takes = "number" if of_number else "vector"
        if matrix is None or matrix.ndim == 0:
            matrix = np.eye(inside) * (1.0 if matrix is None else matrix)
        state.matrix = matrix.copy()
        state.mixes = state.groups < tuning.groups

    def stack_key(self, context: BlockContext) -> Hashable:
        source = context.published.get("spikes")
        if isinstance(source, Ensemble) and source.direct:
            return None
        groups = self.groups_out(context.lengths)
        rule = self.learning
        # Learning in groups, and P of recursive least squares, stay with each block.
        if rule is not None and (self._rule != "pes" or groups > 1 or rule.tau.order > 1):
            return None
        if self.filter == "spikes" and groups > 1:
            return None
        return self.synapse, self.filter, groups, None if rule is None else rule.tau

    @classmethod
    def stacked(
        cls, blocks: Sequence[Any], states: Sequence[BlockState], arrays: Mapping[str, FloatArray]
    ) -> DecoderStack:
        return DecoderStack(blocks, states, arrays)

    def facts(self, state: BlockState) -> Mapping[str, float]:
        facts = {"synapses": float(state.weights.size)}
        return facts if math.isnan(state.error) else {**facts, "rmse": state.error}

    def output(self, state: BlockState, t: float, spikes: FloatArray) -> FloatArray:
        if state.by_spikes:
            return self._of_filtered(state, spikes)
        return passed(state.filtered, state.a, state.b, self._decoded(state, spikes))

    def _decoded(self, state: BlockState, spikes: FloatArray) -> FloatArray:
        """The value before the synapse."""
        if state.exact:
            return self._exactly(state, spikes)
        return decode(state.weights, spikes, state.groups)

    def _exactly(self, state: BlockState, x: FloatArray) -> FloatArray:
        """The function of what an ensemble without neurons holds, times transform."""
        d, inside, rows = state.d, state.inside, len(state.matrix)
        out, values = np.zeros(state.groups * rows), np.zeros(inside)
        for group in range(len(x) // d):
            start = group * d
            if state.takes == "itself":
                for j in range(inside):
                    values[j] = x[start + j]
            elif state.takes == "number":
                values[:] = state.evaluate(x[start])
            else:
                values[:] = state.evaluate(x[start : start + d])
            # A matrix over all groups has columns of its own for each.
            column = group * inside if state.mixes else 0
            first = 0 if state.mixes else group * rows
            for row in range(rows):
                for j in range(inside):
                    out[first + row] += state.matrix[row, column + j] * values[j]
        return out

    def _of_filtered(self, state: BlockState, spikes: FloatArray) -> FloatArray:
        """The value W s of filtered spikes, W with what the last error teaches."""
        activity = state.activity + state.quick * (spikes - state.activity)
        value = decode(state.weights, activity, state.groups)
        if state.rule == "pes":
            # The last error is applied by `update` only, after this output. (W - g e s') s is
            # W s - g e |s|^2, so it counts here without writing the weights: outputs write nothing.
            squares = decode(activity[None], activity, state.groups)
            value = value - state.gamma * state.pending * np.repeat(
                squares, len(value) // len(squares)
            )
        return value

    @kernel_of(_of_filtered)
    def _of_filtered_kernel(self, state: BlockState, spikes: FloatArray) -> FloatArray:
        activity = state.activity.copy()
        follow(activity, spikes, state.quick)
        value = decode(state.weights, activity, state.groups)
        if state.rule == "pes":
            rows = len(value) // state.groups
            each = len(activity) // state.groups
            for group in range(state.groups):
                square = 0.0
                for i in range(group * each, (group + 1) * each):
                    square += activity[i] * activity[i]
                for row in range(group * rows, (group + 1) * rows):
                    value[row] -= state.gamma * state.pending[row] * square
        return value

    def update(
        self,
        state: BlockState,
        t: float,
        spikes: FloatArray,
        error: tuple[FloatArray, ...],
        learn: float,
        value: FloatArray,
    ) -> None:
        if not state.by_spikes and len(state.b) > 0:
            # A filter of the first order needs its input no more.
            decoded = value if len(state.b) == 1 else self._decoded(state, spikes)
            remember(state.filtered, state.a, state.b, decoded, value)
        if state.rule != "" or state.by_spikes:
            rows, column = state.trace_a, state.trace_b
            trace(state.activity, state.traced, rows, column, spikes, state.quick)
        if state.rule != "":
            # Nengo's rules apply the error of a step with its spikes, which arrive on the next
            # tick if they are not those of a FeedthroughEnsemble; a test compares the weights.
            if not state.ahead:
                self._learn(state)
            total = state.pending
            total[:] = 0.0
            if len(error) > 0:
                for term in error:
                    for i in range(len(total)):
                        total[i] += learn * term[i]
            if state.ahead:
                self._learn(state)
                total[:] = 0.0
        if flush_due(t, state.dt):
            flush(state.filtered)
            flush(state.activity)
            if state.rule != "":
                flush(state.traced)
                flush(state.weights)
                flush(state.inverse)

    def _learn(self, state: BlockState) -> None:
        """Apply the error of the last tick, with the spikes that followed from it."""
        if state.rule == "pes":
            pes_step(state.weights, state.activity, state.pending, state.gamma, 1.0, state.groups)
        if state.rule == "rls" and state.gamma > 0.0:
            rls_step(state.weights, state.inverse, state.activity, state.pending)


class DecoderStack:
    """Decoders with equal synapses, and with PES or without learning."""

    def __init__(
        self, blocks: Sequence[Any], states: Sequence[BlockState], arrays: Mapping[str, FloatArray]
    ) -> None:
        first, self.arrays = states[0], arrays
        self.members, self.rows, self.n = arrays["weights"].shape
        self.groups, self.by_spikes, self.learns = first.groups, first.by_spikes, first.rule != ""
        self.a, self.b, self.quick, self.dt = first.a, first.b, first.quick, first.dt
        self.filtered = arrays["filtered"].transpose(1, 0, 2)
        self.gamma = np.array([[state.gamma] for state in states])

    def output(self, t: float, spikes: FloatArray) -> FloatArray:
        weights, spikes = self.arrays["weights"], spikes.reshape(self.members, self.n)
        if not self.by_spikes:
            return passed(self.filtered, self.a, self.b, decode_each(weights, spikes, self.groups))
        activity = self.arrays["activity"]
        activity = activity + self.quick * (spikes - activity)
        value = decode_each(weights, activity, self.groups)
        if self.learns:  # as in Decoder._of_filtered
            squares = decode_each(activity[:, None], activity, self.groups)
            value = value - self.gamma * self.arrays["pending"] * squares
        return value

    def update(
        self,
        t: float,
        spikes: FloatArray,
        error: tuple[FloatArray, ...],
        learn: tuple[float, ...],
        value: FloatArray,
    ) -> None:
        arrays, spikes = self.arrays, spikes.reshape(self.members, self.n)
        if not self.by_spikes and len(self.b) > 0:
            decoded = value = value.reshape(self.members, -1)
            if len(self.b) > 1:
                decoded = decode_each(arrays["weights"], spikes, self.groups)
            remember(self.filtered, self.a, self.b, decoded, value)
        if self.learns or self.by_spikes:
            follow(arrays["activity"], spikes, self.quick)
        if self.learns:
            pending = arrays["pending"]
            scaled = self.gamma * pending
            pes_each(arrays["weights"], arrays["activity"][:, None], scaled[:, :, None])
            pending[:] = 0.0
            factor = np.array(learn)[:, None]
            for term in error:
                pending += factor * term.reshape(self.members, -1)
        if flush_due(t, self.dt):
            for name in ("filtered", "activity", "weights")[: 3 if self.learns else 2]:
                flush(arrays[name])
