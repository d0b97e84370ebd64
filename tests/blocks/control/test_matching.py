"""The matching point against brute force, and laws of the distance travelled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
from blocks.core.signals import FloatArray
from tests.blocks.direct import state_of
from tests.examples import examples

Pose = tuple[float, float, float]


class Walk:
    """A matching point that is asked tick by tick."""

    def __init__(self, **parameters: Any) -> None:
        self.block = blocks.MatchingPoint(**parameters)
        self.state = state_of(self.block)

    def __call__(self, path: FloatArray, x: float, y: float) -> Any:
        out = self.block.output(self.state, 0.0, (x, y, 0.3), path)
        reference, _, _, index, progress = out
        self.block.update(self.state, 0.0, reference, index, progress)
        return out

    def index(self, path: FloatArray, x: float, y: float) -> int:
        return int(self(path, x, y)[3])

    def way(self, path: FloatArray, x: float, y: float) -> float:
        return float(self(path, x, y)[4])


def nearest(path: FloatArray, x: float, y: float, among: range | None = None) -> int:
    """Brute force: the sample at the least distance, over indices modulo the length."""
    indices = [i % len(path) for i in among or range(len(path))]
    return min(indices, key=lambda i: (path[i, 0] - x) ** 2 + (path[i, 1] - y) ** 2)


def distance(path: FloatArray, index: float, x: float, y: float) -> float:
    return math.hypot(path[int(index), 0] - x, path[int(index), 1] - y)


SINE = blocks.SinePath(x_end=20.0, samples=501).sampled
CIRCLE = blocks.CirclePath(radius=2.0, samples=400).sampled
places = st.tuples(st.floats(-3.0, 23.0), st.floats(-4.0, 4.0))


@given(places)
def test_first_tick_searches_the_whole_path(place: tuple[float, float]) -> None:
    index = Walk(window=0.1).index(SINE, *place)
    assert distance(SINE, index, *place) == distance(SINE, nearest(SINE, *place), *place)


@examples(60)
@given(st.lists(places, min_size=2, max_size=6), st.floats(0.1, 30.0))
def test_later_ticks_search_the_window(spots: list[tuple[float, float]], window: float) -> None:
    walk, spacing = Walk(window=window), math.hypot(*(SINE[1, :2] - SINE[0, :2]))
    last = walk.index(SINE, *spots[0])
    for spot in spots[1:]:
        reach = max(1, round(window / spacing))
        among = range(max(0, last - reach), min(len(SINE), last + reach + 1))
        index = walk.index(SINE, *spot)
        assert abs(index - last) <= reach
        best = nearest(SINE, *spot, among)
        assert distance(SINE, index, *spot) == pytest.approx(distance(SINE, best, *spot))
        last = index


@examples(60)
@given(st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4)), min_size=2, max_size=8), st.data())
def test_a_closed_path_has_no_end(spots: list[tuple[float, float]], data: st.DataObject) -> None:
    window = data.draw(st.floats(0.05, 8.0))
    walk = Walk(window=window)
    last = walk.index(CIRCLE, *spots[0])
    reach = max(1, round(window / math.hypot(*(CIRCLE[1, :2] - CIRCLE[0, :2]))))
    for spot in spots[1:]:
        index = walk.index(CIRCLE, *spot)
        best = nearest(CIRCLE, *spot, range(last - reach, last + reach + 1))
        # In the centre all samples are equally near, to the last bit.
        assert distance(CIRCLE, index, *spot) == pytest.approx(distance(CIRCLE, best, *spot))
        around = abs(index - last) % len(CIRCLE)
        assert min(around, len(CIRCLE) - around) <= reach
        last = index


def test_a_crossing_does_not_catch_the_window() -> None:
    """On a figure of eight the other branch is nearer at the crossing, and further along."""
    t = np.linspace(0.0, math.tau, 801)[:-1]
    points = np.column_stack((4.0 * np.sin(t), 2.0 * np.sin(2.0 * t)))
    path = blocks.WaypointPath(points=points[::8].tolist(), closed=True, samples=800).sampled
    walk, near = Walk(window=0.5), Walk(window=100.0)
    followed = [walk.index(path, *path[i, :2]) for i in range(380)]
    assert followed == list(range(380))
    # Just before the crossing at the middle, the crossing branch is closer to a robot beside it.
    here, beside = path[395, :2], path[4, :2]
    spot = (0.2 * here[0] + 0.8 * beside[0], 0.2 * here[1] + 0.8 * beside[1])
    near.index(path, *path[380, :2])
    assert near.index(path, *spot) < 20
    assert abs(walk.index(path, *spot) - 395) < 20


@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("samples", [400, 401, 7])
def test_distance_travelled_over_several_laps(turn: float, clockwise: bool, samples: int) -> None:
    """Three laps across the seam, in both directions: the distance is the arc, to a sample."""
    path = blocks.CirclePath(radius=2.0, samples=samples, clockwise=clockwise).sampled
    walk = Walk(window=4.0)
    spacing = math.hypot(*(path[1, :2] - path[0, :2]))
    distances = []
    for angle in np.linspace(0.0, turn * 3.0 * math.tau, 600):
        radius = 2.0 + 0.5 * math.sin(5.0 * angle)
        distances.append(walk.way(path, radius * math.cos(angle), radius * math.sin(angle)))
        along = angle / math.tau * samples * spacing * (-1.0 if clockwise else 1.0)
        assert abs(distances[-1] - along) <= 0.5 * spacing + 1e-9
    assert distances[0] == 0.0
    assert abs(distances[-1]) == pytest.approx(3.0 * samples * spacing)


def test_way_gone_is_zero_there_and_back() -> None:
    walk = Walk()
    xs = np.concatenate((np.linspace(2.0, 9.0, 80), np.linspace(9.0, 2.0, 77)))
    distances = [walk.way(SINE, x, math.sin(x)) for x in xs]
    assert distances[0] == 0.0
    assert distances[-1] == pytest.approx(0.0, abs=1e-12)
    assert max(distances) > 7.0


@pytest.mark.parametrize("path", [SINE, CIRCLE])
def test_a_window_below_the_spacing_still_reaches_the_next_sample(path: FloatArray) -> None:
    """One sample in either direction at a time, however far the robot has moved."""
    walk = Walk(window=1e-6)
    walk.index(path, *path[10, :2])
    assert [walk.index(path, *path[50, :2]) for _ in range(3)] == [11, 12, 13]
    assert [walk.index(path, *path[0, :2]) for _ in range(3)] == [12, 11, 10]


def test_the_papers_coefficient_is_the_default() -> None:
    assert blocks.MatchingPoint().alpha == 0.06


def test_an_open_path_stops_at_its_ends() -> None:
    walk = Walk(window=1.0)
    assert walk.index(SINE, 0.5, 0.4) < 20
    for x in np.linspace(0.5, -3.0, 30):
        index = walk.index(SINE, x, 0.0)
    assert index == 0
    walk = Walk(window=1.0)
    for x in np.linspace(19.0, 25.0, 30):
        index = walk.index(SINE, x, math.sin(20.0))
    assert index == len(SINE) - 1


def line(offset: float, n: int = 401) -> FloatArray:
    return blocks.LinePath(y=offset, x_start=-10.0, x_end=30.0, samples=n).sampled


def test_a_new_path_is_searched_around_the_last_reference() -> None:
    """The new path starts elsewhere, so the same index would be 10 m off."""
    walk = Walk(window=0.5)
    old, new = line(0.0), blocks.LinePath(y=0.1, x_start=0.0, x_end=40.0, samples=401).sampled
    assert old[walk.index(old, 5.0, 0.3), 0] == pytest.approx(5.0)
    out = walk(new, 5.2, 0.3)
    assert out[0][:2] == pytest.approx((5.2, 0.1))
    assert out[3] == 52.0
    # The distance counts from the sample of the new path that is nearest to the last reference.
    assert out[4] == pytest.approx(0.2)
    # Out of the window of the new path, too: 9 m further on, 0.5 m at a time.
    assert new[walk.index(new, 14.2, 0.3), 0] == pytest.approx(5.7)


def test_the_way_goes_on_over_new_paths() -> None:
    walk = Walk()
    for tick, x in enumerate(np.linspace(0.0, 8.0, 81)):
        path = line(0.02 * math.sin(tick), 401 + 40 * (tick % 3))
        way = walk.way(path, float(x), 0.0)
        assert way == pytest.approx(x, abs=0.06 * (tick + 1))
    assert way == pytest.approx(8.0, abs=0.5)


def test_a_shorter_path_does_not_fail() -> None:
    walk = Walk()
    walk.index(line(0.0), 29.0, 0.0)
    short = blocks.LinePath(x_end=5.0, samples=11).sampled
    assert walk.index(short, 29.0, 0.0) == 10


@given(places, st.floats(-2.0, 2.0), st.floats(0.1, 3.0))
def test_reference_and_feedforward(place: tuple[float, float], alpha: float, v_r: float) -> None:
    reference, feedforward, kappa, index, _ = Walk(alpha=alpha, v_r=v_r)(SINE, *place)
    row = SINE[int(index)]
    assert reference == tuple(row[:3])
    assert kappa == row[3]
    assert feedforward == (v_r, alpha * row[3])


@pytest.mark.parametrize(("sign", "factor"), [("signed", -1.0), ("unsigned", 1.0)])
def test_unsigned_is_the_papers_letter(sign: str, factor: float) -> None:
    right = blocks.CirclePath(radius=2.0, clockwise=True, samples=400).sampled
    _, feedforward, kappa, _, _ = Walk(curvature=sign, alpha=0.5)(right, 2.0, 0.1)
    assert kappa == factor * 0.5
    assert feedforward == (1.0, factor * 0.25)
    _, feedforward, kappa, _, _ = Walk(curvature=sign, alpha=0.5)(CIRCLE, 2.0, 0.1)
    assert (kappa, feedforward) == (0.5, (1.0, 0.25))


@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("v_r", [1.0, 0.3])
def test_feedforward_of_v_r_keeps_a_unicycle_on_a_circle(v_r: float, clockwise: bool) -> None:
    """omega = v kappa: the distance to the centre is conserved, feedforward alone."""
    side = -1.0 if clockwise else 1.0
    path = blocks.CirclePath(
        center=[1.0, -2.0], radius=1.7, clockwise=clockwise, samples=300
    ).sampled
    plant = blocks.DifferentialDrive(x0=[2.7, -2.0, side * 0.5 * math.pi])
    walk, state = Walk(v_r=v_r, alpha=v_r), state_of(plant, dt=0.05)
    for _ in range(801):
        x, y, theta = plant.output_pose(state, 0.0)
        assert math.hypot(x - 1.0, y + 2.0) == pytest.approx(1.7, abs=1e-11)
        command = walk.block.output(walk.state, 0.0, (x, y, theta), path)[1]
        plant.update(state, 0.0, command)
    assert abs(theta - side * 0.5 * math.pi) == pytest.approx(v_r * 40.0 / 1.7)


def test_half_the_alpha_leaves_the_circle() -> None:
    path = blocks.CirclePath(radius=1.7, samples=300).sampled
    plant = blocks.DifferentialDrive(x0=[1.7, 0.0, 0.5 * math.pi])
    walk, state = Walk(v_r=1.0, alpha=0.5), state_of(plant, dt=0.05)
    for _ in range(60):
        pose = plant.output_pose(state, 0.0)
        plant.update(state, 0.0, walk.block.output(walk.state, 0.0, pose, path)[1])
    assert math.hypot(pose[0], pose[1]) > 2.0


@pytest.mark.parametrize("bad", [0.0, -1.0, math.inf, "1"])
def test_bad_window(bad: Any) -> None:
    with pytest.raises(blocks.ParameterError, match="window: expected a number above 0 m"):
        blocks.MatchingPoint(window=bad)
