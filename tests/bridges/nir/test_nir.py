"""NIR files, read back by nir and simulated by a consumer that knows its equations alone."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.errors import GraphError, UsageError

nir = pytest.importorskip("nir")
from spikeblocks.nir.writing import export_nir  # noqa: E402

PAIR: dict[str, Any] = {
    "graph": "pair",
    "run": {"dt": 0.001, "until": 1.0, "seed": 4},
    "inputs": {"x": {"type": "Vector(2)", "default": 0.0}},
    "outputs": {"square": "squared.value", "same": "same.value"},
    "blocks": {
        "first": {"type": "Ensemble", "neurons": 200, "dimensions": 2, "radius": 1.5},
        "same": {"type": "Decoder", "synapse": 0.02},
        "one": {"type": "Decoder", "function": "x[0]", "synapse": 0.01},
        "double": {"type": "Gain", "gain": 0.5},
        "second": {"type": "Ensemble", "neurons": 150},
        "squared": {"type": "Decoder", "function": "x**2", "synapse": 0.02},
    },
    "wires": {
        "first": {"input": "inputs.x"},
        "same": {"spikes": "first.spikes"},
        "one": {"spikes": "first.spikes"},
        "double": {"input": "one.value"},
        "second": {"input": ["double.out", "same.value.1"]},
        "squared": {"spikes": "second.spikes"},
    },
}


def simulate(graph: Any, inputs: dict[str, np.ndarray], until: float, dt: float) -> dict[str, Any]:
    """The means of all nodes' outputs over the second half: NIR's equations, spikes as 1/dt."""
    names = list(graph.nodes)
    into: dict[str, list[str]] = {name: [] for name in names}
    for source, target in graph.edges:
        into[target].append(source)
    volts = {n: np.zeros(node.tau.shape) for n, node in graph.nodes.items() if hasattr(node, "tau")}
    values = {n: np.zeros(node.output_type["output"]) for n, node in graph.nodes.items()}
    means = {n: np.zeros_like(value) for n, value in values.items()}
    ticks = round(until / dt)
    for tick in range(ticks):
        for name, node in graph.nodes.items():
            kind = type(node).__name__
            x = sum((values[source] for source in into[name]), np.zeros(node.input_type["input"]))
            if kind == "Input":
                values[name] = inputs[name]
            elif kind == "Affine":
                values[name] = node.weight @ x + node.bias
            elif kind == "Linear":
                values[name] = node.weight @ x
            elif kind == "Scale":
                values[name] = node.scale * x
            elif kind in ("LI", "LIF"):
                # The exact solution for an input that holds during the step.
                v, end = volts[name], node.v_leak + node.r * x
                v = end + (v - end) * np.exp(-dt / node.tau)
                if kind == "LIF":
                    fired = v > node.v_threshold
                    values[name] = fired / dt
                    v = np.where(fired, node.v_reset, v)
                else:
                    values[name] = v
                volts[name] = v
            else:
                assert kind == "Output", kind
                values[name] = x
            if tick >= ticks // 2:
                means[name] = means[name] + values[name] / (ticks - ticks // 2)
    return means


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("nir")
    done = export_nir(runtime.load(PAIR), folder)
    assert done.outputs == ("same", "squared")
    return nir.read(folder / "populations.nir")


@pytest.mark.slow
@pytest.mark.parametrize("x", [(0.8, -0.4), (-1.0, 0.2), (0.0, 0.0), (0.4, 0.7)])
def test_another_simulator_decodes_what_is_represented(written, x: tuple[float, float]) -> None:
    means = simulate(written, {"x": np.array(x)}, until=0.6, dt=5e-5)
    assert np.allclose(means["same"], x, atol=0.04)
    assert np.allclose(means["squared"], (0.5 * x[0] + x[1]) ** 2, atol=0.06)


@pytest.mark.slow
def test_neurons_fire_as_the_closed_form_says_and_up_to_their_largest_rates(written) -> None:
    x = np.array([1.5, 0.0])
    means = simulate(written, {"x": x}, until=0.6, dt=2e-5)
    encoding, neurons = written.nodes["first_encoders"], written.nodes["first"]
    current = encoding.weight @ x + encoding.bias
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.where(current > 1.0, 1.0 / (neurons.tau * np.log1p(1.0 / (current - 1.0))), 0.0)
    assert np.allclose(means["first"], rates, atol=5.0)
    # Along its own encoder, at the radius, each has its largest rate: 200 to 400 Hz as declared.
    at_radius = 1.5 * np.linalg.norm(encoding.weight, axis=1) + encoding.bias
    largest = 1.0 / (neurons.tau * np.log1p(1.0 / (at_radius - 1.0)))
    assert largest.min() > 199.9
    assert largest.max() < 400.1


def test_without_solving_again_the_value_would_be_off(written) -> None:
    """What the tests above would find: our own gains and weights in NIR's neurons."""
    session = runtime.load(PAIR).session()
    weights = session.read("same.weights")
    assert np.abs(weights - written.nodes["same_weights"].weight).max() > 1e-6
    gain, bias = session.read("first.gain"), session.read("first.bias")
    rates = 1.0 / (0.02 * np.log1p(1.0 / (gain + bias - 1.0)))
    assert rates.max() / 400.0 > 1.5


