"""Sessions with a plant of MuJoCo: snapshots, branches and what is saved have its whole state."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runtime
from runtime.graph import open_session
from tests.runtime.sessions.test_session import TICKS, same

pytest.importorskip("mujoco")


@pytest.mark.parametrize("engine", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
def test_a_session_with_a_plant_of_mujoco(engine: str, tmp_path: Path) -> None:
    """What MuJoCo keeps of the robot goes back with a snapshot, and into a branch."""
    graph = runtime.load("wall_following_mujoco")
    ticks = 5 * TICKS  # the robot has begun to move
    whole = graph.run(until=ticks * graph.network.dt, engine=engine)
    session = graph.session(engine=engine).step(2 * TICKS)
    saved, pose = session.snapshot(), session.read("plant.pose")
    other = session.branch()
    session.step(ticks)
    assert not np.array_equal(session.read("plant.pose"), pose)
    session.restore(saved)
    assert session.tick == 2 * TICKS and np.array_equal(session.read("plant.pose"), pose)
    for each in (session, other):
        for _ in range(TICKS):
            each.step()
        each.step(2 * TICKS)
        assert same(whole, each.result()) == []
    session.restore(saved)
    session.set("explore.engage_distance", 0.7)
    session.step(TICKS)
    again = open_session(session.save(tmp_path / "saved"))
    assert same(session.result(), again.result()) == []
