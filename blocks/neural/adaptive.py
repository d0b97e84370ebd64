"""Ensembles of neurons that learn online by PES, spiking and not (paper, section III-D).

An input (d,) and an error (k,) go in, what was learnt (k,) comes out. Encoding, neurons, synapse,
decoding and rule are one block: what an Ensemble and a Decoder with ``filter: spikes`` compute in
two, at a third of the calls::

    snn: {type: AdaptiveEnsemble, neurons: 100, learning_rate: 1.0e-4}
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from typing import Any, final

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    ParameterError,
    Spikes,
    State,
    dot,
    kernel_of,
    param,
)
from blocks.core.polynomials import any_order
from blocks.core.portable import flush, flush_due, share_of
from blocks.neural.learner import Learner, decode_activity, gain_and_bias
from blocks.neural.lif import (
    lif_rate_step,
    lif_step,
    lif_steps,
)
from blocks.neural.rules import follow, pes_step, smooth
from blocks.neural.stacks import LearnerStack

# Hz. Without it, a normalised step of neurons that are nearly silent would be unbounded.
SILENT = 10.0


class LearningEnsemble(Learner):
    """A population whose decoders learn by PES; a subclass defines its neurons.

        input, error, learn ─▶ [ LearningEnsemble ] ─▶ output

    Encoding  J = gain * (encoders @ input) / radius + bias
    Decoding  output = W s, each component within +-limit
    PES       W(t_k+1) = keep W(t_k) - gamma error(t_k) s', keep = exp(-(leak + e_leak |error|) dt)

    gamma is kappa dt / neurons or, if ``normalised``, kappa dt / (|s|^2 + neurons (10 Hz)^2): steps
    of normalised LMS (Haykin, Adaptive Filter Theory), with which the output moves by kappa error
    per second whatever the number, the rates and the range of the neurons (somewhat less with
    spikes that the synapse hardly smooths).

    A subclass turns J into the post-synaptic current s (:meth:`_respond`). What is drawn depends
    on the run's seed and the block's name only, in one order for all subclasses, so that one kind
    of neuron can replace another.
    """

    neurons: int = param(100, at_least=1, doc="number of neurons")
    tau_syn: float = param(0.01, unit="s", above=0.0, doc="time constant of the synapse")
    radius: float = param(1.0, above=0.0, doc="largest input that is represented well")
    gain: FloatArray | None = param(None, shape=("neurons",), doc="gains, in place of random ones")
    bias: FloatArray | None = param(None, shape=("neurons",), doc="biases, in place of random ones")
    encoders: FloatArray | None = param(
        None, shape=[("neurons",), ("neurons", None)], doc="encoders, in place of random ones"
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
        # Always drawn, in this order, so that fixing one quantity does not change the others.
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
        state.pass_on = share_of(self.tau_syn, state.dt)
        state.gamma = self.learning_rate * state.dt / n
        state.floor = SILENT**2 * n
        state.fade, state.scratch = 1.0 - state.pass_on, np.zeros(n)
        # What the step of a neuron model takes: its parameters, and a state that LIF does not have.
        state.constants, state.empty = self.model.constants, np.zeros(0)
        # A row per dimension: a step multiplies all neurons by one component of the input.
        state.encoder_rows = np.ascontiguousarray(state.scaled_encoders.T)
        state.further = range(1, d)

    def resume(self, state: BlockState) -> None:
        state.encoder_rows[...] = state.scaled_encoders.T

    def facts(self, state: BlockState) -> Mapping[str, float]:
        synapses = state.scaled_encoders.size + state.weights.size
        return {"neurons": self.neurons, "synapses": synapses}

    def watch(self, state: BlockState) -> float:
        """The norm of the weights."""
        return float(np.linalg.norm(state.weights))

    def gain_of_a_step(self, state: BlockState) -> float:
        """gamma times the squared size of the activity."""
        return self._gamma(state) * float(np.square(state.activity).sum())

    def _gamma(self, state: BlockState) -> float:
        """What multiplies error and activity in a step."""
        if not self.normalised:
            return float(state.gamma)
        power = float(np.square(state.activity).sum())
        return self.learning_rate * state.dt / (power + float(state.floor))

    @kernel_of(_gamma)
    def _gamma_kernel(self, state: BlockState) -> float:
        if not self.normalised:
            return float(state.gamma)
        # NumPy's sum is not in order: four sums here, which differ from it by rounding.
        power = dot(state.activity, state.activity)
        return self.learning_rate * state.dt / (power + float(state.floor))

    def output(self, state: BlockState, t: float) -> FloatArray:
        return decode_activity(state.weights, state.activity, self.limit)

    def update(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        # In place: for a hundred neurons, an array that is allocated costs as much as the product.
        current = state.current
        np.multiply(state.encoder_rows[0], input[0, ...], out=current)
        for j in state.further:
            np.multiply(state.encoder_rows[j], input[j, ...], out=state.scratch)
            current += state.scratch
        current += state.offset
        self._respond(state)
        gamma, keep = self._gamma(state) * learn, self.keep_of(state, error)
        pes_step(state.weights, state.activity, error, gamma, keep)
        if flush_due(t, state.dt):
            self._flush(state)

    @kernel_of(update)
    def _update_kernel(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        current, offset = state.current, state.offset
        add_up(current, state.encoder_rows, input)
        for i in any_order(len(current)):
            current[i] += offset[i]
        self._respond(state)
        gamma, keep = self._gamma(state) * learn, self.keep_of(state, error)
        pes_step(state.weights, state.activity, error, gamma, keep)
        if flush_due(t, state.dt):
            self._flush(state)

    def _flush(self, state: BlockState) -> None:
        flush(state.activity)
        flush(state.weights)

    @abstractmethod
    def _respond(self, state: BlockState) -> None:
        """Advance neurons and synapses by one step: ``current`` in, ``activity`` out."""

    def respond_together(self, each: int, state: Any) -> None:
        """:meth:`_respond` for equal ensembles of ``each`` neurons, whose states are one."""
        self._respond(state)

    def stack_key(self, context: BlockContext) -> Hashable:
        return self.tau_rc, self.tau_ref, self.tau_syn, self.normalised

    @classmethod
    def stacked(
        cls, blocks: Sequence[Any], states: Sequence[BlockState], arrays: Mapping[str, FloatArray]
    ) -> LearnerStack:
        return LearnerStack(blocks, states, arrays)


def add_up(current: FloatArray, rows: FloatArray, input: FloatArray) -> None:
    """current = encoders @ input, the encoders in rows (d, n), in compiled code."""
    first = rows[0]
    for i in any_order(len(current)):
        current[i] = first[i] * input[0]
    for j in range(1, len(input)):
        encoder = rows[j]
        for i in any_order(len(current)):
            current[i] += encoder[i] * input[j]


@final
class AdaptiveEnsemble(LearningEnsemble):
    """A layer of spiking neurons whose decoders learn online from an error signal.

        input, error ─▶ [ AdaptiveEnsemble ] ─▶ output

    Encoding  J = gain * (encoders @ input) / radius + bias
    Neurons   LIF: tau_rc V' = J - V; a spike of area 1 where V passes 1, then silence for tau_ref
    Synapse   s += (1 - exp(-dt / tau_syn)) (r - s)
    Decoding  output = W s, each component within +-limit
    PES       W(t_k+1) = exp(-leak dt) W(t_k) - (kappa dt / neurons) error(t_k) s'

    kappa is ``learning_rate``; the paper's gamma is kappa dt / neurons. PES sees s with the spikes
    of its own tick. The arithmetic, spike times between steps included, is Nengo's, and a test
    holds the two equal spike for spike. The output depends on the state alone, so the block
    breaks loops. Probes: row k of ``spikes`` holds the spikes of tick k, row k of ``weights`` and
    ``activity`` what the output of tick k was computed from.

    The drawn quantities depend on the run's seed and the block's name; ``gain`` with ``bias``,
    ``encoders`` and ``voltage`` replace them.
    """

    voltage: FloatArray | None = param(
        None,
        at_least=0.0,
        at_most=1.0,
        shape=("neurons",),
        doc="initial voltages, in place of random ones",
    )

    membrane = State("neurons", name="voltage", doc="membrane voltage, threshold 1")
    refractory = State("neurons", unit="s", doc="refractory time left")
    spikes = State(
        "neurons", event=True, signal=Spikes("neurons"), unit="1/s", doc="spikes, 1/dt each"
    )

    def validate_in(self, context: BlockContext) -> None:
        problems = []
        too_long = self.model.too_long(context.dt)
        if too_long:
            name = "tau_ref" if context.dt > self.tau_ref else "tau_rc"
            problems.append((name, f"{too_long}; give the block a smaller dt"))
        try:
            super().validate_in(context)
        except ParameterError as error:
            problems += error.problems
        if problems:
            raise ParameterError(problems)

    def start(self, state: BlockState) -> None:
        super().start(state)
        n = self.neurons
        voltage = state.rng.uniform(0.0, 1.0, n)
        state.voltage[:] = voltage if self.voltage is None else self.voltage

    def _respond(self, state: BlockState) -> None:
        lif_step(
            state.dt,
            state.current,
            state.spikes,
            state.voltage,
            state.refractory,
            state.empty,
            state.constants,
        )
        smooth(state.activity, state.spikes, state.fade, state.pass_on)

    def respond_together(self, each: int, state: Any) -> None:
        neurons = (state.current, state.spikes, state.voltage, state.refractory)
        lif_steps(each, state.dt, *neurons, state.constants)
        smooth(state.activity, state.spikes, state.fade, state.pass_on)

    def _flush(self, state: BlockState) -> None:
        flush(state.voltage)
        flush(state.activity)
        flush(state.weights)

    # Its `start` changes nothing that either of the two depends on.
    _update_kernel = LearningEnsemble._update_kernel


@final
class RateEnsemble(LearningEnsemble):
    """The network of an AdaptiveEnsemble with neurons that output rates instead of spikes.

        input, error ─▶ [ RateEnsemble ] ─▶ output

    Encoding  J = gain * (encoders @ input) / radius + bias
    Neurons   LIF's steady rate: r = 1 / (tau_ref + tau_rc log1p(1 / (J - 1))) above J = 1, else 0
    Synapse   s += (1 - exp(-dt / tau_syn)) (r - s)
    Decoding  output = W s, each component within +-limit
    PES       W(t_k+1) = exp(-leak dt) W(t_k) - (kappa dt / neurons) error(t_k) s'

    In place of an AdaptiveEnsemble, under its name, it has the same gains, biases and encoders, so
    that two such runs differ only by the effect of spikes. The equations are Nengo's LIFRate with
    PES, and a test holds the two equal. Any step is valid for rates. The output depends on the
    state alone, so the block breaks loops.
    """

    rates = State("neurons", event=True, unit="1/s", doc="firing rates r")

    def _respond(self, state: BlockState) -> None:
        # A rate has no voltage, no refractory time and no recovery.
        empty, rates = state.empty, state.rates
        lif_rate_step(state.dt, state.current, rates, empty, empty, empty, state.constants)
        follow(state.activity, rates, state.pass_on)
