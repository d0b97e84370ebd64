"""What a world's description may hold, and what the errors say."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from blocks import ParameterError
from blocks.world.reader import read_shapes
from blocks.world.world import World

SQUARE = [[-2, -2], [2, -2], [2, 2], [-2, 2]]


@pytest.mark.parametrize(
    ("description", "problems"),
    [
        (None, [("", "expected a mapping with room, obstacles or circles, got nothing (null)")]),
        ([1], [("", "expected a mapping with room, obstacles or circles, got [1]")]),
        (
            {},
            [("", "a world without walls; expected at least one of room, obstacles or circles")],
        ),
        (
            {"room": None, "obstacles": [], "circles": None},
            [("", "a world without walls; expected at least one of room, obstacles or circles")],
        ),
        ({"rom": SQUARE}, [("rom", "unknown entry, did you mean 'room'?")]),
        (
            {"room": SQUARE, 3: 1},
            [("3", "unknown entry; a world has room, obstacles, circles")],
        ),
        ({"room": "4x4"}, [("room", "expected a list of corners [x, y], got the string '4x4'")]),
        (
            {"room": [[0, 0], [1, 0]]},
            [("room", "a polygon needs at least 3 corners, got 2")],
        ),
        (
            {"room": [[0, 0], [1, "a"], [True, 1], [0, 1, 2]]},
            [
                ("room[1]", "expected 2 numbers [x, y] in m, got [1, 'a']"),
                ("room[2]", "expected 2 numbers [x, y] in m, got [True, 1]"),
                ("room[3]", "expected 2 numbers [x, y] in m, got [0, 1, 2]"),
            ],
        ),
        (
            {"room": [[0, 0], [1, 0], [1, math.inf]]},
            [("room[2]", "expected 2 numbers [x, y] in m, got [1, inf]")],
        ),
        (
            {"room": [[0, 0], [1, 0], [1, 0], [0, 1]]},
            [("room[2]", "the same point as corner 1; an edge needs a length")],
        ),
        (
            {"room": [[0, 0], [1, 0], [0, 1], [0, 0]]},
            [("room[0]", "the same point as corner 3; a polygon closes by itself")],
        ),
        (
            {"room": [[0, 0], [1, 1], [1, 0], [0, 1]]},
            [("room", "the edges from corners 0 and 2 cross")],
        ),
        ({"room": [[0, 0], [1, 1], [2, 2]]}, [("room", "the polygon encloses no area")]),
        (
            {"obstacles": {"a": SQUARE}},
            [("obstacles", "expected a list of obstacles, got a mapping")],
        ),
        (
            {"obstacles": [SQUARE, 7, [[0, 0], [1, 0]]]},
            [
                ("obstacles[1]", "expected a list of corners [x, y], got 7"),
                ("obstacles[2]", "a polygon needs at least 3 corners, got 2"),
            ],
        ),
        (
            {"circles": [[0, 0, 1], [0, 0], [0, 0, 0], [0, 0, -1], [0, math.nan, 1]]},
            [
                ("circles[1]", "expected 3 numbers [x, y, r] in m, got [0, 0]"),
                ("circles[2]", "expected a radius above 0 m, got 0"),
                ("circles[3]", "expected a radius above 0 m, got -1"),
                ("circles[4]", "expected 3 numbers [x, y, r] in m, got [0, nan, 1]"),
            ],
        ),
        (
            {"circles": [[0, 0, 1], [2e6, 0, 1], [0, 0, 10**400]]},
            [
                ("circles[1]", "expected lengths up to 10000 m, got [2000000.0, 0, 1]"),
                ("circles[2]", "expected lengths up to 10000 m, got a list of 3 items"),
            ],
        ),
        (
            {"room": SQUARE, "circles": [[0, 0, 3]]},
            [("room", "the obstacles leave no free space in it")],
        ),
    ],
)
def test_every_wrong_entry_is_named(description: Any, problems: list[tuple[str, str]]) -> None:
    with pytest.raises(ParameterError) as caught:
        World(description)
    assert caught.value.problems == problems


def test_free_space_is_to_the_left_of_every_edge() -> None:
    for room in (SQUARE, SQUARE[::-1]):
        shapes = read_shapes({"room": room, "obstacles": [room], "circles": [(0, 0, 1)]})
        assert shapes.room is not None
        for corners, sign in ((shapes.room, 1.0), (shapes.obstacles[0], -1.0)):
            x, y = corners.T
            area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
            assert area == sign * 16.0
        assert shapes.circles.shape == (1, 3)
