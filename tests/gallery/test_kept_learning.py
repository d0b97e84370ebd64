"""What docs/learning.md shows of graphs/gallery/adaptive_arm.yaml, on shorter runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runtime

GRAPH = Path(__file__).parents[2] / "graphs" / "gallery" / "adaptive_arm.yaml"


@pytest.mark.slow
def test_what_is_learnt_under_one_fault_helps_under_another(tmp_path: Path) -> None:
    arm = runtime.load(GRAPH)
    trained = arm.run(until=8.0).save(tmp_path / "trained")
    other = arm.set("params.strength", 0.8).set("params.load", 1.5).set("run.until", 2.0)
    kept = {name: str(trained) for name in ("neurons", "learnt")}
    frozen = other.set("params.learning_rate", 0.0)
    variants = {
        "scratch": other,
        "PD alone": frozen,
        "frozen": frozen.set("initial", kept),
        "continued": other.set("initial", kept),
    }
    runs = {name: graph.run(seed=3) for name, graph in variants.items()}
    error = {name: run.metrics["rms_error"] or np.nan for name, run in runs.items()}
    assert error["frozen"] < 0.8 * error["PD alone"]
    assert error["continued"] < 0.9 * error["scratch"]
    weights = {name: run["weights"] for name, run in runs.items()}
    assert np.array_equal(weights["frozen"][0], weights["frozen"][-1])
    assert np.array_equal(weights["frozen"][0], weights["continued"][0])
    assert not weights["PD alone"].any()
