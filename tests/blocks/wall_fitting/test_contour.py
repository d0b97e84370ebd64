"""Chains of a scan and geometry on lines, against brute force and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blocks.wall_fitting import offset
from blocks.wall_fitting.bspline import arc_length
from blocks.wall_fitting.contour import (
    Beams,
    Chains,
    Returns,
    averages,
    chain,
    chain_arcs,
    link_limit,
    wrapped,
)
from tests.blocks.raycast import PAPER, Room, square

RIGHT = (math.radians(-165.0), math.radians(80.0))
LAMBDA = 0.14


def linked(scan: np.ndarray, reach: float = 0.9, sigma: float = 0.01) -> Chains:
    beams = Beams.of(len(scan), -math.pi, math.pi, RIGHT, False)
    returns = Returns.of(scan, beams)
    chains = chain(returns, beams.bearing[[0, -1]], reach, sigma, LAMBDA)
    assert chains is not None
    return chains


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("first", [-math.pi, 0.0, -2.0])
def test_beams_by_rising_bearing_inside_the_window(mirror: bool, first: float) -> None:
    low, high = math.radians(-200.0), math.radians(80.0)
    beams = Beams.of(360, first, first + 2.0 * math.pi, (low, high), mirror)
    assert (np.diff(beams.bearing) > 0.0).all()
    assert low <= beams.bearing[0] < beams.bearing[-1] <= high + 1e-12
    assert len(beams.bearing) in (280, 281)
    bearing = first + beams.order * (2.0 * math.pi / 360)
    turned = (-bearing if mirror else bearing) - beams.bearing
    np.testing.assert_allclose(np.cos(turned), 1.0, rtol=1e-12)
    expected = np.column_stack((np.cos(beams.bearing), np.sin(beams.bearing)))
    np.testing.assert_array_equal(beams.direction, expected)
    assert beams.incidence(0.14) == 0.14
    assert Beams.of(30, first, first + 6.0, (low, high), mirror).incidence(0.14) == 0.4


def test_what_is_no_range_is_no_return() -> None:
    scan = np.array([math.nan, math.inf, -math.inf, 0.0, -0.5, 1e300, 0.7, 2.0])
    returns = Returns.of(scan, Beams.of(8, -math.pi, math.pi, (-math.pi, math.pi), False))
    assert returns.ranges.tolist() == [0.7, 2.0]
    np.testing.assert_allclose(returns.bearing, [math.pi / 2.0, 0.75 * math.pi])
    np.testing.assert_allclose(returns.points[0], [0.0, 0.7], atol=1e-15)


@settings(deadline=None)
@given(st.floats(-20.0, 20.0), st.floats(-5.0, 5.0))
def test_wrapped(angle: float, low: float) -> None:
    result = float(wrapped(np.array([angle]), low)[0])
    assert low - 1e-12 <= result <= low + 2.0 * math.pi + 1e-12
    assert math.cos(result - angle) == pytest.approx(1.0)


def test_the_link_limit_is_the_issues() -> None:
    limit = link_limit(
        np.array([0.5, 0.8]), np.array([0.6, 0.4]), np.radians([1.0, 9.0]), 0.01, math.radians(8.0)
    )
    expected = 0.5 * math.sin(math.radians(1.0)) / math.sin(math.radians(7.0)) + 0.06
    assert limit.tolist() == pytest.approx([expected, -1.0])


@settings(deadline=None)
@given(st.floats(0.1, 1.3), st.floats(0.15, 0.8))
def test_a_wall_met_steeper_than_lambda_is_one_chain(incidence: float, d: float) -> None:
    """A line at bearing -90 deg and the next ones, until it is met at lambda."""
    beams = Beams.of(360, -math.pi, math.pi, RIGHT, False)
    seen = np.abs(beams.bearing + 0.5 * math.pi) < 0.5 * math.pi - max(incidence, LAMBDA)
    scan = np.full(360, math.inf)
    scan[beams.order[seen]] = d / np.cos(beams.bearing[seen] + 0.5 * math.pi)
    assert len(linked(scan, reach=100.0, sigma=0.0)) == 1


def test_chains_break_at_cylinders_and_at_the_reach() -> None:
    """Beside the wall y = -2 with a free-standing cylinder ahead."""
    room = Room(square(2.0), np.array([(0.0, -1.2, 0.1)]))
    chains = linked(room.cast((-0.5, -1.8, 0.0)))
    surfaces = [
        "wall" if abs(y + 1.8 + 0.2) > 0.3 else "post" for y in chains.returns.points[:, 1] - 1.8
    ]
    assert len(chains) >= 2
    for low, high in zip(chains.bounds[:-1], chains.bounds[1:], strict=True):
        assert len(set(surfaces[low:high])) == 1
    assert (chains.returns.ranges < 0.9).all()
    # The wall is cut by window and reach, which are no edges; beams pass the cylinder.
    assert not chains.edges[0].any()
    assert chains.edges[1].all()


def test_what_a_nearer_thing_hides_has_no_edge_there() -> None:
    scan = np.full(360, math.inf)
    scan[80:91] = 0.5  # bearings -100 to -90 deg
    scan[91:101] = 0.2
    chains = linked(scan)
    assert len(chains) == 2
    assert chains.edges.tolist() == [[True, False], [True, True]]


def test_a_lonely_return_is_dropped_and_what_it_parted_links_again() -> None:
    scan = np.full(360, math.inf)
    scan[80:101] = 0.5
    scan[90] = 0.2
    chains = linked(scan)
    assert len(chains) == 1
    assert len(chains.returns) == 20


def test_nothing_to_link() -> None:
    beams = Beams.of(360, -math.pi, math.pi, RIGHT, False)
    for scan in (np.full(360, 3.0), np.full(360, math.inf), np.where(np.arange(360) == 90, 0.3, 9)):
        returns = Returns.of(scan, beams)
        assert chain(returns, beams.bearing[[0, -1]], 0.9, 0.01, LAMBDA) is None


def test_points_behind_returns_are_hidden() -> None:
    bearing = np.array([-0.2, -0.1, 0.0, 0.5])
    direction = np.column_stack((np.cos(bearing), np.sin(bearing)))
    returns = Returns(np.array([1.0, 1.0, 2.0, 1.0]), bearing, direction)
    cases = [(-0.15, 0.9, False), (-0.15, 1.1, True), (-0.05, 1.5, False), (-0.05, 2.1, True)]
    cases += [(0.2, 9.0, False), (0.6, 9.0, False), (-0.3, 9.0, False)]
    points = np.array([(r * math.cos(phi), r * math.sin(phi)) for phi, r, _ in cases])
    assert returns.hide(points, 0.2).tolist() == [hidden for _, _, hidden in cases]


def wall_scan(d: float, sigma: float, seed: int) -> np.ndarray:
    """The paper's room without cylinders, d from the wall that is on the right."""
    scan = Room(square(2.0)).cast((0.0, -2.0 + d, 0.0))
    return scan + np.random.default_rng(seed).normal(0.0, sigma, 360)


