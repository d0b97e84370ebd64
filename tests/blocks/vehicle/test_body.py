"""Bodies in the world: a car is held at a wall, and the clearance of any pose is measured."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import runtime
from blocks import Contact, ParameterError
from blocks.core.signals import FloatArray
from blocks.world.world import World
from tests.blocks.worlds import OVERLAPPING, SQUARE, started, worlds

CAR = np.array([[-0.1, -0.1], [0.3, -0.1], [0.3, 0.1], [-0.1, 0.1]])
SPACING = 0.002
poses = st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-4, 4))


def measured(world: World, body: Any, pose: tuple[float, float, float]) -> tuple[Any, ...]:
    block = Contact(body=body)
    return block.output(started(block, world), 0.0, pose)


def placed(outline: FloatArray, pose: tuple[float, float, float]) -> FloatArray:
    x, y, theta = pose
    turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
    return outline @ turn.T + (x, y)


def boundary(corners: FloatArray) -> FloatArray:
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    dense = [
        np.linspace(a, b, max(2, math.ceil(np.hypot(*(b - a)) / SPACING)), endpoint=False)
        for a, b in sides
    ]
    return np.concatenate(dense)


@settings(deadline=None, max_examples=60)
@given(worlds(), poses)
def test_the_clearance_of_a_polygon_is_the_least_of_its_dense_outline(
    world: World, pose: tuple[float, float, float]
) -> None:
    gap, contact, normal = measured(world, CAR.tolist(), pose)
    corners = placed(CAR, pose)
    least = world.distance(boundary(corners)).min()
    if least > SPACING and gap > 0.0:
        assert least - SPACING <= gap <= least + 1e-9
    elif least < -SPACING:
        assert gap <= 0.0
    assert contact == (gap <= 1e-6)
    assert np.hypot(*normal) == pytest.approx(1.0)


def test_a_post_in_the_middle_of_a_body_is_a_contact() -> None:
    """No point of the outline is in a surface, and the body is around one."""
    world = World({"room": SQUARE, "circles": [[0.1, 0.0, 0.02]]})
    gap, contact, _ = measured(world, CAR.tolist(), (0.0, 0.0, 0.0))
    assert gap == pytest.approx(-0.12)
    assert contact == 1.0


def test_a_thin_wall_across_a_body_is_a_contact() -> None:
    """Only sides cross: no corner of one is in the other."""
    world = World({"room": SQUARE, "obstacles": [[[0.0, -1], [0.05, -1], [0.05, 1], [0.0, 1]]]})
    gap, contact, _ = measured(world, CAR.tolist(), (0.0, 0.0, 0.0))
    assert (gap, contact) == (0.0, 1.0)


def test_the_clearance_of_a_disc_has_its_closed_form() -> None:
    world = World({"room": SQUARE})
    gap, contact, normal = measured(world, 0.25, (1.5, 0.3, 2.0))
    assert gap == pytest.approx(0.25, abs=1e-12)
    assert contact == 0.0
    np.testing.assert_allclose(normal, [-1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("body", "text"),
    [
        (0.0, "expected a radius above 0 m, got 0"),
        ([[0, 0], [1, 0]], "expected a radius or at least three corners, got 2"),
    ],
)
def test_a_body_without_an_extent_is_refused(body: Any, text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        Contact(body=body)


def graph(car: dict[str, Any], **more: Any) -> dict[str, Any]:
    blocks = {
        "v": {"type": "Constant", "value": 1.0},
        "s": {"type": "Constant", "value": 0.0},
        "car": {"type": "Bicycle", "x0": [0.5, 1.0, 0.4], **car},
    }
    return {
        "run": {"dt": 0.01, "until": 3.0, **more.pop("run", {})},
        "world": {"room": [[0, 0], [2, 0], [2, 2], [0, 2]]},
        "blocks": {**blocks, **more.pop("blocks", {})},
        "wires": {"car": {"v": "v.value", "steering": "s.value"}, **more.pop("wires", {})},
        "probes": {"pose": "car.pose"},
        **more,
    }


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("solver", ["euler", "rk4", "dopri5"])
def test_a_car_slides_along_the_wall_and_stays_in_the_corner(engine: str, solver: str) -> None:
    made = runtime.load(graph({"body_radius": 0.2}, run={"engine": engine, "solver": solver}))
    pose = made.run()["pose"]
    assert made.check().network.notes == ()
    assert pose[:, :2].max() <= 1.8 + 1e-9
    np.testing.assert_allclose(pose[-1], [1.8, 1.8, 0.4], atol=1e-9)
    # Along the wall only the tangential part of the speed remains.
    along = pose[(pose[:, 0] > 1.8 - 1e-9) & (pose[:, 1] < 1.8 - 0.01), 1]
    np.testing.assert_allclose(np.diff(along), 0.01 * math.sin(0.4), atol=1e-6)


def test_a_body_in_a_wall_is_refused_where_it_starts() -> None:
    with pytest.raises(runtime.GraphError, match=r"blocks\.car\.x0: a body of radius 0\.6 m does"):
        runtime.load(graph({"body_radius": 0.6})).check()


def test_a_pose_that_nothing_tests_against_the_walls_is_a_note() -> None:
    (note,) = runtime.load(graph({})).check().network.notes
    assert note == (
        "block 'car': passes through the walls of the world: nothing stops or measures it; give it "
        "a body_radius, or wire car.pose to a Contact"
    )
    own = graph(
        {},
        blocks={
            "car": {
                "type": "DynamicSystem",
                "derivative": ["1", "0", "0"],
                "initial": [0.5, 1, 0],
                "signal": "Pose",
            }
        },
        wires={"car": {}},
        probes={"pose": "car.out"},
    )
    (note,) = runtime.load(own).check().network.notes
    assert "block 'car'" in note and "; wire car.out to a Contact" in note


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_run_stops_where_the_body_first_touches(engine: str) -> None:
    """The nose, 0.3 m ahead of the pose, is at the wall x = 2 after 1.2 s."""
    touching = graph(
        {"x0": [0.5, 1.0, 0.0]},
        run={"engine": engine, "stop": {"when": "touch.clearance", "below": 0}},
        blocks={"touch": {"type": "Contact", "body": CAR.tolist()}},
        wires={"touch": {"pose": "car.pose"}},
        metrics={"at": {"kind": "stop_time"}},
    )
    result = runtime.load(touching).run()
    assert result.status == "stopped"
    assert result.metrics["at"] == pytest.approx(1.2, abs=1e-9)


def test_the_surfaces_of_overlapping_solids_count_once() -> None:
    world = World(OVERLAPPING)
    for pose in [(0.0, -1.2, 0.3), (-1.0, 1.2, 1.0), (0.9, 0.9, -2.0)]:
        gap, _, _ = measured(world, CAR.tolist(), pose)
        least = float(world.distance(boundary(placed(CAR, pose))).min())
        assert gap == pytest.approx(least, abs=SPACING) or gap <= 0.0 >= least
