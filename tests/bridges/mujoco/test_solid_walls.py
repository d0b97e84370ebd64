"""Polygons in convex pieces: the solid side is lined, and free space is left free."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blocks import ParameterError
from blocks.core.signals import FloatArray
from blocks.world.world import World
from spikeblocks.mujoco.solid_walls import OVERLAP, THICKNESS, wall_pieces
from tests.blocks.worlds import OVERLAPPING, SHIPPED, worlds
from tests.examples import examples

ROOMS = [World(OVERLAPPING), *map(World, SHIPPED.values())]


def area(corners: FloatArray) -> float:
    x, y = corners.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def samples(piece: FloatArray, n: int = 9) -> FloatArray:
    """Points inside of a quadrilateral, (n * n, 2)."""
    s, t = (v.ravel()[:, None] for v in np.meshgrid(*2 * [np.linspace(0.02, 0.98, n)]))
    a, b, c, d = piece
    inside: FloatArray = (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d
    return inside


def check(world: World) -> None:
    try:
        pieces = wall_pieces(world)
    except ParameterError as error:
        assert "too sharp" in str(error)
        return
    rings = [*(() if world.room is None else (world.room,)), *world.obstacles]
    edges = [(a, b) for ring in rings for a, b in zip(ring, np.roll(ring, -1, 0), strict=True)]
    assert len(pieces) == len(edges)
    for piece, (a, b) in zip(pieces, edges, strict=True):
        front, length = piece[1] - piece[0], math.dist(a, b)
        for corner in (a, b):
            share = (corner - piece[0]) @ front / (front @ front)
            assert 0.0 <= share <= 1.0, "the edge is on the front"
            assert math.dist(corner, piece[0] + share * front) < 1e-9 * (1.0 + length)
        edge = np.roll(piece, -1, 0) - piece
        onward = np.roll(edge, -1, 0)
        turns = edge[:, 0] * onward[:, 1] - edge[:, 1] * onward[:, 0]
        assert (turns < 0.0).all(), "convex, and on the right of its edge"
        assert (world.distance(samples(piece)) < 1.01 * OVERLAP).all(), "in the solid"


@pytest.mark.parametrize("world", ROOMS)
def test_pieces_are_convex_and_leave_free_space_free(world: World) -> None:
    check(world)


@examples(60)
@given(worlds())
def test_so_they_do_in_any_world(world: World) -> None:
    check(world)


@given(st.floats(0.02, 0.3))
def test_a_thin_wall_is_lined_thinly(thickness: float) -> None:
    """Two rooms side by side: the lining of one must not reach into the other."""
    t = 0.5 * thickness
    corners = [[-2, 0], [2, 0], [2, 2], [t, 2], [t, 0.5], [-t, 0.5], [-t, 2], [-2, 2]]
    world = World({"room": corners})
    check(world)
    assert min(-area(piece) for piece in wall_pieces(world)) < 4.0 * min(thickness, THICKNESS)


def test_a_square_room_has_rectangular_walls_and_a_square_obstacle_mitred_ones() -> None:
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    room = wall_pieces(World({"room": square}))
    wall = [[0, 0], [1.1, 0], [1.1, -0.1], [0, -0.1]]
    np.testing.assert_allclose(room[0], wall, atol=1.01 * OVERLAP)
    assert sum(-area(piece) for piece in room) == pytest.approx(1.2**2 - 1.0, rel=1e-3)
    obstacle = wall_pieces(World({"obstacles": [square]}))
    assert sum(-area(piece) for piece in obstacle) == pytest.approx(1.0 - 0.8**2, rel=1e-3)


def test_what_is_too_thin_is_named() -> None:
    needle = [[0, 0], [1, 0], [1, 1e-4]]
    with pytest.raises(ParameterError, match=r"world.obstacles\[0\]: .* too sharp"):
        wall_pieces(World({"obstacles": [needle]}))
