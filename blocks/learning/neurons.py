"""Ensembles of neurons that learn online by PES, spiking and not (paper, section III-D)."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import final

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    ParameterError,
    Spikes,
    State,
    kernel_of,
    param,
    portable,
)
from blocks.core.portable import flush, flush_due
from blocks.learning.learner import Learner, decode, dot, gain_and_bias, lif_rate, pes

SILENT = 10.0  # Hz; activity below it hardly counts in a normalised step


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
        state.pass_on = -math.expm1(-state.dt / self.tau_syn)
        state.gamma = self.learning_rate * state.dt / n
        state.floor = SILENT**2 * n
        state.fade = 1.0 - state.pass_on
        state.scratch, state.products = np.zeros(n), np.zeros_like(state.weights)
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
        power = dot(state.activity, state.activity)
        return self.learning_rate * state.dt / (power + float(state.floor))

    def output(self, state: BlockState, t: float) -> FloatArray:
        return decode(state.weights, state.activity, self.limit)

    def update(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        current = state.current
        np.multiply(state.encoder_rows[0], input[0, ...], out=current)
        for j in state.further:
            np.multiply(state.encoder_rows[j], input[j, ...], out=state.scratch)
            current += state.scratch
        current += state.offset
        self._respond(state)
        gamma, keep = self._gamma(state) * learn, self.keep_of(state, error)
        pes(state.weights, state.activity, error, gamma, keep, state.products)
        if flush_due(t, state.dt):
            self._flush(state)

    @kernel_of(update)
    def _update_kernel(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        current, offset = state.current, state.offset
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
        gamma, keep = self._gamma(state) * learn, self.keep_of(state, error)
        pes(state.weights, state.activity, error, gamma, keep, state.products)
        if flush_due(t, state.dt):
            self._flush(state)

    def _flush(self, state: BlockState) -> None:
        flush(state.activity)
        flush(state.weights)

    @abstractmethod
    def _respond(self, state: BlockState) -> None:
        """Advance neurons and synapses by one step: ``current`` in, ``activity`` out."""


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
        doc="initial voltages, in place of drawn ones",
    )

    membrane = State("neurons", name="voltage", doc="membrane voltage, threshold 1")
    refractory = State("neurons", unit="s", doc="refractory time left")
    spikes = State(
        "neurons", event=True, signal=Spikes("neurons"), unit="1/s", doc="spikes, 1/dt each"
    )

    def validate_in(self, context: BlockContext) -> None:
        problems = []
        if context.dt > self.tau_ref:
            message = (
                f"a step of {context.dt:g} s is longer than tau_ref = {self.tau_ref:g} s and would "
                "lose spikes; give the block a smaller dt"
            )
            problems.append(("tau_ref", message))
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
        state.height = 1.0 / state.dt
        state.kick = state.pass_on * state.height
        state.silence = self.tau_ref + state.dt
        state.step, state.decay = np.full(n, state.dt), np.full(n, -self.tau_rc)
        state.zeros, state.ones, state.fades = np.zeros(n), np.ones(n), np.full(n, state.fade)
        scalars = (0.0, 1.0, self.tau_rc, state.silence, state.height, state.kick)
        state.scalars = tuple(map(np.array, scalars))
        state.rise, state.few = np.zeros(n), np.zeros(n, dtype=np.int64)

    def _respond(self, state: BlockState) -> None:
        """LIF neurons and their synapses.

        Constants are arrays, some without axes, and results are written in place: with a hundred
        neurons numpy's overhead for a number as operand costs as much as the arithmetic.
        """
        zero, one, tau_rc, silence, height, kick = state.scalars
        current, voltage, refractory = state.current, state.voltage, state.refractory
        awake, step = state.scratch, state.step
        refractory -= step
        np.subtract(step, refractory, out=awake)
        np.maximum(awake, state.zeros, out=awake)
        np.minimum(awake, step, out=awake)
        awake /= state.decay
        portable.expm1(awake, out=awake)
        np.subtract(current, voltage, out=state.rise)
        awake *= state.rise
        voltage -= awake
        spiking = (voltage > state.ones).nonzero()[0]
        # The spike lies inside the step: the rest of the step counts to the refractory time.
        drive = current[spiking]
        drive -= one
        since = voltage[spiking]
        np.subtract(one, since, out=since)
        since /= drive
        portable.log1p(since, out=since)
        since *= tau_rc
        since += silence
        refractory[spiking] = since
        np.maximum(voltage, state.zeros, out=voltage)
        voltage[spiking] = zero
        state.spikes.fill(0.0)
        state.spikes[spiking] = height
        activity = state.activity
        activity *= state.fades
        activity[spiking] += kick

    def _flush(self, state: BlockState) -> None:
        flush(state.voltage)
        flush(state.activity)
        flush(state.weights)

    # Its start extends that of LearningEnsemble without changing what this kernel depends on.
    _update_kernel = kernel_of(LearningEnsemble.update)(LearningEnsemble._update_kernel)

    @kernel_of(_respond)
    def _respond_kernel(self, state: BlockState) -> None:
        voltage, refractory, activity = state.voltage, state.refractory, state.activity
        current, dt = state.current, state.dt
        # First, without a branch, the common cases: awake or refractory for the whole step.
        full = math.expm1(-dt / self.tau_rc)
        for i in range(len(voltage)):
            refractory[i] -= dt
            rise = full if refractory[i] <= 0.0 else 0.0
            voltage[i] = max(voltage[i] - (current[i] - voltage[i]) * rise, 0.0)
            activity[i] *= state.fade
            state.spikes[i] = 0.0
        # Then the few that wake up or spike in it: marked, then listed, also without a branch.
        few, count = state.few, 0
        for i in range(len(voltage)):
            few[i] = (voltage[i] > 1.0) | ((refractory[i] > 0.0) & (refractory[i] < dt))
        for i in range(len(voltage)):
            marked = few[i]
            few[count] = i
            count += marked
        for i in few[:count]:
            left = refractory[i]
            if 0.0 < left < dt:
                rise = math.expm1(-(dt - left) / self.tau_rc)
                voltage[i] = max(voltage[i] - (current[i] - voltage[i]) * rise, 0.0)
            if voltage[i] > 1.0:
                since = math.log1p((1.0 - voltage[i]) / (current[i] - 1.0))
                refractory[i] = state.silence + self.tau_rc * since
                voltage[i] = 0.0
                state.spikes[i] = state.height
                activity[i] += state.kick


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
        np.copyto(state.rates, lif_rate(state.current, self.tau_rc, self.tau_ref))
        np.subtract(state.rates, state.activity, out=state.scratch)
        state.scratch *= state.pass_on
        state.activity += state.scratch

    @kernel_of(_respond)
    def _respond_kernel(self, state: BlockState) -> None:
        for i in range(len(state.rates)):
            above = state.current[i] - 1.0
            rate = 0.0
            if above > 0.0:
                rate = 1.0 / (self.tau_ref + self.tau_rc * math.log1p(1.0 / above))
            state.rates[i] = rate
            state.activity[i] += state.pass_on * (rate - state.activity[i])