def test_the_way_is_the_length_of_the_wall_despite_noise() -> None:
    exact = linked(wall_scan(0.18, 0.0, 0))
    length = np.ptp(exact.returns.points[:, 0])
    assert chain_arcs(exact)[-1] == pytest.approx(length, rel=1e-3)
    for seed in range(5):
        noisy = linked(wall_scan(0.18, 0.01, seed))
        raw = arc_length(noisy.returns.points)[-1]
        assert raw > 1.5 * length
        assert chain_arcs(noisy)[-1] < 1.25 * length


@settings(deadline=None)
@given(st.floats(0.02, 0.1), st.integers(0, 50))
def test_averages_are_the_means_of_their_bins(spacing: float, seed: int) -> None:
    chains = linked(PAPER.cast((-0.7, -1.8, 0.1), 180))
    arc = chain_arcs(chains)
    means, bounds = averages(chains, arc, spacing)
    row = 0
    for c, (low, high) in enumerate(zip(chains.bounds[:-1], chains.bounds[1:], strict=True)):
        length = arc[high - 1]
        bins = max(1, round(length / spacing))
        slot = np.minimum((arc[low:high] * bins / max(length, 1e-12)).astype(int), bins - 1)
        assert bounds[c] == row
        for index in np.unique(slot):
            expected = chains.returns.points[low:high][slot == index].mean(axis=0)
            np.testing.assert_allclose(means[row], expected, atol=1e-9)
            row += 1
    assert bounds[-1] == row == len(means)


