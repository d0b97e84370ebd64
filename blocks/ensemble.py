"""What ensembles that learn online have in common: encoding, synapse, decoding and the PES rule."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np

from blocks.block import Block, BlockState, Input, Output, Setting, State
from blocks.lif import gain_and_bias
from blocks.params import ParameterError, param
from blocks.signals import FloatArray, Scalar, Vector


class LearningEnsemble(Block, ABC):
    """A population whose decoders learn by PES; which neurons it is made of, a subclass says.

        input, error, learn ─▶ [ LearningEnsemble ] ─▶ output

    Encoding  J = gain * (encoders @ input) / radius + bias
    Decoding  output = W s, each component within +-limit
    PES       W(t_k+1) = exp(-leak dt) W(t_k) - (kappa dt / neurons) error(t_k) s'

    A subclass turns J into the post-synaptic current s (:meth:`_respond`). What is drawn comes
    from the run's seed and the block's name, in one order for all subclasses, so that one kind
    of neuron can take another's place.
    """

    x = Input(Vector("d"), name="input", doc="what the neurons represent, the paper's a")
    error = Input(Vector("k"), doc="what PES descends; positive lowers the output")
    learn = Input(Scalar, absent=1.0, doc="factor on the error: 0 pauses learning")

    decoded = Output(Vector("k"), name="output", doc="W s")

    neurons: int = param(100, at_least=1, doc="number of neurons")
    learning_rate: float = param(1e-4, at_least=0.0, doc="kappa of PES, as Nengo scales it")
    leak: float = param(0.0, unit="1/s", at_least=0.0, doc="rate at which weights decay")
    tau_rc: float = param(0.02, unit="s", above=0.0, doc="membrane time constant")
    tau_ref: float = param(0.002, unit="s", above=0.0, doc="refractory time; spikes: at least dt")
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
        d = setting.types["input"].shape[0]
        if self.encoders is not None and self.encoders.size != self.neurons * d:
            said = f"expected {self.neurons}x{d} numbers for the input that is wired"
            said = f"{said}, got an array of shape {self.encoders.shape}"
            raise ParameterError([("encoders", said)])

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
        state.scratch = np.empty(n)

    def output(self, state: BlockState, t: float) -> FloatArray:
        decoded: FloatArray = state.weights.dot(state.activity)
        return decoded.clip(-self.limit, self.limit) if state.is_limited else decoded

    def update(
        self, state: BlockState, t: float, input: FloatArray, error: FloatArray, learn: float
    ) -> None:
        np.dot(state.scaled_encoders, input, out=state.current)
        state.current += state.offset
        self._respond(state)
        activity, scratch = state.activity, state.scratch
        if state.keep != 1.0:
            state.weights *= state.keep
        for row, slope in enumerate((state.gamma * learn * error).tolist()):
            np.multiply(activity, slope, out=scratch)
            state.weights[row] -= scratch

    @abstractmethod
    def _respond(self, state: BlockState) -> None:
        """Advance neurons and synapses by one step: ``current`` in, ``activity`` out."""
