"""Neurons that learn online with the PES rule, spiking and not (paper, section III-D)."""

from __future__ import annotations

import math
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
from blocks.learning.ensemble import LearningEnsemble
from blocks.learning.lif import lif_rate


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
    ``activity`` what the output of tick k was made of.

    The drawn quantities come from the run's seed and the block's name; ``gain`` with ``bias``,
    ``encoders`` and ``voltage`` put arrays in their place.
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
        state.zeros, state.ones = np.zeros(n), np.ones(n)
        state.rise, state.few = np.empty(n), np.empty(n, dtype=np.int64)

    def _respond(self, state: BlockState) -> None:
        """LIF neurons and their synapses.

        Constants are arrays and results go where they are needed: with a hundred neurons, what
        numpy spends on a number beside an array is as much as the arithmetic.
        """
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
        drive -= 1.0
        since = voltage[spiking]
        np.subtract(1.0, since, out=since)
        since /= drive
        portable.log1p(since, out=since)
        since *= self.tau_rc
        since += state.silence
        refractory[spiking] = since
        np.maximum(voltage, state.zeros, out=voltage)
        voltage[spiking] = 0.0
        state.spikes.fill(0.0)
        state.spikes[spiking] = state.height
        activity = state.activity
        activity *= state.fade
        activity[spiking] += state.kick

    # Its start adds to that of LearningEnsemble, and leaves what this relies on as it is.
    _update_kernel = kernel_of(LearningEnsemble.update)(LearningEnsemble._update_kernel)

    @kernel_of(_respond)
    def _respond_kernel(self, state: BlockState) -> None:
        voltage, refractory, activity = state.voltage, state.refractory, state.activity
        current, dt = state.current, state.dt
        # First what most neurons do, without a branch: to be awake, or asleep, for the whole step.
        full = math.expm1(-dt / self.tau_rc)
        for i in range(len(voltage)):
            refractory[i] -= dt
            rise = full if refractory[i] <= 0.0 else 0.0
            voltage[i] = max(voltage[i] - (current[i] - voltage[i]) * rise, 0.0)
            activity[i] *= state.fade
            state.spikes[i] = 0.0
        # Then the few that wake up or spike in it, listed without a branch, too.
        few, count = state.few, 0
        for i in range(len(voltage)):
            few[count] = i
            count += (voltage[i] > 1.0) | ((refractory[i] > 0.0) & (refractory[i] < dt))
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
    """The network of an AdaptiveEnsemble with neurons that give their rate in place of spikes.

        input, error ─▶ [ RateEnsemble ] ─▶ output

    Encoding  J = gain * (encoders @ input) / radius + bias
    Neurons   LIF's steady rate: r = 1 / (tau_ref + tau_rc log1p(1 / (J - 1))) above J = 1, else 0
    Synapse   s += (1 - exp(-dt / tau_syn)) (r - s)
    Decoding  output = W s, each component within +-limit
    PES       W(t_k+1) = exp(-leak dt) W(t_k) - (kappa dt / neurons) error(t_k) s'

    Put in the place of an AdaptiveEnsemble, under its name, it has the same gains, biases and
    encoders, and what differs between the two runs is what spikes do. The equations are Nengo's
    LIFRate with PES, and a test holds the two equal. Rates have no phase to lose, so any step
    will do. The output depends on the state alone, so the block breaks loops.
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
