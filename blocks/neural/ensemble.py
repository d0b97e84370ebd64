"""Populations of neurons that represent a vector: the Neural Engineering Framework's encoding.

Vectors (d,) and currents (n,) go in, the spikes of the last step (n,) come out::

    snn: {type: Ensemble, neurons: 100, radius: 1.5, neuron: {type: LIF, tau_rc: 0.03}}
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

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
    kernel_of,
    param,
)
from blocks.core.portable import flush, flush_due
from blocks.neural.distributions import Distribution
from blocks.neural.drawing import drawn
from blocks.neural.emission import emit_poisson, emit_regular, emit_stochastic
from blocks.neural.models import Direct
from blocks.neural.neurons import NeuronModel
from blocks.neural.published_tuning import Tuning
from blocks.neural.rules import (
    EncoderRule,
    follow,
    share_of_spikes,
    trace,
    trace_matrices,
    trace_order,
    voja_step,
)
from blocks.neural.stacks import EnsembleStack
from blocks.neural.synapses import Synapse, passed, remember

# From this many dimensions, one product is faster than a loop over them.
MANY_DIMENSIONS = 4
# Distributions that both engines draw from in a step; "" are numbers.
NOISES = ("", "normal", "uniform", "exponential")


class Ensemble(Block):
    """A population of neurons that represents a vector by its spikes.

        input, current, learn ─▶ [ Ensemble ] ─▶ spikes

    Encoding  J = gain * (encoders @ x / radius + current) + bias,  x the sum of all inputs
    Noise     J += h * (noise / sqrt(dt)), drawn on every tick for each neuron, h the noise_synapse
    Neurons   the model's step; a spike has an area of 1, rates are in Hz
    Learning  voja: e_i += kappa dt learn s_i (x - e_i), s the spikes through a lowpass

    Spikes at t_k are those between t_k-1 and t_k, so the block breaks loops; with a synapse, what
    a Decoder makes of them is Nengo's, tick by tick. The output publishes the tuning of the
    neurons (gains, biases, encoders, model), by which a Decoder solves for its weights.

    With ``groups``, the dimensions are divided evenly among that many groups of ``neurons`` each:
    an array of ensembles as one block; ``groups: 0`` is one group for each dimension. Gains and
    biases follow from the maximum rates and the intercepts; ``gain`` with ``bias`` replace them.
    What is drawn depends on the run's seed and the block's name only. Equations: Eliasmith and
    Anderson, Neural Engineering, 2003.
    """

    x = Input(Vector("d"), variadic=True, name="input", doc="what to represent; wires add up")
    straight = Input(
        Vector("total"),
        variadic=True,
        fills=True,
        name="current",
        doc="straight into each neuron, or one number into all; wires add up",
    )
    learn = Input(Scalar, default=1.0, doc="factor on the learning rate: 0 pauses learning")

    spikes = Output(
        Spikes("total"),
        publishes="tuning",
        carries=("d", "groups"),
        doc="spikes of the last step, 1/dt each, or rates",
    )

    neurons: int = param(100, at_least=1, doc="number of neurons, of each group")
    dimensions: int | None = param(None, at_least=1, doc="length of the input; default as wired")
    groups: int = param(
        1, at_least=0, doc="groups, among which the dimensions are divided; 0: one for each"
    )
    neuron: NeuronModel = param("LIF", doc="neuron model")
    radius: float = param(1.0, above=0.0, doc="largest input that is represented well")
    max_rates: Distribution = param("uniform(200, 400)", unit="Hz", doc="rates at input = radius")
    intercepts: Distribution = param(
        "uniform(-1, 0.9)", doc="inputs along the encoder, per radius, where firing sets in"
    )
    encoders: Distribution = param("sphere", doc="preferred directions, a row per neuron")
    normalize: bool = param(True, doc="whether encoders are made 1 long")
    gain: Distribution | None = param(None, doc="gains, in place of those that follow")
    bias: Distribution | None = param(None, doc="bias currents, in place of those that follow")
    voltage_start: Distribution | None = param(
        None, name="voltage", doc="initial voltages; default that of the model"
    )
    refractory_start: Distribution = param(
        0.0, name="refractory", unit="s", doc="initial refractory times"
    )
    recovery_start: Distribution | None = param(
        None, name="recovery", doc="initial adaptation, or recovery; default that of the model"
    )

    noise: Distribution | None = param(
        None, doc="noise current per root of s: normal, uniform, exponential, or numbers"
    )
    noise_synapse: Synapse = param("none", unit="s", doc="filter of the noise")
    learning: EncoderRule | None = param(None, doc="rule, or rules, by which the encoders learn")

    current = State("total", name="drive", doc="input current J")
    fired = State(
        "total",
        unit="1/s",
        signal=Spikes("total"),
        event=True,
        doc="spikes of the coming step",
    )
    membrane = State("total", name="voltage", doc="membrane voltage")
    refractory = State("total", unit="s", doc="refractory time left")
    recovery = State("total", doc="adaptation, or the model's recovery variable")
    gains = State("total", name="gain", doc="gains")
    biases = State("total", name="bias", doc="bias currents")
    scaled = State(
        "per_group", "total", name="scaled_encoders", doc="gain * encoders / radius, as columns"
    )
    activity = State("learners", unit="1/s", doc="filtered spikes s, of a learning rule")
    activities = State("more_rules", "learners", unit="1/s", doc="those of further rules")
    traced = State("trace_order", "learners", doc="the states of a rule's filter")
    noisy = State("noise_order", "total", name="filtered_noise", doc="the noise_synapse's states")

    def sizes(self) -> dict[str, int]:
        sizes = {"neurons": self.neurons}
        if self.groups:
            sizes["groups"] = self.groups
            # Without neurons, there is one number for each dimension.
            if not self.direct:
                sizes["total"] = self.neurons * self.groups
        if self.dimensions is not None:
            sizes["d"] = self.dimensions
        return sizes

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        order = 0 if self.noise is None else self.noise_synapse.order_at(context.dt)
        rules = () if self.learning is None else self.learning.each
        traced = trace_order(rules[0].tau, context.dt) if rules else 0
        learns = {"more_rules": max(len(rules) - 1, 0), "trace_order": traced}
        return {**self.sizes(), **learns, "noise_order": order}

    def infer(self, lengths: Mapping[str, int]) -> Mapping[str, int]:
        groups = self.groups or lengths.get("d", 0)
        total = lengths.get("d", 0) if self.direct else groups * self.neurons
        # With ``groups: 0`` nothing is known before the length of the input is.
        inferred = {"groups": groups} if groups else {}
        if total:
            inferred["total"] = total
            inferred["learners"] = 0 if self.learning is None else total
        if "d" in lengths:
            inferred["per_group"] = max(1, lengths["d"] // groups)
        return inferred

    @property
    def direct(self) -> bool:
        """Whether there are no neurons."""
        return isinstance(self.neuron, Direct)

    def each(self, d: int) -> int:
        """The neurons of a group of d dimensions; without neurons, its numbers."""
        return d if self.direct else self.neurons

    def validate(self) -> None:
        wrong = [n for n in ("gain", "noise", "learning") if self.value(n) is not None]
        if self.direct and wrong:
            message = "Direct has no neurons that this could act on"
            raise ParameterError([(name, message) for name in wrong])
        if (self.gain is None) != (self.bias is None):
            missing = "bias" if self.bias is None else "gain"
            raise ParameterError([(missing, "gain and bias go together; give both or neither")])
        if self.noise is not None and self.noise.kind not in NOISES:
            known = "normal, uniform or exponential, or numbers"
            raise ParameterError([("noise", f"expected {known}, got {self.noise!r}")])

    def validate_in(self, context: BlockContext) -> None:
        d, groups = context.types["input"].shape[0], context.lengths["groups"]
        problems = []
        if d % groups:
            message = f"{d} dimensions cannot be divided evenly among {groups} groups"
            raise ParameterError([("groups", message)])
        if self.direct and len(context.terms["current"]):
            message = "Direct has no neurons that a current could flow into; remove the wire"
            raise ParameterError([("neuron", message)])
        too_long = self.neuron.too_long(context.dt)
        if too_long:
            problems.append(("neuron", f"{too_long}; give the block a smaller dt"))
        # Others are drawn in a run, of the same distributions and shapes: an error that every draw
        # has is reported before anything runs.
        try:
            drawn(self, np.random.default_rng(0), groups, d // groups)
        except ParameterError as error:
            problems += error.problems
        if self.noise is not None and self.noise.fixed is not None:
            try:
                self.noise.draw(np.random.default_rng(0), self.neurons * groups)
            except ValueError as error:
                problems.append(("noise", str(error)))
        if problems:
            raise ParameterError(problems)

    def start(self, state: BlockState) -> None:
        groups = state.context.lengths["groups"]
        d = state.context.types["input"].shape[0] // groups
        first = drawn(self, state.rng, groups, d)
        for name in ("gain", "bias", "voltage", "refractory", "recovery"):
            getattr(state, name)[:] = first[name]
        # One row of encoders per dimension of a group, for all neurons.
        state.scaled_encoders[...] = (first["encoders"] / self.radius * state.gain[:, None]).T
        if self.direct:
            state.scaled_encoders[...] = first["encoders"].T  # no rounding of the radius
        state.each = self.each(d)
        state.row_groups = state.scaled_encoders.reshape(d, groups, state.each)
        state.drive_of_groups = state.drive.reshape(groups, state.each)
        state.point, state.further = np.zeros((groups, d)), range(1, d)
        state.step, state.constants = type(self.neuron).step, self.neuron.constants
        state.draws, state.emission = self.neuron.draws, self.neuron.emission
        state.amplitude, state.scales = self.neuron.amplitude, self.neuron.amplitude != 1.0
        self._start_noise(state)
        rules = () if self.learning is None else self.learning.each
        state.learns, state.amount = bool(rules), np.zeros_like(state.activity)
        state.rates = np.array([rule.learning_rate * state.dt for rule in rules])
        state.shares = np.array([share_of_spikes(rule.tau, state.dt) for rule in rules])
        state.trace_a, state.trace_b = np.zeros((0, 0)), np.zeros(0)
        if rules:
            state.trace_a, state.trace_b = trace_matrices(rules[0].tau, state.dt)
        # From the states and not from what was drawn: `resume` brings it in line with older states.
        state.scale = state.gain / self.radius

    def _start_noise(self, state: BlockState) -> None:
        n, noise = len(state.drive), self.noise
        state.noise = "" if noise is None else noise.kind or "numbers"
        state.noise_a, state.noise_b = self.noise_synapse.matrices(state.dt)
        # What is drawn is first + width times a standard number, at most `most`.
        state.first, state.width, state.most, state.drawn = 0.0, 0.0, math.inf, np.zeros(n)
        if noise is None:
            return
        root = math.sqrt(state.dt)
        if noise.fixed is not None:
            state.drawn[:] = noise.draw(state.rng, n)[:, 0] / root
            return
        given = noise.arguments
        if noise.kind == "exponential":
            width, first = given[0], given[1] if len(given) > 1 else 0.0
            state.most = given[2] / root if len(given) > 2 else math.inf
        else:
            first, width = given
            width -= first if noise.kind == "uniform" else 0.0
        state.first, state.width = first / root, width / root

    def resume(self, state: BlockState) -> None:
        state.scale[:] = state.gain / self.radius

    def stack_key(self, context: BlockContext) -> Hashable:
        # Random numbers are a block's own.
        if self.noise is not None or self.neuron.emission in ("stochastic", "poisson"):
            return None
        if self.learning is not None or self.neuron.stacked(self.neurons) is None:
            return None
        return self.neuron, self.neurons

    @classmethod
    def stacked(
        cls, blocks: Sequence[Any], states: Sequence[BlockState], arrays: Mapping[str, FloatArray]
    ) -> EnsembleStack:
        return EnsembleStack(blocks, states, arrays)

    def facts(self, state: BlockState) -> Mapping[str, float]:
        sizes = (0, 0) if self.direct else (state.gain.size, state.scaled_encoders.size)
        return dict(zip(("neurons", "synapses"), sizes, strict=True))

    def tuning(self, state: BlockState) -> Tuning:
        """The published description of ``spikes``: that of the states when the run begins."""
        gain, scaled = state.gain.copy(), state.scaled_encoders.T * self.radius
        # A neuron of gain 0 has no encoder left in the scaled ones; its response is constant.
        encoders = np.zeros_like(scaled)
        np.divide(scaled, gain[:, None], out=encoders, where=gain[:, None] != 0.0)
        groups = state.context.lengths["groups"]
        return Tuning(self.neuron, gain, state.bias.copy(), encoders, self.radius, groups)

    def output(self, state: BlockState, t: float) -> FloatArray:
        fired: FloatArray = state.fired.copy()
        return fired

    def update(
        self,
        state: BlockState,
        t: float,
        input: tuple[FloatArray, ...],
        current: tuple[FloatArray, ...],
        learn: float,
    ) -> None:
        point, drive, total = state.point, state.drive_of_groups, state.drive
        flat = point.reshape(-1)
        flat[:] = 0.0
        for term in input:
            flat += term
        if len(state.row_groups) < MANY_DIMENSIONS:
            np.multiply(state.row_groups[0], point[:, 0, None], out=drive)
            total += state.bias
            for j in state.further:
                drive += state.row_groups[j] * point[:, j, None]
        else:
            total[:] = state.bias
            drive += np.einsum("dgn,gd->gn", state.row_groups, point)
        for straight in current:
            total += state.gain * straight
        self._step(state, t, learn)

    @kernel_of(update)
    def _update_kernel(
        self,
        state: BlockState,
        t: float,
        input: tuple[FloatArray, ...],
        current: tuple[FloatArray, ...],
        learn: float,
    ) -> None:
        self._currents_kernel(state, input, current, state.point, state.drive)
        self._step(state, t, learn)

    def _currents_kernel(
        self,
        state: BlockState,
        input: tuple[FloatArray, ...],
        current: tuple[FloatArray, ...],
        point: FloatArray,
        drive: FloatArray,
    ) -> None:
        # One neuron after the other, so that the currents of a group stay in the cache while its
        # dimensions are added.
        rows = state.scaled_encoders
        for g in range(len(point)):
            for j in range(len(rows)):
                point[g, j] = 0.0
                # An empty tuple has no element type, so a loop over it would not compile.
                if len(input) > 0:
                    for term in input:
                        point[g, j] += term[g * len(rows) + j]
            row, value = rows[0], point[g, 0]
            for i in range(g * state.each, (g + 1) * state.each):
                drive[i] = state.bias[i] + row[i] * value
            for j in range(1, len(rows)):
                row, value = rows[j], point[g, j]
                for i in range(g * state.each, (g + 1) * state.each):
                    drive[i] += row[i] * value
        if len(current) > 0:
            for straight in current:
                for i in range(len(drive)):
                    one = 0 if len(straight) == 1 else i  # one number for all
                    drive[i] += state.gain[i] * straight[one]

    def _step(self, state: BlockState, t: float, learn: float) -> None:
        """Advance the neurons by the currents of this step, and the encoders by their spikes."""
        if state.noise != "":
            self._disturb(state)
        dt, drive, fired, voltage = state.dt, state.drive, state.fired, state.voltage
        refractory, recovery, constants = state.refractory, state.recovery, state.constants
        if state.draws:
            state.step(dt, drive, fired, voltage, refractory, recovery, constants, state.rng)
        else:
            state.step(dt, drive, fired, voltage, refractory, recovery, constants)
        if state.emission == "regular":
            emit_regular(dt, fired, voltage)
        if state.emission == "stochastic":
            emit_stochastic(dt, fired, state.rng)
        if state.emission == "poisson":
            emit_poisson(dt, fired, state.rng)
        if state.scales:
            fired *= state.amplitude
        if state.learns:
            self._learn(state, learn)
        if flush_due(t, state.dt):
            flush(state.voltage)
            flush(state.recovery)
            if state.learns:
                flush(state.activity)
                flush(state.activities)
                flush(state.traced)
                flush(state.scaled_encoders)

    def _learn(self, state: BlockState, learn: float) -> None:
        """Turn the encoders of active neurons, by all rules at once, to the input."""
        activity, amount, shares = state.activity, state.amount, state.shares
        trace(activity, state.traced, state.trace_a, state.trace_b, state.fired, shares[0])
        amount[:] = state.rates[0] * learn * activity
        for r in range(len(state.activities)):
            follow(state.activities[r], state.fired, shares[r + 1])
            amount += state.rates[r + 1] * learn * state.activities[r]
        voja_step(state.scaled_encoders, amount, state.scale, state.point)

    def _disturb(self, state: BlockState) -> None:
        """Add the noise of this tick to the currents."""
        drawn = state.drawn
        if state.noise != "numbers":
            for i in range(len(drawn)):
                if state.noise == "normal":
                    drawn[i] = state.first + state.width * state.rng.standard_normal()
                if state.noise == "uniform":
                    drawn[i] = state.first + state.width * state.rng.random()
                if state.noise == "exponential":
                    number = state.first + state.width * state.rng.standard_exponential()
                    drawn[i] = min(number, state.most)
        now = passed(state.filtered_noise, state.noise_a, state.noise_b, drawn)
        remember(state.filtered_noise, state.noise_a, state.noise_b, drawn, now)
        state.drive += now
