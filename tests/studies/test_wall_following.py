"""Case C as a whole: the loop of the paper's room, with and without half of the turn rate."""

from __future__ import annotations

import numpy as np
import pytest

import runtime
from runtime.document.loader import SHIPPED

WORLDS = sorted(path.stem for path in (SHIPPED / "worlds").glob("*.yaml"))
CONDITIONS = sorted(path.stem for path in (SHIPPED / "conditions").glob("*.yaml"))
LOSS = "conditions/turn_loss_50.yaml"


@pytest.mark.slow
def test_the_room_is_looped_without_a_touch() -> None:
    metrics = (
        runtime.load("wall_following").without("adaptive").set("plots", {}).run(seed=30).metrics
    )
    assert metrics["loops"] > 1.0
    assert metrics["contacts"] == 0.0
    assert metrics["distance_floor"] < metrics["distance_mae"] < 0.025


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 30])
def test_the_robust_rule_makes_up_for_half_of_the_turn_rate(seed: int) -> None:
    """Without a touch; seed 0 is the run of the README."""
    robust = runtime.load("wall_following_robust").overlay(LOSS).set("plots", {})
    feedforward = runtime.load("wall_following").without("adaptive").overlay(LOSS).set("plots", {})
    ours, theirs = robust.run(seed=seed).metrics, feedforward.run(seed=seed).metrics
    assert ours["loops"] > 1.0
    assert ours["distance_mae"] < 0.015
    assert ours["distance_mae"] < 0.5 * theirs["distance_mae"]
    assert ours["contacts"] == 0.0
    assert ours["clearance"] > 0.01
    assert theirs["contacts"] > 0.05
    assert theirs["clearance"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
def test_the_robust_rule_forgets_a_fault_that_has_gone() -> None:
    """Half of the turn rate is lost from 60 to 90 s, which nothing was tuned on in this graph."""
    fault = {"gain": [1.0, 0.5], "start": 60.0, "stop": 90.0}
    graph = runtime.load("wall_following_robust").overlay({"blocks": {"fault": fault}})
    result = graph.set("plots", {}).run(seed=30)
    error = np.abs(graph.network.world.distance(result["pose"][:, :2]) - 0.18)
    time = result.time("pose")
    before, after = (
        error[(time >= start) & (time < stop)].mean() for start, stop in ((20, 60), (100, 130))
    )
    assert after < 1.5 * before < 0.01
    assert result.metrics["contacts"] == 0.0


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize(
    "name", ["wall_following", pytest.param("wall_following_robust", marks=pytest.mark.slow)]
)
def test_every_condition_lies_on_either_graph(name: str, condition: str) -> None:
    graph = runtime.load(name).overlay(f"conditions/{condition}.yaml").set("plots", {})
    assert graph.run(until=1.0).status == "complete"


@pytest.mark.parametrize(
    "world",
    [
        pytest.param(world, marks=[] if world == "paper_room" else pytest.mark.slow)
        for world in WORLDS
    ],
)
@pytest.mark.slow
def test_the_robot_reaches_a_wall_in_every_world(world: str) -> None:
    path = str(SHIPPED / "worlds" / f"{world}.yaml")
    graph = runtime.load("wall_following").without("adaptive").set("plots", {})
    metrics = graph.overlay({"world": path}).run(until=40.0).metrics
    assert metrics["time_to_engage"] is not None
    assert metrics["distance_mae"] is not None
    assert metrics["distance_mae"] < 0.05


def test_a_robot_that_sees_nothing_searches_slowly() -> None:
    """Beams that are all lost once it follows: no path, so half the explorer's speed."""
    graph = runtime.load("wall_following").without("adaptive").set("plots", {}).set("metrics", {})
    blind = graph.set("lidar.range_max", 0.06).set("blocks.explore.engage_distance", 100.0)
    blind = blind.set("blocks.now", {"type": "Constant", "value": 1})
    blind = blind.wire("follow.select", "now.value")
    result = (
        blind.set("probes.v", "limit.limited").set("probes.valid", "fitter.valid").run(until=3.0)
    )
    assert (result["valid"] == 0.0).all()
    assert abs(result["v"][-1, 0]) == pytest.approx(0.1)


@pytest.mark.parametrize("sighted", ["fitter.valid", "now.value"])
def test_it_learns_nothing_of_a_path_that_it_does_not_see(sighted: str) -> None:
    """Its errors are those of a path that was left standing, while it goes elsewhere."""
    graph = runtime.load("wall_following_robust").set("plots", {}).set("metrics", {})
    blind = graph.set("lidar.range_max", 0.06).set("blocks.now", {"type": "Constant", "value": 1})
    for name in ("follow.select", "learning.select"):
        blind = blind.wire(name, "now.value")
    blind = blind.wire("learning.on", sighted).set("probes.weights", "adaptive.snn_omega.weights")
    weights = blind.run(until=3.0)["weights"]
    assert (weights == 0.0).all() == (sighted == "fitter.valid")
