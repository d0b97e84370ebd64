"""What can take the place of the LQR and of the ensembles, in the graphs that are shipped."""

from __future__ import annotations

import pytest

import runtime

SHIPPED = (
    "line_actuator_failure",
    "line_actuator_failure_robust",
    "sine_estimation_error",
    "sine_estimation_error_robust",
    "wall_following",
    "wall_following_robust",
)
TRACKERS = ("PathPID", "PurePursuit", "Stanley", "LQI", "DisturbanceObserver", "L1Adaptive", "MPC")
# These keep the graph's weights, which are soft on purpose in case A.
WEIGHED = ("LQI", "MPC")
# What they learn while the robot explores, with no wall to follow, is wrong.
INTEGRATING = ("LQI", "DisturbanceObserver", "L1Adaptive")
LEARNERS = ("AdaptiveBias", "RateEnsemble", "MRAC")


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("rival", [*TRACKERS, *LEARNERS])
@pytest.mark.slow
def test_it_runs_in_every_graph_on_the_same_wires(name: str, rival: str) -> None:
    graph = runtime.load(name)
    ensembles = [key for key in graph.network.entries if key.startswith("adaptive.snn_")]
    assert len(ensembles) == (1 if name.endswith("_robust") else 2)
    changed = graph
    for place in ["lqr"] if rival in TRACKERS else ensembles:
        changed = changed.replace(place, rival)
    assert changed.run(until=0.2).status == "complete"

    def wires(of: runtime.Graph) -> set[tuple[str, str]]:
        return {(wire.target, str(wire.source)) for wire in of.network.wires}

    assert wires(changed) == wires(graph)


@pytest.mark.parametrize("rival", [name for name in TRACKERS if name not in WEIGHED])
def test_without_tuning_it_comes_to_the_line_with_half_the_turn_rate(rival: str) -> None:
    graph = runtime.load("line_actuator_failure").without("adaptive").replace("lqr", rival)
    result = graph.set("plots", {}).run()
    assert result.metrics["converged_at"] < 12.0
    assert result.metrics["distance"] > 16.0


@pytest.mark.parametrize(
    "rival",
    [pytest.param(name, marks=[pytest.mark.slow] * (name != "PathPID")) for name in TRACKERS],
)
def test_without_tuning_it_follows_the_walls(rival: str) -> None:
    graph = runtime.load("wall_following").without("adaptive").replace("lqr", rival)
    if rival in INTEGRATING:
        graph = graph.connect("learning.out", "lqr.learn")
    result = graph.set("plots", {}).run(until=40.0)
    assert result.metrics["distance_mae"] < 0.015
    assert result.metrics["contacts"] == 0.0
    assert result.metrics["loops"] > 0.25


@pytest.mark.parametrize(
    "rival",
    [pytest.param(name, marks=[pytest.mark.slow] * (name != "RateEnsemble")) for name in LEARNERS],
)
def test_adaptation_without_spikes_finds_the_line_as_well(rival: str) -> None:
    """The robust rule converges, whoever carries it; the soft LQR alone does not within 20 s."""
    graph = runtime.load("line_actuator_failure_robust").set("plots", {})
    graph = graph.replace("adaptive.snn_omega", rival)
    assert graph.run().metrics["converged_at"] < 12.0
    assert graph.without("adaptive").run().metrics["converged_at"] is None