def test_no_averaging_gives_the_points() -> None:
    chains = linked(wall_scan(0.18, 0.01, 0))
    means, bounds = averages(chains, chain_arcs(chains), 0.0)
    assert means is chains.returns.points
    assert bounds is chains.bounds


@settings(deadline=None)
@given(st.integers(0, 1000))
def test_nearest_is_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(20, 2)), rng.normal(size=(15, 2))
    expected = np.hypot(*(a[:, None] - b).transpose(2, 0, 1)).min(axis=1)
    np.testing.assert_allclose(offset.nearest(a, b), expected, atol=1e-7)


@pytest.mark.parametrize(("x", "sweep"), [(0.5, 19.8), (0.0, 90.0), (-0.18, 135.0)])
def test_caps_go_round_an_edge_by_the_angle_of_the_beam(x: float, sweep: float) -> None:
    """A wall along y = -0.18 that ends at x, seen from the origin."""
    end, tangent = np.array([x, -0.18]), np.array([1.0, 0.0])
    rows = offset.cap(end, tangent, 0.18, 0.005, begin=False)
    cap, travel = rows[:, :2], rows[:, 2:]
    np.testing.assert_allclose(np.hypot(*(cap - end).T), 0.18)
    # Clockwise, the edge on the right.
    np.testing.assert_allclose(offset.left(travel), (cap - end) / 0.18, atol=1e-12)
    angle = np.degrees(np.arctan2(*(cap - end)[:, ::-1].T))
    assert (np.diff(angle) < 0.0).all()
    assert angle[-1] == pytest.approx(90.0 - sweep, abs=0.1)
    # Seen from the other side, the same wall begins there.
    mirrored = offset.cap(end * (-1.0, 1.0), tangent, 0.18, 0.005, begin=True)
    np.testing.assert_allclose(mirrored[::-1] * (-1.0, 1.0, 1.0, -1.0), rows, atol=1e-12)


def test_a_grazing_beam_makes_no_cap() -> None:
    for begin, x, slope in ((False, 1.0, -0.01), (True, -1.0, 0.01)):
        end, tangent = np.array([x, 0.0]), np.array([1.0, slope])
        assert not len(offset.cap(end, tangent, 0.2, 0.01, begin))


def line(*corners: tuple[float, float], spacing: float = 0.01) -> np.ndarray:
    polygon = np.array(corners, dtype=float)
    return offset.resampled(polygon, round(arc_length(polygon)[-1] / spacing) + 1)


def rows_of(points: np.ndarray) -> np.ndarray:
    """Points with the direction of travel that is the line's own."""
    return np.column_stack((points, offset.tangents(points, 1)))


@pytest.mark.parametrize("turn", [30.0, 60.0, 90.0, 120.0])
def test_fillets_are_arcs_tangent_to_both_sides(turn: float) -> None:
    phi = math.radians(turn)
    corner = line((-1.0, 0.0), (0.0, 0.0), (math.cos(phi), math.sin(phi)))
    result = offset.filleted(corner, 0.15, 0.01, 0.001)
    cut = 0.15 * math.tan(0.5 * phi)
    centre = np.array([-cut, 0.15])
    assert np.hypot(*(result - centre).T).min() == pytest.approx(0.15, abs=3e-3)
    gone = np.hypot(*result.T).min()
    assert gone == pytest.approx(0.15 / math.cos(0.5 * phi) - 0.15, abs=4e-3)
    straight = round((1.0 - cut) / 0.01) - 2
    np.testing.assert_array_equal(result[:straight], corner[:straight])
    assert np.hypot(*np.diff(result, axis=0).T).max() < 0.02


