"""The same populations here and in Nengo: with the same gains, biases, encoders and voltages."""

from __future__ import annotations

from typing import Any

import nengo
import numpy as np

import blocks
import runtime
from blocks.neural import LIF, NeuronModel

DT = 0.001


class Wave(blocks.Block):
    """Sines of several frequencies."""

    out = blocks.Output(blocks.Vector("size"))
    size: int = blocks.param(1, doc="length")
    speed: float = blocks.param(3.0, doc="rad/s")

    def output(self, state: Any, t: float) -> np.ndarray:
        return wave(t, self.size, self.speed)


def wave(t: float, size: int = 1, speed: float = 3.0) -> np.ndarray:
    phase = np.arange(size)
    return np.sin(speed * t + phase) * 0.7 + 0.3 * np.cos(7.1 * t + phase)


def ticks(function: Any) -> Any:
    """A function of our t_k as a node's function, which sees t one step later."""
    return lambda t, *x: function(round((t - DT) / DT) * DT, *x)


def drawn(n: int, d: int, seed: int, model: NeuronModel | None = None) -> dict[str, Any]:
    """Gains, biases, encoders and voltages, as parameters of an Ensemble."""
    rng = np.random.default_rng(seed)
    gain, bias = (model or LIF()).gain_and_bias(rng.uniform(200, 390, n), rng.uniform(-1, 0.9, n))
    encoders = rng.standard_normal((n, d))
    encoders /= np.linalg.norm(encoders, axis=1, keepdims=True)
    return {"gain": gain, "bias": bias, "encoders": encoders, "voltage": rng.uniform(0, 1, n)}


def ensemble(
    n: int, d: int, fixed: dict[str, Any], model: Any = nengo.LIF, radius: float = 1.0
) -> nengo.Ensemble:
    """Nengo's ensemble with the numbers of :func:`drawn`."""
    start = {"voltage": nengo.dists.Samples(fixed["voltage"])}
    return nengo.Ensemble(
        n,
        d,
        radius=radius,
        gain=fixed["gain"],
        bias=fixed["bias"],
        encoders=fixed["encoders"],
        neuron_type=model(initial_state=start),
    )


def weights(rows: int, n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((rows, n)) * 1e-3


def simulated(model: nengo.Network, seconds: float) -> nengo.Simulator:
    simulator = nengo.Simulator(model, dt=DT, progress_bar=False, optimize=False)
    with simulator:
        simulator.run(seconds)
    return simulator


def graph(seconds: float, seed: int = 0) -> runtime.Graph:
    return runtime.Graph("populations", dt=DT, until=seconds, seed=seed)
