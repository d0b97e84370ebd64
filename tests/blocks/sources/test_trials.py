"""Schedules of trials, and vectors for items: against the schedule written out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import runtime
from runtime.errors import GraphError, SimulationError


def schedule(until: float = 1.0, engine: str = "python", **params: Any) -> np.ndarray:
    graph = {
        "run": {"dt": 0.1, "until": until, "seed": 2},
        "blocks": {"trials": {"type": "Trials", **params}},
        "probes": {"out": "trials.out"},
    }
    return np.asarray(runtime.load(graph).run(engine=engine)["out"])


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_by_item_each_goes_through_all_phases(engine: str) -> None:
    rows = schedule(1.4, engine, phases={"show": 0.2, "wait": 0.1}, items=2, rounds=2)
    item, trial, phase, elapsed, show, wait = rows.T
    assert item.tolist() == [0, 0, 0, 1, 1, 1, 0, 0, 0, 1, 1, 1, -1, -1]
    assert trial.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4]
    assert phase.tolist() == [0, 0, 1] * 4 + [-1, -1]
    np.testing.assert_allclose(elapsed, [*[0.0, 0.1, 0.0] * 4, 0.0, 0.0], atol=1e-12)
    assert np.array_equal(show, phase == 0)
    assert np.array_equal(wait, phase == 1)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_by_phase_all_items_go_through_one(engine: str) -> None:
    phases = {"train": 0.1, "delay": 0.3, "test": 0.2}
    params = {"phases": phases, "items": 2, "by": "phase", "rounds": [2, 0, 1]}
    rows = schedule(1.2, engine, **params)
    assert rows[:, 0].tolist() == [0, 1, 0, 1, -1, -1, -1, 0, 0, 1, 1, -1]
    assert rows[:, 1].tolist() == [0, 1, 2, 3, 4, 4, 4, 5, 5, 6, 6, 7]
    assert rows[:, 2].tolist() == [0] * 4 + [1] * 3 + [2] * 4 + [-1]


def test_a_shuffled_round_has_every_item_once_and_depends_on_the_seed() -> None:
    params = {"phases": {"a": 0.1}, "items": 8, "rounds": 5, "order": "shuffled"}
    rounds = schedule(4.0, **params)[:, 0].reshape(5, 8)
    assert all(sorted(row) == list(range(8)) for row in rounds.tolist())
    assert len({tuple(row) for row in rounds.tolist()}) == 5
    own = schedule(4.0, **params, seed=2)[:, 0].reshape(5, 8)
    assert np.array_equal(own, rounds)
    assert not np.array_equal(schedule(4.0, **params, seed=3)[:, 0].reshape(5, 8), rounds)


def test_components_are_wired_by_name() -> None:
    graph = {
        "run": {"dt": 0.1, "until": 0.3},
        "blocks": {
            "trials": {"type": "Trials", "phases": {"train": 0.1, "test": 0.2}, "items": 1},
            "gate": {"type": "Gain", "gain": 3.0},
        },
        "wires": {"gate": {"input": "trials.out.test"}},
        "probes": {"out": "gate.out"},
    }
    assert runtime.load(graph).run()["out"].tolist() == [0.0, 3.0, 3.0]


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"phases": {}}, "phases: expected at least one"),
        ({"phases": {"a": 0.0}}, "phases.a: expected a time above 0 s, got 0"),
        ({"phases": {"item": 1.0}}, "'item' cannot name a phase"),
        ({"phases": {"a": 1.0}, "rounds": [1, 2]}, "by item, all phases have the same rounds"),
        ({"phases": {"a": 1.0}, "rounds": [1, 2], "by": "phase"}, "expected one number, or 1"),
        ({"phases": {"a": 1.0}, "rounds": 1.5}, "expected whole numbers"),
        ({"phases": {"a": 1.0}, "rounds": 0}, "expected whole numbers"),
        ({"phases": {"a": 1.0}, "rounds": 1e6}, "at most 100000 phases"),
    ],
)
def test_a_wrong_schedule_is_refused(params: dict[str, Any], message: str) -> None:
    with pytest.raises(GraphError, match=message):
        schedule(items=3, **params)


def words(item: float, engine: str = "python", **params: Any) -> Any:
    graph = {
        "run": {"dt": 0.1, "until": 0.1, "seed": 2},
        "blocks": {
            "item": {"type": "Constant", "value": item},
            "words": {"type": "Vocabulary", "items": 20, "dimensions": 8, **params},
            "twice": {"type": "Gain", "gain": 2.0},
        },
        "wires": {
            "words": {"item": "item.value", "input": "twice.out"},
            "twice": {"input": "words.vector"},
        },
        "probes": {
            **{name: f"words.{name}" for name in ("vector", "similarity", "nearest", "vectors")}
        },
    }
    return runtime.load(graph).run(engine=engine)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_vectors_are_of_length_one_and_found_again(engine: str) -> None:
    run = words(7.0, engine, separation=0.8)
    vectors = run["vectors"][0]
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=1e-14)
    products = vectors @ vectors.T - np.eye(20)
    assert np.abs(products).max() <= 0.8
    assert np.array_equal(run["vector"][0], vectors[7])
    np.testing.assert_allclose(run["similarity"][0], 2.0 * vectors @ vectors[7], rtol=1e-12)
    assert run["nearest"][0] == 7.0


def test_a_negative_item_is_none_and_one_beyond_the_last_an_error() -> None:
    assert not words(-1.0)["vector"].any()
    for engine in ("python", "compiled"):
        with pytest.raises(SimulationError, match="beyond the last one"):
            words(20.0, engine)


def test_too_many_items_for_a_separation_are_refused() -> None:
    with pytest.raises(GraphError, match="separation: after .* items none of 1000"):
        words(0.0, separation=0.05)
