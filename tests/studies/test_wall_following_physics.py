"""Case C with rigid-body physics as a whole."""

from __future__ import annotations

import numpy as np
import pytest

import runtime
from runtime.document.loader import SHIPPED

GRAPHS = ("wall_following_mujoco", "wall_following_mujoco_robust")
FAULTS = sorted(path.stem for path in (SHIPPED / "wheel_faults").glob("*.yaml"))
LOSS = "wheel_faults/turn_loss_35.yaml"
RUNNING = ("plots", "metrics")


def quick(name: str) -> runtime.Graph:
    """A graph without pictures and metrics, which need a longer run."""
    graph = runtime.load(name)
    for section in RUNNING:
        graph = graph.set(section, {})
    return graph


@pytest.mark.slow
def test_the_robust_controller_loops_the_room_with_a_third_of_its_turn_rate_lost() -> None:
    """On odometry alone, without a touch, and nearer to the stand-off than without a network."""
    robust = runtime.load("wall_following_mujoco_robust").overlay(LOSS).set("plots", {})
    plain = runtime.load("wall_following_mujoco").without("adaptive").overlay(LOSS)
    ours = robust.run(seed=30, until=110.0).metrics
    theirs = plain.set("plots", {}).run(seed=30, until=110.0).metrics
    assert ours["loops"] > 1.0
    assert ours["contacts"] == 0.0
    assert ours["distance_floor"] < ours["distance_mae"] < 0.015
    assert ours["distance_mae"] < 0.5 * theirs["distance_mae"]


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", GRAPHS)
def test_every_wheel_fault_lies_on_either_graph(name: str, fault: str) -> None:
    graph = quick(name).overlay(f"wheel_faults/{fault}.yaml")
    assert graph.run(until=0.5).status == "complete"


def test_the_graph_changes_by_its_plant_and_lidar_alone() -> None:
    planar, physics = (runtime.load(name).network for name in ("wall_following", GRAPHS[0]))
    assert set(planar.entries) - set(physics.entries) == {"lidar"}
    assert set(physics.entries) <= set(planar.entries)
    differ = {
        name for name, entry in physics.entries.items() if entry.block != planar.entries[name].block
    }
    # The stand-off counts from the robot's centre, so explorer and fitter have another number.
    assert differ == {"plant", "explore", "fitter"}


def test_nothing_that_steers_sees_the_true_pose() -> None:
    network = runtime.load(GRAPHS[0]).network
    used = {str(wire) for wire in network.wires}
    assert any("plant.odometry" in wire for wire in used)
    assert not any("plant.pose" in wire for wire in used)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits() -> None:
    runs = [quick(GRAPHS[1]).run(seed=seed, until=8.0) for seed in (5, 5, 6)]
    for name in ("physics", "scan", "adaptive"):
        assert runs[0][name].tobytes() == runs[1][name].tobytes()
    assert not np.array_equal(runs[0]["scan"], runs[2]["scan"])
