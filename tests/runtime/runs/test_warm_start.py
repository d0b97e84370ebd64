"""Runs that begin with the states that earlier runs ended with."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import blocks
import runtime
from runtime.runs import open_run
from tests.conftest import Run


def learner(until: float = 0.4, seed: int = 0, neurons: int = 30) -> runtime.Graph:
    graph = runtime.Graph("learner", dt=0.001, until=until, seed=seed)
    graph = graph.add("x", blocks.Constant(value=[0.5], signal="Vector"))
    graph = graph.add("snn", blocks.Ensemble(neurons=neurons))
    graph = graph.add("out", blocks.Decoder(function="0", learning="pes"))
    graph = graph.add("fused", blocks.AdaptiveEnsemble(neurons=neurons, learning_rate=1e-3))
    graph = graph.add("error", blocks.Sum(signs=[1, -1]))
    graph = graph.add("memory", blocks.Lowpass(tau=0.1, signal="Scalar"))  # a state without axes
    graph = graph.connect("x.value.0", "memory.input")
    graph = graph.connect("x.value", "snn.input").connect("snn.spikes", "out.spikes")
    graph = graph.connect("out.value", "error.terms").connect("x.value", "error.terms")
    graph = graph.connect("error.out", "out.error").connect("x.value", "fused.input")
    graph = graph.connect("error.out", "fused.error")
    for name in ("out.weights", "out.value", "snn.fired", "fused.weights", "fused.spikes"):
        graph = graph.probe(name)
    return graph


def test_a_run_in_two_halves_is_one_run(tmp_path: Path) -> None:
    """Everything that changes is in the states, so that the second half continues the first."""
    whole = learner(0.8).run()
    first = learner(0.4).run()
    first.save(tmp_path / "first")
    second = learner(0.4).begin_from(tmp_path / "first").run()
    for name in ("out.weights", "snn.fired", "fused.weights", "fused.spikes"):
        np.testing.assert_array_equal(second[name], whole[name][400:])


def test_learnt_weights_fit_other_seeds(tmp_path: Path) -> None:
    """Gains, biases and encoders come along, so that the weights mean the same."""
    trained = learner(3.0).run()
    trained.save(tmp_path / "run")
    frozen = learner(0.3, seed=7).set("blocks.out.learning", {"rule": "pes", "learning_rate": 0})
    found = frozen.begin_from(tmp_path / "run").run()["out.value"]
    assert abs(found[200:].mean() - trained["out.value"][-200:].mean()) < 0.05
    assert abs(frozen.run()["out.value"][200:].mean()) < 0.05


def test_single_states_and_blocks(tmp_path: Path) -> None:
    trained = learner().run()
    trained.save(tmp_path / "run")
    only = learner().begin_from(tmp_path / "run", "out.weights").run()
    np.testing.assert_array_equal(only["out.weights"][0], trained.states["out.weights"])
    np.testing.assert_array_equal(only["fused.weights"][0], 0.0)
    both = learner().begin_from(tmp_path / "run", "fused", "out.weights").run()
    np.testing.assert_array_equal(both["fused.weights"][0], trained.states["fused.weights"])
    again = open_run(tmp_path / "run")
    np.testing.assert_array_equal(again.states["out.weights"], trained.states["out.weights"])


def test_in_yaml_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    learner().run().save(tmp_path / "run")
    text = learner().to_yaml()
    (tmp_path / "all.yaml").write_text(text + "from: run\n", encoding="utf-8")
    (tmp_path / "one.yaml").write_text(text + "initial: {out.weights: run}\n", encoding="utf-8")
    (tmp_path / "next.yaml").write_text("extends: all.yaml\nrun: {seed: 3}\n", encoding="utf-8")
    trained = open_run(tmp_path / "run").states["out.weights"]
    for name in ("all", "one", "next"):
        found = runtime.load(tmp_path / f"{name}.yaml").run()
        np.testing.assert_array_equal(found["out.weights"][0], trained)


def test_blocks_that_differ_start_anew_with_a_note(tmp_path: Path) -> None:
    learner().run().save(tmp_path / "run")
    graph = learner().set("blocks.fused.neurons", 31).begin_from(tmp_path / "run")
    result = graph.run()
    assert any("fused differ" in note for note in result.notes)
    assert np.abs(result["out.weights"][0]).max() > 0.0
    np.testing.assert_array_equal(result["fused.weights"][0], 0.0)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"from": "none"}, "from: no such run: "),
        ({"from": 3}, "from: expected a run folder, got "),
        ({"initial": "run"}, "initial: expected entries such as 'snn.weights: RUN'"),
        ({"initial": {"out.weight": "run"}}, "no state of that name, did you mean 'out.weights'"),
        ({"initial": {"fused.weights": "other"}}, r"has the shape \(1, 30\), that of the run"),
        ({"from": "empty"}, "has no states.npz"),
        ({"from": "damaged"}, "is damaged"),
    ],
)
def test_errors(tmp_path: Path, entry: dict[str, object], message: str) -> None:
    learner(0.01).run().save(tmp_path / "run")
    learner(0.01, neurons=5).run().save(tmp_path / "other")
    for name in ("empty", "damaged"):
        (tmp_path / name).mkdir()
    (tmp_path / "damaged" / "states.npz").write_bytes(b"PK not an archive")
    text = learner().to_yaml() + json.dumps(entry)[1:-1].replace('"', "") + "\n"
    (tmp_path / "graph.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(runtime.GraphError, match=message):
        runtime.load(tmp_path / "graph.yaml").check()


@pytest.mark.parametrize("addresses", [(), ("out.weights",)])
def test_a_note_says_that_time_and_noise_begin_again(
    tmp_path: Path, addresses: tuple[str, ...]
) -> None:
    learner(0.01).run().save(tmp_path / "run")
    result = learner(0.01).begin_from(tmp_path / "run", *addresses).run()
    assert any("time and noise begin again" in note for note in result.notes)
    assert result.time("out.weights")[0] == 0.0
    assert not any("begin again" in note for note in learner(0.01).run().notes)


@pytest.mark.slow
def test_large_states_on_request(tmp_path: Path) -> None:
    graph = learner(0.01, neurons=140_000).without("fused")
    assert "out.weights" not in graph.run().states
    assert "out.weights" in graph.set("run.states", "all").run().states
    assert not graph.set("run.states", "none").run().states


@pytest.mark.slow
def test_the_command_line(tmp_path: Path, cli: Run) -> None:
    file = tmp_path / "learner.yaml"
    file.write_text(learner(0.05).to_yaml(), encoding="utf-8")
    first = json.loads(cli("run", "--no-plots", str(file), "--out", str(tmp_path), "--json").stdout)
    folder = Path(first["run"])
    done = cli(
        "run", "--no-plots", str(file), "--out", str(tmp_path), "--json", "--from", str(folder)
    )
    trained = open_run(folder).states["out.weights"]
    found = open_run(json.loads(done.stdout)["run"])
    np.testing.assert_array_equal(found["out.weights"][0], trained)
    assert any(text.startswith("from ") for text in found.manifest["overrides"])
    done = cli("run", str(file), "--initial", "out.weights")
    assert done.returncode == 2
    assert "expected ADDRESS=RUN" in done.stderr
