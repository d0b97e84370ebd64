"""What ensembles that learn online have in common: encoding, synapse, decoding and the PES rule."""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    ParameterError,
    State,
    kernel_of,
    param,
)
from blocks.learning.learner import Learner
from blocks.learning.lif import gain_and_bias


class LearningEnsemble(Learner):
    """A population whose decoders learn by PES; which neurons it is made of, a subclass says.

        input, error, learn ─▶ [ LearningEnsemble ] ─▶ output

    Encoding  J = gain * (encoders @ input) / radius + bias
    Decoding  output = W s, each component within +-limit
    PES       W(t_k+1) = exp(-leak dt) W(t_k) - (kappa dt / neurons) error(t_k) s'

    A subclass turns J into the post-synaptic current s (:meth:`_respond`). What is drawn comes
    from the run's seed and the block's name, in one order for all subclasses, so that one kind
    of neuron can take another's place.
    """

    neurons: int = param(100, at_least=1, doc="number of neurons")
    tau_syn: float = param(0.01, unit="s", above=0.0, doc="time constant of the synapse")
    radius: float = param(1.0, above=0.0, doc="largest input that is represented well")
    gain: FloatArray | None = param(None, shape=("neurons",), doc="gains, in place of drawn ones")
    bias: FloatArray | None = param(None, shape=("neurons",), doc="biases, in place of drawn ones")
    encoders: FloatArray | None = param(
        None, shape=[("neurons",), ("neurons", None)], doc="encoders, in place of drawn ones"
    )

    current = State("neurons", doc="input current J")
    activity = State("neurons", unit="1/s", doc="post-synaptic current s")
    weights = State("k", "neurons", doc="decoding weights W")
    scaled_encoders = State("neurons", "d", doc="gain * encoders / radius")
    offset = State("neurons", doc="bias current")

    def validate(self) -> None:
        problems = []
        if (self.gain is None) != (self.bias is None):
            missing = "bias" if self.bias is None else "gain"
            problems.append((missing, "gain and bias go together; give both or neither"))
        try:
            super().validate()
        except ParameterError as error:
            problems += error.problems
        if problems:
            raise ParameterError(problems)

    def validate_in(self, context: BlockContext) -> None:
        d = context.types["input"].shape[0]
        if self.encoders is not None and self.encoders.size != self.neurons * d:
            message = f"expected {self.neurons}x{d} numbers for the input that is wired"
            message = f"{message}, got an array of shape {self.encoders.shape}"
            raise ParameterError([("encoders", message)])

    def start(self, state: BlockState) -> None:
        n, d = state.scaled_encoders.shape
        # Always drawn, in this order, so that fixing one quantity leaves the others as they were.
        low, high = self.max_rates.tolist()
        rates = state.rng.uniform(low, high, n)
        low, high = self.intercepts.tolist()
        intercepts = state.rng.uniform(low, high, n)
        directions = state.rng.standard_normal((n, d))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)

        gain, bias = gain_and_bias(rates, intercepts, self.tau_rc, self.tau_ref)
        gain = gain if self.gain is None else self.gain
        encoders = directions if self.encoders is None else self.encoders.reshape(n, d)
        state.scaled_encoders[:] = gain[:, None] * encoders / self.radius
        state.offset[:] = bias if self.bias is None else self.bias
        state.is_limited = math.isfinite(self.limit)
        state.pass_on = -math.expm1(-state.dt / self.tau_syn)
        state.keep = math.exp(-self.leak * state.dt)
        state.gamma = self.learning_rate * state.dt / n
        state.fade = 1.0 - state.pass_on
        state.scratch, state.rows = np.empty(n), tuple(state.weights)
        state.encoder_rows = np.ascontiguousarray(state.scaled_encoders.T)
        state.further = range(1, d)

    def watch(self, state: BlockState) -> float:
        """The size of the weights."""
        return float(np.linalg.norm(state.weights))

    def gain_of_a_step(self, state: BlockState) -> float:
        """gamma times the squared size of the activity."""
        return float(state.gamma * np.square(state.activity).sum())

    def output(self, state: BlockState, t: float) -> FloatArray:
        # Not by BLAS, which adds up in another order on another processor.
        decoded: FloatArray = np.add.reduce(state.weights * state.activity, 1)
        return decoded.clip(-self.limit, self.limit) if state.is_limited else decoded

    def update(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        current = state.current
        np.multiply(state.encoder_rows[0], input[0], out=current)
        for j in state.further:
            np.multiply(state.encoder_rows[j], input[j], out=state.scratch)
            current += state.scratch
        current += state.offset
        self._respond(state)
        activity, scratch = state.activity, state.scratch
        if state.keep != 1.0:
            state.weights *= state.keep
        gamma = state.gamma * learn
        for row, slope in zip(state.rows, error.tolist(), strict=True):
            np.multiply(activity, gamma * slope, out=scratch)
            np.subtract(row, scratch, out=row)

    @kernel_of(output)
    def _output_kernel(self, state: BlockState, t: float) -> FloatArray:
        weights, activity = state.weights, state.activity
        decoded = np.empty(len(weights))
        for row in range(len(weights)):
            total = dot(weights[row], activity)
            decoded[row] = min(max(total, -self.limit), self.limit) if state.is_limited else total
        return decoded

    @kernel_of(update)
    def _update_kernel(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        current, activity, offset = state.current, state.activity, state.offset
        first = state.encoder_rows[0]
        for i in range(len(current)):
            current[i] = first[i] * input[0]
        for j in range(1, len(input)):
            encoder = state.encoder_rows[j]
            for i in range(len(current)):
                current[i] += encoder[i] * input[j]
        for i in range(len(current)):
            current[i] += offset[i]
        self._respond(state)
        for row in range(len(error)):
            weights = state.weights[row]
            slope = state.gamma * learn * error[row]
            for i in range(len(weights)):
                weights[i] = state.keep * weights[i] - slope * activity[i]

    @abstractmethod
    def _respond(self, state: BlockState) -> None:
        """Advance neurons and synapses by one step: ``current`` in, ``activity`` out."""


def dot(a: FloatArray, b: FloatArray) -> float:
    """The inner product of two vectors (n,), added up in one order on every machine.

    Four sums that do not wait for each other.
    """
    s0 = s1 = s2 = s3 = 0.0
    last = len(a) - len(a) % 4
    for i in range(0, last, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    for i in range(last, len(a)):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)
