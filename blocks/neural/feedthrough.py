"""An Ensemble whose spikes of a step are known in that step.

Vectors (d,) and currents (n,) go in, the spikes of the last step and of this one (n,) come out::

    a: {type: FeedthroughEnsemble, neurons: 50}       # a_b: {spikes: a.now}, {synapse: none}
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, final

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    Output,
    ParameterError,
    Spikes,
    kernel_of,
)
from blocks.neural.emission import emit_regular
from blocks.neural.ensemble import Ensemble
from blocks.neural.published_tuning import Tuning
from blocks.neural.synapses import passed

COPIED = ("drive", "fired", "voltage", "refractory", "recovery", "filtered_noise", "point")


@final
class FeedthroughEnsemble(Ensemble):
    """An Ensemble whose spikes of the step that begins are an output as well.

        input, current, learn ─▶ [ FeedthroughEnsemble ] ─▶ spikes, now

    A Decoder without a synapse that reads ``now`` gives its value in the tick of the input, as a
    connection of Nengo without a synapse does, and ``spikes`` are those of an Ensemble, a tick
    later. ``now`` needs the inputs of its tick, so a loop through it has to contain a synapse. The
    neurons are computed twice in each tick, and must not draw random numbers. Of its own name and
    parameters alone, an Ensemble is the same neurons.
    """

    now = Output(
        Spikes("total"),
        publishes="tuning_now",
        carries=("d", "groups"),
        doc="spikes of the coming step, which follow from the inputs of this tick",
    )

    # The kernel holds with this class's own `start` too, which adds what `output_now` needs alone.
    _update_kernel = Ensemble._update_kernel

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        noisy = self.noise is not None and self.noise.fixed is None
        if noisy or self.neuron.draws or self.neuron.emission in ("stochastic", "poisson"):
            # They would have to be drawn for `now`, and the same once more for the states.
            name = "noise" if noisy else "neuron"
            message = "draws random numbers in each step; use an Ensemble, whose spikes are a "
            raise ParameterError([(name, f"{message}tick later, or a synapse behind it")])

    def start(self, state: BlockState) -> None:
        super().start(state)
        # What a second population, which takes each step ahead of this one, shares with it.
        shared: tuple[str, ...] = (
            "gain",
            "bias",
            "dt",
            "row_groups",
            "further",
            "step",
            "constants",
            "draws",
        )
        shared += ("emission", "amplitude", "scales", "noise", "drawn", "noise_a", "noise_b")
        state.shared = {name: getattr(state, name) for name in shared} | {"learns": False}

    def stack_key(self, context: BlockContext) -> None:
        return None

    def tuning_now(self, state: BlockState) -> Tuning:
        """The published description of ``now``."""
        return replace(self.tuning(state), ahead=True)

    def output_now(
        self,
        state: BlockState,
        t: float,
        input: tuple[FloatArray, ...],
        current: tuple[FloatArray, ...],
    ) -> FloatArray:
        copies = {name: getattr(state, name).copy() for name in COPIED}
        ahead: Any = SimpleNamespace(**state.shared, **copies)
        ahead.drive_of_groups = ahead.drive.reshape(state.drive_of_groups.shape)
        self.update(ahead, t, input, current, 1.0)
        fired: FloatArray = ahead.fired.copy()
        return fired

    @kernel_of(output_now)
    def _output_now_kernel(
        self,
        state: BlockState,
        t: float,
        input: tuple[FloatArray, ...],
        current: tuple[FloatArray, ...],
    ) -> FloatArray:
        drive, fired = state.drive.copy(), state.fired.copy()
        voltage, refractory = state.voltage.copy(), state.refractory.copy()
        self._currents_kernel(state, input, current, state.point.copy(), drive)
        if state.noise != "":
            drive += passed(state.filtered_noise, state.noise_a, state.noise_b, state.drawn)
        recovery = state.recovery.copy()
        state.step(state.dt, drive, fired, voltage, refractory, recovery, state.constants)
        if state.emission == "regular":
            emit_regular(state.dt, fired, voltage)
        if state.scales:
            fired *= state.amplitude
        return np.asarray(fired)
