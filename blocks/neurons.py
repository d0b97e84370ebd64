"""Spiking neurons that learn online: LIF ensembles with the PES rule (paper, section III-D)."""

from __future__ import annotations

import math

import numpy as np

from blocks.block import Block, BlockState, Input, Output, Setting, State
from blocks.params import ParameterError, param
from blocks.signals import FloatArray, Scalar, Spikes, Vector


def gain_and_bias(
    max_rates: FloatArray, intercepts: FloatArray, tau_rc: float, tau_ref: float
) -> tuple[FloatArray, FloatArray]:
    """Gain and bias of LIF neurons that start to fire at ``intercepts`` and reach ``max_rates``.

    z = 1 / (1 - exp((tau_ref - 1/rate) / tau_rc)); gain = (1 - z) / (intercept - 1);
    bias = 1 - gain * intercept. Rates in Hz, times in seconds.
    """
    z = 1.0 / (1.0 - np.exp((tau_ref - 1.0 / max_rates) / tau_rc))
    gain = (1.0 - z) / (intercepts - 1.0)
    return gain, 1.0 - gain * intercepts


def lif_rate(current: FloatArray, tau_rc: float, tau_ref: float) -> FloatArray:
    """Steady firing rate (Hz) of a LIF neuron: 1 / (tau_ref + tau_rc log1p(1 / (J - 1)))."""
    above = np.maximum(current - 1.0, 1e-300)
    return np.where(current > 1.0, 1.0 / (tau_ref + tau_rc * np.log1p(1.0 / above)), 0.0)


