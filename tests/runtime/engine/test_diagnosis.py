"""Diagnoses after a run: in the result, in the manifest, under both engines."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blocks
import runtime
from tests.compilers import skip_without_compiler


@pytest.fixture(params=["python", "compiled"])
def engine(request: pytest.FixtureRequest) -> str:
    if request.param == "compiled":
        skip_without_compiler()
    return str(request.param)


def saturated(omega: float, dt: float | None = None) -> runtime.Graph:
    graph = runtime.Graph(dt=0.01, until=1.0)
    graph = graph.add("go", blocks.Constant(value=[1, omega], signal="Twist"))
    graph = graph.add("limit", blocks.Saturator(omega_max=2.0), dt=dt)
    return graph.connect("go.value", "limit.command").probe("limit.limited_ticks")


def test_a_permanent_saturation_is_noted_with_its_share(engine: str) -> None:
    result = saturated(5.0).run(engine=engine)
    [note] = result.notes
    assert note.startswith(
        "block 'limit': the turn rate was limited to omega_max = 2 rad/s on 100 % of the ticks"
    )
    assert result.manifest["notes"] == [note]
    np.testing.assert_array_equal(result["limit_limited_ticks"][:, 0], np.arange(100))
    assert saturated(-2.0).run(engine=engine).notes == []


def test_ticks_are_those_of_the_block(engine: str) -> None:
    [note] = saturated(5.0, dt=0.03).run(engine=engine).notes
    assert "on 100 % of the ticks" in note


def learning(rate: float, sign: float, **parameters: float) -> runtime.Graph:
    """An integrator that learns the value 1; with the error's sign flipped it diverges."""
    graph = runtime.Graph(dt=0.001, until=1.0)
    graph = graph.add("x", blocks.Constant(value=[0.0], signal="Vector"))
    graph = graph.add("goal", blocks.Constant(value=[1.0], signal="Vector"))
    graph = graph.add("miss", blocks.Sum(signs=[sign, -sign]))
    graph = graph.add("learner", blocks.AdaptiveBias(learning_rate=rate, power=1.0, **parameters))
    graph = graph.connect("x.value", "learner.input").connect("miss.out", "learner.error")
    return graph.connect("learner.output", "miss.terms").connect("goal.value", "miss.terms")


def test_learning_that_converges_has_no_note(engine: str) -> None:
    result = learning(10.0, 1.0).probe("learner.bias").run(engine=engine)
    expected = 1.0 - (1.0 - 0.01) ** np.arange(1000)
    np.testing.assert_allclose(result["learner_bias"][:, 0], expected, rtol=1e-9, atol=1e-12)
    assert result.notes == []


def test_learning_that_diverges_is_noted_with_its_growth(engine: str) -> None:
    """With the sign flipped, b(t) = 1 - (1 + rate dt)^k: its growth over a half run is known."""
    [note] = learning(10.0, -1.0).run(engine=engine).notes
    grown = ((1.01**1000) - 1.0) / ((1.01**500) - 1.0)
    assert note.startswith(f"block 'learner': what it learnt grew {grown:.3g}-fold over the last")


def test_a_windup_at_constant_rate_is_not_a_divergence(engine: str) -> None:
    graph = learning(10.0, 1.0).set("wires.miss.terms", ["x.value", "goal.value"])
    assert graph.run(engine=engine).notes == []


def test_steps_that_overshoot_are_noted_with_their_size(engine: str) -> None:
    """The error is multiplied by 1 - g with g = kappa dt: 1.9 converges, 2.1 does not."""
    assert learning(1900.0, 1.0).run(engine=engine).notes == []
    notes = learning(2100.0, 1.0).run(engine=engine).notes
    assert notes[0].startswith(
        "block 'learner': one step of learning changes the output by 2.1 times the error"
    )
    assert abs(1.0 - 2.1) > 1.0 and math.isfinite(1.1**1000)


def test_an_ensemble_whose_rate_is_too_large() -> None:
    graph = learning(1.0, 1.0).replace("learner", "AdaptiveEnsemble")
    graph = graph.set("learner.learning_rate", 1.0).set("learner.neurons", 20).set("run.until", 0.1)
    assert any("one step of learning changes the output by" in note for note in graph.run().notes)
    calm = graph.set("learner.learning_rate", 1e-4)
    dropped = list(calm.notes)
    assert calm.run().notes == dropped


class Broken(blocks.Block):
    """Its diagnosis fails, which must not end the run."""

    out = blocks.Output(blocks.Scalar)

    def output(self, state, t):
        return 1.0

    def diagnose(self, state, ticks, watched):
        raise ValueError(f"{ticks} ticks, {len(watched)} seen")


def test_a_diagnosis_that_fails_does_not_end_the_run() -> None:
    result = runtime.Graph(dt=0.1, until=1.0).add("b", Broken()).probe("b.out").run()
    assert result["b_out"].tolist() == [1.0] * 10
    assert result.notes == ["block 'b': its diagnose() failed: ValueError: 10 ticks, 0 seen"]
