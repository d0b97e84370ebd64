"""What decays becomes zero before it is a denormal number, under both engines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks.core.portable import TINY, flush
from runtime.engine import Engine
from runtime.engine.compiled import CompiledRunner
from tests.compilers import needs_compiler

ENGINES = [
    pytest.param(None, id="python"),
    pytest.param(CompiledRunner, id="compiled", marks=needs_compiler),
]
# Filters this fast stay at the smallest denormal number from 1.7 s on, if they are not flushed.
TAU, END = 0.002, 2.0


class Burst(blocks.Block):
    """A vector, and a number, of 1 until 0.05 s and 0 from then on."""

    out = blocks.Output(blocks.Vector(1))
    number = blocks.Output(blocks.Scalar)

    def output(self, state: Any, t: float) -> Any:
        value = 1.0 if t < 0.05 else 0.0
        return np.full(1, value), value


def tiny(arrays: Any) -> dict[str, int]:
    """How many numbers of each state are denormal."""
    least = np.finfo(float).tiny
    found = {
        name: int(np.count_nonzero((a != 0.0) & (np.abs(a) < least)))
        for name, a in arrays.items()
        if a.dtype == np.float64
    }
    return {name: count for name, count in found.items() if count}


def after(graph: runtime.Graph, runner: Any) -> dict[str, Any]:
    """All arrays of a run at its end."""
    engine = Engine(graph.program(), 1, runner)
    outcome = engine.run()
    assert (outcome.status, outcome.error) == ("complete", None)
    assert not outcome.notes
    return engine.state.arrays


def base() -> runtime.Graph:
    return runtime.Graph("silence", dt=0.001, until=END).add("one", Burst())


def population(**more: Any) -> runtime.Graph:
    """Neurons that are silent without an input."""
    given = {"neurons": 10, "intercepts": "uniform(0.1, 0.5)", "encoders": np.ones((10, 1))}
    made = base().add("snn", blocks.Ensemble(**(given | more)))
    return made.connect("one.out", "snn.input")


def decoder(**more: Any) -> runtime.Graph:
    made = population().add("last", blocks.Decoder(weights=np.ones((1, 10)), **more))
    made = made.connect("snn.spikes", "last.spikes")
    return made.connect("one.out", "last.error") if "learning" in more else made


def weights(rule: str) -> runtime.Graph:
    learning = {"rule": rule, "tau": TAU} | ({"theta_tau": TAU} if rule == "bcm" else {})
    given = np.full((10, 10), 1e-3)
    made = population().add("last", blocks.Weights(weights=given, synapse=TAU, learning=learning))
    return made.connect("snn.spikes", "last.spikes").connect("snn.spikes", "last.post")


def learner(kind: type[blocks.Block], **more: Any) -> runtime.Graph:
    made = base().add("last", kind(learning_rate=1e-3, leak=1.0 / TAU, **more))
    return made.connect("one.out", "last.input").connect("one.out", "last.error")


def filtered(block: blocks.Block, port: str = "input", dt: float | None = None) -> runtime.Graph:
    more = {} if dt is None else {"dt": dt}
    return base().add("last", block, **more).connect("one.number", f"last.{port}")


def lagging() -> runtime.Graph:
    made = base().add("twist", blocks.Mux()).add("last", blocks.ActuatorLag(tau=TAU))
    made = made.connect("one.number", "twist.v").connect("one.number", "twist.omega")
    return made.connect("twist.out", "last.command")


SILENT = {"neurons": 10, "intercepts": [0.1, 0.5], "encoders": np.ones(10), "tau_syn": TAU}
PASSIVE = {"gain": np.ones(10), "bias": np.zeros(10), "voltage": 0.9}
KINDS = {
    "lowpass of a value": lambda: decoder(synapse=TAU),
    "alpha of a value": lambda: decoder(synapse=f"alpha({TAU})"),
    "lowpass of spikes": lambda: decoder(synapse=TAU, filter="spikes"),
    "pes": lambda: decoder(synapse=TAU, learning={"rule": "pes", "tau": TAU}),
    "rls": lambda: decoder(synapse=TAU, learning={"rule": "rls", "tau": TAU}),
    "voja": lambda: population(learning={"rule": "voja", "tau": TAU}),
    "bcm": lambda: weights("bcm"),
    "oja": lambda: weights("oja"),
    "membrane": lambda: population(neuron={"type": "LIF", "tau_rc": TAU}, **PASSIVE),
    "adaptation": lambda: population(neuron={"type": "AdaptiveLIF", "tau_n": TAU}),
    "AdaptiveEnsemble": lambda: learner(blocks.AdaptiveEnsemble, **SILENT),
    "RateEnsemble": lambda: learner(blocks.RateEnsemble, **SILENT),
    "AdaptiveBias": lambda: learner(blocks.AdaptiveBias),
    "MRAC": lambda: learner(blocks.MRAC, tau_syn=TAU),
    "Lowpass": lambda: filtered(blocks.Lowpass(tau=TAU)),
    "Lowpass, slower": lambda: filtered(blocks.Lowpass(tau=TAU), dt=0.002),
    "ActuatorLag": lagging,
    "DiscretePID": lambda: filtered(blocks.DiscretePID(kd=1.0, n=1.0 / TAU), "error"),
}


@pytest.mark.parametrize("runner", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_a_filter_without_input_holds_no_denormals(kind: str, runner: Any) -> None:
    assert tiny(after(KINDS[kind](), runner)) == {}


@pytest.mark.parametrize("synapse", [TAU, f"alpha({TAU})"])
def test_a_filtered_probe_ends_at_zero(synapse: Any) -> None:
    run = base().probe("smooth", "one.number", synapse=synapse).run()
    assert run["smooth"][80] > 1e-10
    assert run["smooth"][-1] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("runner", ENGINES)
def test_case_a_holds_no_denormals_after_100_s(runner: Any) -> None:
    graph = runtime.load("line_actuator_failure").set("run.until", 100.0)
    assert tiny(after(graph, runner)) == {}


def test_only_what_is_below_the_threshold_is_flushed() -> None:
    kept = np.array([[TINY, -TINY, 1.0], [np.inf, -np.inf, 0.5]])
    flushed = np.array([0.999 * TINY, -0.999 * TINY, 5e-324, -0.0])
    found = kept.copy()
    flush(found)
    flush(flushed)
    np.testing.assert_array_equal(found, kept)
    np.testing.assert_array_equal(flushed, 0.0)
