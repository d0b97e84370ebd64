"""Features of graphs by targets of an export: each compiles, and gives what a run does."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime import toolchain
from runtime.export import export
from runtime.export.library import export_library
from tests.runtime.export.test_every_block import STRICT
from tests.runtime.export.test_every_block import run as run_compiled

TICKS = 60
STEP = "ref: {type: Step, time: 0.105, after: 2.0}"
SECOND = "plant: {type: SecondOrder, natural_frequency: 3.0, damping: 0.3}"
BALL = """ball: {type: DynamicSystem, states: [h, v], initial: [0.1, 0],
           derivative: [v, "-9.81"], when: h < 0 and v < 0, then: [0, -0.8*v]}"""
INTO = "plant: {input: ref.out}"
# Blocks, wires, the address that is recorded, and more of the graph.
FEATURES: dict[str, tuple[str, str, str, str]] = {
    "edge": (f"{STEP}\n  {SECOND}", INTO, "plant.out", ""),
    "edge, dopri5": (f"{STEP}\n  {SECOND}", INTO, "plant.out", "solver: dopri5"),
    "edge, rodas4": (f"{STEP}\n  {SECOND}", INTO, "plant.out", "solver: rodas4"),
    "edge, euler": (f"{STEP}\n  {SECOND}", INTO, "plant.out", "solver: euler"),
    "edge on ticks": (f"{STEP}\n  {SECOND}", INTO, "plant.out", "events: ticks"),
    "edge and event": (f"{STEP}\n  {SECOND}\n  {BALL}", INTO, "ball.out", ""),
    "event": (BALL, "", "ball.out", ""),
    "event, dopri5": (BALL, "", "ball.out", "solver: dopri5"),
    "edge and stop": (
        f"{STEP}\n  {SECOND}",
        INTO,
        "plant.out",
        "stop: {when: plant.out, above: 0.5}",
    ),
    "edges of a table": (
        "ref: {type: Piecewise, times: [0, 0.123, 0.251], values: [0, 1, -1]}\n  " + SECOND,
        INTO,
        "plant.out",
        "",
    ),
    "edges without states": (
        f"{STEP}\n  k: {{type: Gain, gain: 3}}",
        "k: {input: ref.out}",
        "k.out",
        "",
    ),
    "pulses": (
        "ref: {type: Pulse, period: 0.137, width: 0.05}\n  " + SECOND,
        INTO,
        "plant.out",
        "",
    ),
    "relay": (
        "ref: {type: Sine, frequency: 2}\n"
        f"  r: {{type: Relay, switch_on: 0.3, switch_off: -0.3}}\n  {SECOND}",
        "r: {input: ref.out}\n  plant: {input: r.out}",
        "plant.out",
        "",
    ),
    "delay": (
        f"{STEP}\n  late: {{type: Delay, delay: 0.033}}\n  {SECOND}",
        "late: {input: ref.out}\n  plant: {input: late.out}",
        "plant.out",
        "",
    ),
    "sampled": (
        f"{STEP}\n  {SECOND}\n  f: {{type: Lowpass, tau: 0.05, dt: 0.03}}",
        f"{INTO}\n  f: {{input: plant.out}}",
        "f.out",
        "",
    ),
    "noise": (
        f"ref: {{type: WhiteNoise, density: 0.1}}\n  {SECOND}",
        INTO,
        "plant.out",
        "",
    ),
    "loop": (
        f"{STEP}\n  s: {{type: Sum, signs: [1, -1]}}\n  k: {{type: Gain, gain: 0.5}}",
        "s: {terms: [ref.out, k.out]}\n  k: {input: s.out}",
        "k.out",
        "loops: solve",
    ),
    "repeated": (
        f"""{STEP}
  parts:
    repeat: 3
    share: [x]
    inputs: {{x: Scalar}}
    outputs: {{y: plant.out}}
    blocks: {{{SECOND}}}
    wires: {{plant: {{input: inputs.x}}}}""",
        "parts: {x: ref.out}",
        "parts.y",
        "",
    ),
    "population": (
        "ref: {type: Sine, frequency: 2}\n"
        "  e: {type: Ensemble, neurons: 40, max_rates: 'uniform(200, 400)'}\n"
        "  d: {type: Decoder}",
        "e: {input: ref.out}\n  d: {spikes: e.spikes}",
        "d.value",
        "",
    ),
    "difference equation": (
        f"{STEP}\n  d: {{type: DiscreteSystem, states: [n], next: 'n + u[0]', initial: 0}}",
        "d: {u: ref.out}",
        "d.out",
        "",
    ),
    "removed and bypassed": (
        f"{STEP}\n  a: {{type: Gain, gain: 2}}\n  b: {{type: Clip, low: -1, high: 1}}\n"
        f"  s: {{type: Sum, signs: [1, -1]}}\n  {SECOND}",
        "a: {input: ref.out}\n  b: {input: ref.out}\n  s: {terms: [a.out, b.out]}\n"
        "  plant: {input: s.out}\nwithout: [a]\nbypass: [b]",
        "plant.out",
        "",
    ),
    "misses": (
        "ref: {type: Constant, signal: Scan(3), value: [1, .inf, 2]}\n"
        "  m: {type: Function, expression: min(u)}",
        "m: {u: ref.value}",
        "m.out",
        "",
    ),
}


def graph_of(feature: str, folder: Path) -> runtime.Graph:
    blocks, wires, probe, run = FEATURES[feature]
    dt = 0.001 if feature == "population" else 0.01
    text = (
        f"graph: feature\nrun: {{dt: {dt}, until: {TICKS * dt}, seed: 1{', ' * bool(run)}{run}}}\n"
    )
    text += f"blocks:\n  {blocks}\n" + (f"wires:\n  {wires}\n" if wires else "")
    path = folder / "graph.yaml"
    path.write_text(f"{text}probes: {{y: {probe}}}\nplots: {{y: {{kind: timeseries, of: y}}}}\n")
    return runtime.load(path)


def by_c(graph: runtime.Graph, folder: Path) -> None:
    """The test that is written beside the C text passes."""
    export(graph, folder)
    said = run_compiled(folder, "cc", *STRICT, "-O2", "controller.c", "controller_test.c")
    assert "fine" in said and "WRONG" not in said


def _loaded(folder: Path) -> Any:
    """The Python module of a library."""
    found = importlib.util.spec_from_file_location("made", folder / "controller.py")
    assert found is not None and found.loader is not None
    made = importlib.util.module_from_spec(found)
    found.loader.exec_module(made)
    return made


def by_library(graph: runtime.Graph, folder: Path) -> None:
    """Each step of the Python module gives the row of a run."""
    export_library(graph, folder)
    made = _loaded(folder)
    if any(map(graph.network.holds, graph.network.entries)):  # a controller decides on its ticks
        graph = graph.set("run.events", "ticks")
    result, controller = graph.run(engine="compiled"), made.Controller()
    (signal,) = graph.program().observation.probes["y"].signals
    name = f"{signal.end.block}.{signal.end.port}".replace(".", "_")
    every = {
        round(t / graph.network.dt): row
        for t, row in zip(result.time("y"), result["y"], strict=True)
    }
    for k in range(max(every)):
        outputs = controller.step()
        if k in every:
            np.testing.assert_allclose(np.ravel(outputs[name]), np.ravel(every[k]), rtol=1e-12)


TARGETS: dict[str, Callable[[runtime.Graph, Path], None]] = {
    "c": by_c,
    "library": by_library,
}


@pytest.mark.slow
@pytest.mark.skipif(not toolchain.available(), reason="needs a C compiler")
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("feature", FEATURES)
def test_a_feature_is_exported_to_a_target(feature: str, target: str, tmp_path: Path) -> None:
    TARGETS[target](graph_of(feature, tmp_path), tmp_path / "made")


@pytest.mark.slow
@pytest.mark.skipif(not toolchain.available(), reason="needs a C compiler")
@pytest.mark.parametrize("neurons", ["LIF", "AdaptiveLIF", "Izhikevich"])
def test_more_neurons_may_spike_than_in_the_recording(neurons: str, tmp_path: Path) -> None:
    path = tmp_path / "graph.yaml"
    path.write_text(f"""
graph: g
run: {{dt: 0.001, until: 0.1, seed: 1}}
inputs: {{x: {{type: Scalar, default: 0.0}}}}
outputs: {{y: {{of: d.value}}}}
blocks:
  e: {{type: Ensemble, neurons: 60, neuron: {neurons}, max_rates: "uniform(200, 400)"}}
  d: {{type: Decoder, learning: {{rule: pes, learning_rate: 1.0e-3}}}}
wires:
  e: {{input: inputs.x}}
  d: {{spikes: e.spikes, error: d.value}}
probes: {{y: d.value}}
""")
    graph = runtime.load(path)
    made = export_library(graph, tmp_path / "made")
    assert "the worst case of any step, whatever the data" in made.report
    controller, session = _loaded(tmp_path / "made").Controller(), graph.session()
    for x in (0.0, 1.5, -1e6, 1e6, 0.3):
        session.write("x", x)
        for _ in range(50):
            expected = np.ravel(session.read("d.value"))
            np.testing.assert_allclose(controller.step(x=x)["y"], expected, rtol=1e-6, atol=1e-9)
            session.step()
