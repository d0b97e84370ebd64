"""Graphs built from the equations of papers: what these papers found, and what equations imply."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runtime
from runtime.cli.shipped import shipped

FOLDER = Path(__file__).parents[2] / "graphs" / "gallery" / "papers"
GRAPHS = sorted(FOLDER.glob("*.yaml"))
STUDIES = Path(__file__).parents[2] / "graphs" / "experiments"


def graph(name: str) -> runtime.Graph:
    return runtime.load(FOLDER / f"{name}.yaml")


@pytest.mark.parametrize("path", GRAPHS, ids=lambda path: path.stem)
def test_each_is_short_without_python_and_has_a_study(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 60
    assert "module:" not in text
    runtime.load(path).check()
    study = (STUDIES / path.name).read_text(encoding="utf-8")
    assert f"gallery/papers/{path.name}" in study
    assert path in [each.path for each in shipped("gallery/papers")]


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_ring_of_rates_turns_with_the_head(engine: str) -> None:
    """By -tau omega w' the bump moves at omega exactly; the reading of it lags by its synapses."""
    ring = graph("head_direction").set("ring.neuron.spikes", "none").set("params.n", 60)
    run = ring.run(engine=engine)
    times = 0.01 * np.arange(len(run["error"]))
    turning = (times > 2.1) & (times < 3.9)
    head, error = run["directions"][:, 0], run["error"]
    assert np.ptp(head) > 0.9
    lag = np.polyfit(np.gradient(head, 0.01)[turning], error[turning], 1)[0]
    # 0.05 s of the reading. The currents pass the synapses, of 0.02 s, before omega multiplies
    # them, and not after it, as in the equation: which is the same while omega changes slowly.
    assert abs(lag + 0.05) < 0.02
    # A bump of so few neurons rests half way between two of them.
    assert np.abs(error[times > 4.5]).max() < 1.01 * np.pi / 60


@pytest.mark.slow
def test_noise_moves_a_ring_the_less_the_more_neurons_it_has() -> None:
    """The variance of a drift by independent noise falls as 1/n: by 8 for 8 times the neurons."""
    drift = {}
    for n in (50, 400):
        ring = graph("head_direction").set("params.n", n).set("ring.neuron.spikes", "regular")
        runs = (ring.with_seed(seed).run(engine="compiled") for seed in range(8))
        drift[n] = np.mean([run.metrics["drift"] ** 2 for run in runs])
    assert 3.0 < drift[50] / drift[400] < 30.0


@pytest.mark.slow
def test_a_shut_gate_keeps_distractors_out_of_the_memory() -> None:
    memory = graph("gated_memory")
    shut, opened = (each.run(engine="compiled") for each in (memory, memory.without("shut")))
    assert shut.metrics["hits"] == 1.0
    items, others = shut["similarity"][-1][:4], shut["similarity"][-1][4:]
    assert items.min() > 0.3 > others.max()
    assert opened.metrics["hits"] < 1.0
    # With the gate open, distractors are as much in the memory as items.
    last = opened["similarity"][-1]
    assert last[4:].mean() > 0.5 * last[:4].mean()


@pytest.mark.slow
def test_encoders_that_turn_to_the_keys_halve_the_error_of_recall() -> None:
    pairs = graph("associations")
    fixed = pairs.set("neurons.learning.learning_rate", 0)
    learnt, kept = (each.run(engine="compiled").metrics["error"] for each in (pairs, fixed))
    assert learnt < 0.5 * kept


@pytest.mark.slow
def test_a_field_is_learnt_and_leaves_an_after_effect_to_the_other_side() -> None:
    reaching = graph("curl_field")
    run, without = (
        each.run(engine="compiled")
        for each in (reaching, reaching.set("params.learning_rate", 0.0))
    )
    # Without a field and neurons, the known dynamics of the arm hold it on the straight line.
    assert without.metrics["before"] < 1e-3
    assert without.metrics["first"] > 10.0
    assert run.metrics["last"] < 0.25 * without.metrics["last"]
    assert run.metrics["after_effect"] > 10.0 * without.metrics["after_effect"]
    times = 0.02 * np.arange(len(run["deviation"]))
    in_field, after = (times > 16) & (times < 32), times > 112
    pushed = without["deviation"].ravel()[in_field].mean()
    assert np.sign(pushed) == -np.sign(run["deviation"].ravel()[after].mean())