class AdaptiveEnsemble(Block):
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

    x = Input(Vector("d"), name="input", doc="what the neurons represent, the paper's a")
    error = Input(Vector("k"), doc="what PES descends; positive lowers the output")
    learn = Input(Scalar, absent=1.0, doc="factor on the error: 0 pauses learning")

    decoded = Output(Vector("k"), name="output", doc="W s")

    neurons: int = param(100, at_least=1, doc="number of neurons")
    learning_rate: float = param(1e-4, at_least=0.0, doc="kappa of PES, as Nengo scales it")
    leak: float = param(0.0, unit="1/s", at_least=0.0, doc="rate at which weights decay")
    tau_rc: float = param(0.02, unit="s", above=0.0, doc="membrane time constant")
    tau_ref: float = param(0.002, unit="s", above=0.0, doc="refractory time; at least dt")
    tau_syn: float = param(0.01, unit="s", above=0.0, doc="time constant of the synapse")
    max_rates: FloatArray = param(
        (200.0, 400.0), unit="Hz", above=0.0, shape=(2,), doc="range of the rates at input = radius"
    )
    intercepts: FloatArray = param(
        (-1.0, 0.9), below=1.0, shape=(2,), doc="range of the inputs where firing sets in"
    )
    limit: float = param(
        math.inf, above=0.0, finite=False, doc="largest size of each component of the output"
    )
    radius: float = param(1.0, above=0.0, doc="largest input that is represented well")
    gain: FloatArray | None = param(None, shape=("neurons",), doc="gains, in place of drawn ones")
    bias: FloatArray | None = param(None, shape=("neurons",), doc="biases, in place of drawn ones")
    encoders: FloatArray | None = param(
        None, shape=[("neurons",), ("neurons", None)], doc="encoders, in place of drawn ones"
    )
    voltage: FloatArray | None = param(
        None,
        at_least=0.0,
        at_most=1.0,
        shape=("neurons",),
        doc="initial voltages, in place of drawn ones",
    )

    membrane = State("neurons", name="voltage", doc="membrane voltage, threshold 1")
    refractory = State("neurons", unit="s", doc="refractory time left")
    current = State("neurons", doc="input current J")
    spikes = State(
        "neurons", event=True, signal=Spikes("neurons"), unit="1/s", doc="spikes, 1/dt each"
    )
    activity = State("neurons", unit="1/s", doc="post-synaptic current s")
    weights = State("k", "neurons", doc="decoding weights W")
    scaled_encoders = State("neurons", "d", doc="gain * encoders / radius")
    offset = State("neurons", doc="bias current")

    def validate(self) -> None:
        problems = []
        if (self.gain is None) != (self.bias is None):
            missing = "bias" if self.bias is None else "gain"
            problems.append((missing, "gain and bias go together; give both or neither"))
        for name in ("max_rates", "intercepts"):
            low, high = self.value(name)
            if low > high:
                problems.append((name, f"expected [low, high], got [{low:g}, {high:g}]"))
        fastest = 1.0 / self.tau_ref
        if self.max_rates[1] >= fastest:
            said = f"a refractory time of {self.tau_ref:g} s allows less than {fastest:g} Hz"
            problems.append(("max_rates", said))
        if problems:
            raise ParameterError(problems)

    def validate_in(self, setting: Setting) -> None:
        problems = []
        if setting.dt > self.tau_ref:
            said = (
                f"a step of {setting.dt:g} s is longer than tau_ref = {self.tau_ref:g} s and would "
                "lose spikes; give the block a smaller dt"
            )
            problems.append(("tau_ref", said))
        d = setting.types["input"].shape[0]
        if self.encoders is not None and self.encoders.size != self.neurons * d:
            said = f"expected {self.neurons}x{d} numbers for the input that is wired"
            problems.append(("encoders", f"{said}, got an array of shape {self.encoders.shape}"))
        if problems:
            raise ParameterError(problems)

    def start(self, state: BlockState) -> None:
        n, d = state.scaled_encoders.shape
        # Always drawn, in this order, so that fixing one quantity leaves the others as they were.
        low, high = self.max_rates.tolist()
        rates = state.rng.uniform(low, high, n)
        low, high = self.intercepts.tolist()
        intercepts = state.rng.uniform(low, high, n)
        directions = state.rng.standard_normal((n, d))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        voltage = state.rng.uniform(0.0, 1.0, n)

        gain, bias = gain_and_bias(rates, intercepts, self.tau_rc, self.tau_ref)
        gain = gain if self.gain is None else self.gain
        encoders = directions if self.encoders is None else self.encoders.reshape(n, d)
        state.scaled_encoders[:] = gain[:, None] * encoders / self.radius
        state.offset[:] = bias if self.bias is None else self.bias
        state.voltage[:] = voltage if self.voltage is None else self.voltage
        state.height = 1.0 / state.dt
        state.is_limited = math.isfinite(self.limit)
        state.pass_on = -math.expm1(-state.dt / self.tau_syn)
        state.kick = state.pass_on * state.height
        state.keep = math.exp(-self.leak * state.dt)
        state.gamma = self.learning_rate * state.dt / n
        state.step, state.decay = np.full(n, state.dt), np.full(n, -self.tau_rc)
        state.zeros, state.ones = np.zeros(n), np.ones(n)
        state.rise, state.scratch = np.empty(n), np.empty(n)

    def output(self, state: BlockState, t: float) -> FloatArray:
        decoded: FloatArray = state.weights.dot(state.activity)
        return decoded.clip(-self.limit, self.limit) if state.is_limited else decoded

    def update(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        spiking = self._fire(state, input)
        activity, scratch = state.activity, state.scratch
        np.multiply(activity, state.pass_on, out=scratch)
        activity -= scratch
        activity[spiking] += state.kick
        if state.keep != 1.0:
            state.weights *= state.keep
        for row, slope in enumerate((state.gamma * learn * error).tolist()):
            np.multiply(activity, slope, out=scratch)
            state.weights[row] -= scratch

    def _fire(self, state: BlockState, x: FloatArray) -> FloatArray:
        """Advance the neurons by one step; returns the indices of those that spiked.

        Constants are arrays and results go where they are needed: with a hundred neurons, what
        numpy spends on a number beside an array is as much as the arithmetic.
        """
        current, voltage, refractory = state.current, state.voltage, state.refractory
        awake, step = state.scratch, state.step
        np.dot(state.scaled_encoders, x, out=current)
        current += state.offset
        refractory -= step
        np.subtract(step, refractory, out=awake)
        np.maximum(awake, state.zeros, out=awake)
        np.minimum(awake, step, out=awake)
        awake /= state.decay
        np.expm1(awake, out=awake)
        np.subtract(current, voltage, out=state.rise)
        awake *= state.rise
        voltage -= awake
        spiking: FloatArray = (voltage > state.ones).nonzero()[0]
        # The spike lies inside the step: the rest of the step counts to the refractory time.
        over = voltage[spiking]
        over -= 1.0
        drive = current[spiking]
        drive -= 1.0
        over /= drive
        since = np.log1p(np.negative(over, out=over), out=over)
        since *= self.tau_rc
        since += state.dt
        since += self.tau_ref
        refractory[spiking] = since
        np.maximum(voltage, state.zeros, out=voltage)
        voltage[spiking] = 0.0
        state.spikes.fill(0.0)
        state.spikes[spiking] = state.height
        return spiking