def test_right_turns_and_wide_turns_keep_their_shape() -> None:
    right = line((-1.0, 0.0), (0.0, 0.0), (0.0, -1.0))
    np.testing.assert_array_equal(offset.filleted(right, 0.15, 0.01, 0.001), right)
    angle = np.linspace(0.0, 2.0, 60)
    wide = 0.3 * np.column_stack((np.cos(angle), np.sin(angle)))
    np.testing.assert_array_equal(offset.filleted(wide, 0.15, 0.01, 0.001), wide)
    np.testing.assert_array_equal(offset.filleted(right, 0.0, 0.01, 0.001), right)


def test_pieces_link_over_gaps_ahead_and_leave_out_what_stands_apart() -> None:
    here = rows_of(line((-0.5, 0.1), (0.3, 0.1)))
    ahead = rows_of(line((0.6, 0.1), (1.0, 0.1)))
    apart = rows_of(line((0.1, 0.5), (0.0, 0.8)))
    assert offset.gap(here, ahead, 0.5) == pytest.approx(0.3)
    assert offset.gap(here, ahead, 0.2) == math.inf
    assert offset.gap(here, apart, 0.5) == math.inf
    joined = offset.followed([here, apart, ahead], 0.5)
    np.testing.assert_array_equal(joined, np.concatenate((here, ahead)))
    # The same from the far end: what was passed links as well.
    moved = (1.0, 0.0, 0.0, 0.0)
    back = offset.followed([here - moved, apart - moved, ahead - moved], 0.5)
    np.testing.assert_allclose(back, joined - moved)


def test_kinks_of_one_contour_link_whatever_they_turn() -> None:
    wall = line((-0.5, 0.0), (0.3, 0.0))
    back = line((0.29, 0.02), (-0.2, 0.4))
    assert offset.gap(wall, back, 0.5) < 0.03


def test_folds_are_left_out() -> None:
    folded = np.array([(0.0, 0.0), (1.0, 0.1), (2.0, 0.0), (1.5, 0.1), (1.8, 0.0), (3.0, 0.1)])
    rows = np.column_stack((folded, np.tile((1.0, 0.0), (6, 1))))
    np.testing.assert_array_equal(offset.onward(rows), rows[[0, 1, 2, 5]])
    corner = rows_of(line((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    np.testing.assert_array_equal(offset.onward(corner), corner)


def test_a_long_way_back_is_left_out_though_it_is_straight() -> None:
    """Longer than the stretch over which any direction is computed."""
    folded = line((0.0, 0.0), (1.0, 0.0), (0.2, 0.01), (1.5, 0.02))
    rows = np.column_stack((folded, np.tile((1.0, 0.0), (len(folded), 1))))
    assert (np.diff(offset.onward(rows)[:, 0]) > 0.0).all()


def test_stretches_go_on_straight() -> None:
    corner = line((0.0, 0.0), (0.5, 0.0), (0.5, 0.5))
    got = offset.stretch(corner, -0.2, 1.5, 16)
    steps = np.arange(16) * 0.1 - 0.2
    expected = np.column_stack((np.minimum(steps, 0.5), np.maximum(steps - 0.5, 0.0)))
    np.testing.assert_allclose(got, expected, atol=1e-12)
    inside = offset.stretch(corner, 0.3, 0.4, 5)
    np.testing.assert_allclose(inside[[0, -1]], [(0.3, 0.0), (0.5, 0.2)], atol=1e-12)


def test_runs() -> None:
    kept = np.array([1, 1, 0, 0, 1, 0, 1], dtype=bool)
    assert offset.runs(kept) == [(0, 2), (4, 5), (6, 7)]
    assert offset.runs(np.zeros(3, dtype=bool)) == []