@pytest.mark.parametrize(
    ("path", "value", "reason"),
    [
        ("first.neuron", "ReLU", "NIR has no neurons of type ReLU; LIF is one"),
        ("same.synapse", "alpha(0.1)", "NIR has no synapse 'alpha'; a lowpass is its LI"),
        ("first.noise", "normal(0, 0.1)", "no encoders that learn, and no noise"),
    ],
)
def test_what_nir_lacks_is_refused_with_a_sentence(
    path: str, value: Any, reason: str, tmp_path: Path
) -> None:
    graph = runtime.load(PAIR).set(path, value)
    with pytest.raises(GraphError) as raised:
        export_nir(graph, tmp_path)
    assert reason in str(raised.value)
    assert path.split(".")[0] in str(raised.value)


def test_weights_that_learn_are_refused_with_what_to_do_instead(tmp_path: Path) -> None:
    learning = copy.deepcopy(PAIR)
    learning["blocks"]["same"]["learning"] = {"rule": "pes"}
    learning["wires"]["same"]["error"] = ["inputs.x"]
    with pytest.raises(GraphError) as raised:
        export_nir(runtime.load(learning), tmp_path)
    assert "no rule that changes weights while it runs, such as PES; run it, and" in str(
        raised.value
    )


def test_a_block_that_nir_lacks_is_refused_if_it_is_named(tmp_path: Path) -> None:
    with pytest.raises(GraphError, match=r"blocks.lidar: NIR has no Lidar"):
        export_nir(runtime.load("wall_following"), tmp_path, blocks=["lidar"])
    with pytest.raises(UsageError, match="there is no population to export"):
        export_nir(runtime.load("gallery/bouncing_ball"), tmp_path)


def test_the_command_writes_a_file_that_nir_reads(cli, tmp_path: Path) -> None:
    done = cli("export", "gallery/neural_array", str(tmp_path), "--to", "nir")
    if done.returncode == 2:  # groups
        assert "one Ensemble each" in done.stderr
    (tmp_path / "g.yaml").write_text(
        "graph: g\nrun: {dt: 0.001, until: 1}\nblocks:\n  one: {type: Constant, value: 0.5}\n"
        "  pop: {type: Ensemble, neurons: 50}\n  out: {type: Decoder}\n"
        "wires: {pop: {input: one.value}, out: {spikes: pop.spikes}}\n"
    )
    done = cli(
        "export", str(tmp_path / "g.yaml"), str(tmp_path / "o"), "--to", "nir", "--name", "a"
    )
    assert done.returncode == 0, done.stderr
    graph = nir.read(tmp_path / "o" / "a.nir")
    assert {type(node).__name__ for node in graph.nodes.values()} == {
        *("Input", "Affine", "LIF", "Linear", "LI", "Output")
    }
