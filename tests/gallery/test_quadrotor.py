"""The quadrotor in wind: its filter uses each fix once, and neurons learn the force of the wind."""

from __future__ import annotations

import numpy as np
import pytest

import runtime

NAME = "gallery/papers/quadrotor"


@pytest.mark.slow
def test_both_engines_fly_the_same() -> None:
    short = runtime.load(NAME).set("run.until", 0.25).probe("estimate", "ekf.estimate")
    python, compiled = (short.run(engine=engine) for engine in ("python", "compiled"))
    for name in python.probes:
        np.testing.assert_array_equal(python[name], compiled[name])


@pytest.mark.slow
def test_the_estimator_is_as_good_as_it_says_and_a_held_fix_is_not() -> None:
    graph = runtime.load(NAME).probe("p", "ekf.P").probe("estimate", "ekf.estimate")
    graph = graph.probe("position", "quad.position")
    run = graph.run(engine="compiled")
    assert run.metrics["estimator_error"] < 0.034
    # The errors are those of the filter's own covariance.
    p = run["p"].reshape(-1, 13, 13)[1000:]
    own = np.sqrt(np.einsum("kii->k", p[:, :3, :3]).mean())
    assert 0.7 < run.metrics["estimator_error"] / own < 1.4
    held = graph.set("ekf.measurements.gps.dt", 0.004)
    assert any("new every 0.2 s, and is used every 0.004 s" in note for note in held.network.notes)
    assert held.run(engine="compiled").metrics["estimator_error"] > 0.1


@pytest.mark.slow
def test_neurons_take_away_what_the_wind_adds() -> None:
    graph = runtime.load(NAME)
    with_them = graph.run(engine="compiled").metrics["tracking_error"]
    without = graph.without("learnt").run(engine="compiled").metrics["tracking_error"]
    assert with_them < 0.5 * without
