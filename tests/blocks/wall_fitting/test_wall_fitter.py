"""The wall fitter on scans of known rooms: accuracy and invariants."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
import runtime
from blocks.wall_fitting.fitter import WallFitter
from tests.blocks.fitter import Fitter, Pose
from tests.blocks.raycast import PAPER, Room, square
from tests.examples import examples

D = 0.18


@pytest.fixture(scope="module")
def views() -> list[tuple[Pose, np.ndarray]]:
    """Poses all along the level set of the paper's room, up to 6 deg off it, and exact scans."""
    rng = np.random.default_rng(0)
    poses = [(x, y, theta + rng.uniform(-0.1, 0.1)) for x, y, theta in PAPER.contour(D, 0.3)]
    assert len(poses) > 50
    return [(pose, PAPER.cast(pose)) for pose in poses]


def ahead(path: np.ndarray, pose: Pose, metres: float = 0.5) -> np.ndarray:
    """The rows of the path from the robot on."""
    first = int(np.hypot(path[:, 0] - pose[0], path[:, 1] - pose[1]).argmin())
    return path[first : first + round(metres / 0.01)]


@pytest.mark.parametrize(
    ("form", "sigma", "bound"),
    [
        pytest.param("control_points", 0.0, 5.0, marks=pytest.mark.slow),
        ("control_points", 0.01, 7.0),
        pytest.param("control_points", 0.02, 12.0, marks=pytest.mark.slow),
        pytest.param("least_squares", 0.0, 5.0, marks=pytest.mark.slow),
        ("least_squares", 0.01, 7.0),
        pytest.param("least_squares", 0.02, 10.0, marks=pytest.mark.slow),
    ],
)
@pytest.mark.slow
def test_the_path_is_at_its_distance(
    views: list[tuple[Pose, np.ndarray]], form: str, sigma: float, bound: float
) -> None:
    """Mean error (mm) over the next 0.5 m, the corners that no robot can follow included."""
    rng, fitter, errors = np.random.default_rng(1), Fitter(fit=form, sigma=sigma), []
    for pose, scan in views:
        path, _, valid = fitter(scan + rng.normal(0.0, sigma, 360), pose)
        assert valid == 1.0
        errors.append(np.abs(PAPER.distance(ahead(path, pose)[:, :2]) - D))
    assert 1e3 * np.concatenate(errors).mean() < bound
    if sigma == 0.0:
        assert 1e3 * np.median(np.concatenate(errors)) < 1.0


@pytest.mark.parametrize("sigma", [0.0, 0.01])
@pytest.mark.slow
def test_the_path_keeps_clear_of_the_walls_seen(
    views: list[tuple[Pose, np.ndarray]], sigma: float
) -> None:
    rng, fitter = np.random.default_rng(2), Fitter(fit="least_squares")
    for pose, scan in views:
        path, wall, _ = fitter(scan + rng.normal(0.0, sigma, 360), pose)
        near = ahead(path, pose)[:, None, :2]
        assert np.hypot(*(near - wall).transpose(2, 0, 1)).min() > D - 0.025
        assert np.abs(PAPER.distance(wall)).max() < 0.02 + 4.0 * sigma


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("sigma", [0.0, 0.01, 0.02])
@pytest.mark.slow
def test_rows_are_even_and_agree_with_each_other(
    views: list[tuple[Pose, np.ndarray]], side: str, sigma: float
) -> None:
    rng, fitter = np.random.default_rng(3), Fitter(side=side, sigma=sigma)
    for pose, scan in views[::3]:
        if side == "left":
            pose, scan = (pose[0], -pose[1], -pose[2]), np.roll(scan[::-1], 1)
        path, _, _ = fitter(scan + rng.normal(0.0, sigma, 360), pose)
        step = np.diff(path[:, :2], axis=0)
        length = np.hypot(*step.T)
        # Chords of the arcs between rows are that much shorter than 1 cm.
        np.testing.assert_allclose(length, 0.01, atol=2e-4)
        off = np.arctan2(step[:, 1], step[:, 0]) - 0.5 * (path[1:, 2] + path[:-1, 2])
        assert np.abs(np.remainder(off + 1.0, 2.0 * math.pi) - 1.0).max() < 0.01
        turn = np.diff(path[:, 2]) / 0.01
        np.testing.assert_allclose(turn, 0.5 * (path[1:, 3] + path[:-1, 3]), atol=1.0)
        assert np.abs(np.diff(path[:, 2])).max() < 1.0
        # It begins 0.3 m behind the robot and goes where the robot goes.
        here = np.hypot(path[:, 0] - pose[0], path[:, 1] - pose[1]).argmin()
        assert abs(here - 30) <= 6


@pytest.mark.parametrize("every", [pytest.param(1, marks=pytest.mark.slow), 4])
def test_the_path_goes_counterclockwise_round_a_room(
    views: list[tuple[Pose, np.ndarray]], every: int
) -> None:
    fitter = Fitter()
    for pose, scan in views[::every]:
        path, _, _ = fitter(scan, pose)
        here = ahead(path, pose)[0]
        # Fillets turn up to half a corner before the level set does.
        assert math.cos(here[2] - pose[2]) > 0.4


def test_cylinders_are_right_turns_and_corners_left_turns() -> None:
    fitter = Fitter()
    for x, y, radius in PAPER.circles:
        bearing = math.atan2(-y, -x)  # the side that faces the room
        at = (x + (radius + D) * math.cos(bearing), y + (radius + D) * math.sin(bearing))
        pose = (*at, bearing - 0.5 * math.pi)
        path, _, _ = fitter(PAPER.cast(pose), pose)
        near = ahead(path, pose, 0.1)
        np.testing.assert_allclose(near[:, 3], -1.0 / (radius + D), rtol=0.15)
    pose = (1.6, -2.0 + D, 0.0)
    path, _, _ = fitter(PAPER.cast(pose), pose)
    bend = ahead(path, pose, 0.5)
    assert bend[:, 3].max() == pytest.approx(1.0 / 0.15, rel=0.3)
    assert bend[:, 3].min() > -1.0
    assert bend[-1, 2] - bend[0, 2] == pytest.approx(0.5 * math.pi, abs=0.15)


@pytest.mark.parametrize("radius", [0.1, 0.15, 0.25])
def test_corners_are_rounded_with_the_fillets_radius(radius: float) -> None:
    pose = (1.6, -2.0 + D, 0.0)
    path, _, _ = Fitter(fillet=radius, spacing=0.06)(Room(square(2.0)).cast(pose), pose)
    # The offsets meet at distance d from both walls; the rim comes no nearer than this.
    corner = np.array([2.0 - D, -2.0 + D])
    gap = np.hypot(*(path[:, :2] - corner).T).min()
    assert gap == pytest.approx(radius * (math.sqrt(2.0) - 1.0), abs=6e-3)


def test_a_wall_on_the_left_is_the_mirror_image() -> None:
    rng = np.random.default_rng(4)
    for pose in ((-0.7, -1.82, 0.1), (1.6, -1.82, 0.0), (0.3, -0.82, -0.1)):
        scan = PAPER.cast(pose) + rng.normal(0.0, 0.01, 360)
        right, wall, _ = Fitter(side="right")(scan, pose)
        # Beam i at bearing phi becomes beam -i at bearing -phi.
        mirrored = np.roll(scan[::-1], 1)
        left, other, _ = Fitter(side="left")(mirrored, (pose[0], -pose[1], -pose[2]))
        np.testing.assert_allclose(left * (1.0, -1.0, -1.0, -1.0), right, atol=1e-6)
        np.testing.assert_allclose(other * (1.0, -1.0), wall, atol=1e-9)


@examples(20)
@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-9.0, 9.0))
def test_the_path_moves_with_the_pose(x: float, y: float, theta: float) -> None:
    scan = Room(square(2.0)).cast((0.0, -1.8, 0.0), 90)
    path, wall, _ = Fitter(90)(scan)
    moved, other, _ = Fitter(90)(scan, (x, y, theta))
    turn = np.array([[math.cos(theta), math.sin(theta)], [-math.sin(theta), math.cos(theta)]])
    np.testing.assert_allclose(moved[:, :2], path[:, :2] @ turn + (x, y), atol=1e-12)
    np.testing.assert_allclose(moved[:, 2:], path[:, 2:] + (theta, 0.0), atol=1e-12)
    np.testing.assert_allclose(other, wall @ turn + (x, y), atol=1e-12)


def test_beams_may_begin_anywhere() -> None:
    scan = Room(square(2.0)).cast((0.0, -1.8, 0.2))
    expected, _, _ = Fitter()(scan)
    turned = Fitter(angle_min=0.0, angle_max=2.0 * math.pi)(np.roll(scan, 180))
    np.testing.assert_allclose(turned[0], expected, atol=1e-9)


@pytest.mark.parametrize("degree", [2, 3, 5])
@pytest.mark.parametrize("form", ["control_points", "least_squares"])
def test_a_straight_wall_gives_a_straight_path(degree: int, form: str) -> None:
    path, _, valid = Fitter(degree=degree, fit=form)(Room(square(5.0)).cast((0.0, -4.7, 0.1)))
    assert valid == 1.0
    across = -path[:, 0] * math.sin(-0.1) + path[:, 1] * math.cos(-0.1)
    np.testing.assert_allclose(across, D - 0.3, atol=2e-3)
    np.testing.assert_allclose(path[:, 3], 0.0, atol=0.1)


L_ROOM = Room(np.array([(0, 0), (5, 0), (5, 2), (2, 2), (2, 5), (0, 5)], dtype=float))


@pytest.mark.parametrize("x", [2.3, 2.1, 2.0, 1.9])
def test_the_path_goes_round_a_corner_that_juts_out(x: float) -> None:
    """Along y = 2 to the left, the corner (2, 2) on the right; what follows is hidden at first."""
    pose = (x, 2.0 - D, math.pi)
    path, _, _ = Fitter()(L_ROOM.cast(pose), pose)
    near = ahead(path, pose, x - 2.0 + 0.15)
    np.testing.assert_allclose(np.hypot(*(near[:, :2] - (2.0, 2.0)).T).min(), D, atol=0.016)
    assert (L_ROOM.distance(near[:, :2]) > D - 0.02).all()
    if x <= 2.0:
        # Abreast of the corner the path turns into what the beams beyond it leave free.
        assert near[:, 3].min() < -2.0


def test_a_doorway_narrower_than_the_bridge_is_passed() -> None:
    door = np.array([(0.15, -1.0), (0.15, -1.6), (-0.15, -1.6), (-0.15, -1.0)])
    corners = np.concatenate(([(-2, 2), (-2, -1)], door[::-1], [(2, -1), (2, 2)]))
    pose = (-0.4, -1.0 + D, 0.0)
    path, _, _ = Fitter()(Room(corners).cast(pose), pose)
    near = ahead(path, pose, 0.8)
    assert near[-1, 0] > 0.3
    # The rolling disc sinks between the posts by less than this.
    sink = D + 0.15 - math.sqrt((D + 0.15) ** 2 - 0.15**2)
    assert (np.abs(near[:, 1] - pose[1]) < sink + 0.01).all()


@pytest.mark.parametrize("gap", [0.25, 0.45])
def test_a_column_is_gone_round_only_where_the_robot_does_not_fit_behind(gap: float) -> None:
    room = Room(square(2.0), np.array([(0.3, -2.0 + gap + 0.1, 0.1)]))
    pose = (-0.1, -2.0 + D, 0.0)
    path, _, _ = Fitter()(room.cast(pose), pose)
    bend = np.abs(ahead(path, pose, 0.4)[:, 2]).max()
    assert bend > 0.5 if gap < 2.0 * D else bend < 0.05


def test_a_person_who_appears_is_gone_round() -> None:
    pose, fitter = (-1.0, -2.0 + D, 0.0), Fitter()
    fitter(Room(square(2.0)).cast(pose), pose)
    legs = np.array([(-0.5, -1.85, 0.08), (-0.5, -1.6, 0.08)])
    room = Room(square(2.0), legs)
    path, _, valid = fitter(room.cast(pose), pose)
    assert valid == 1.0
    assert (room.distance(ahead(path, pose, 0.6)[:, :2]) > D - 0.03).all()


@pytest.mark.parametrize("form", ["control_points", "least_squares"])
def test_half_of_the_returns_are_enough(views: list[tuple[Pose, np.ndarray]], form: str) -> None:
    rng, fitter, errors = np.random.default_rng(5), Fitter(fit=form), []
    for pose, scan in views:
        noisy = scan + rng.normal(0.0, 0.01, 360)
        noisy[rng.uniform(size=360) < 0.5] = math.inf
        path, _, valid = fitter(noisy, pose)
        if valid:
            errors.append(np.abs(PAPER.distance(ahead(path, pose)[:, :2]) - D).mean())
    assert len(errors) > 0.95 * len(views)
    assert np.mean(errors) < 0.015


@pytest.mark.parametrize("side", ["right", pytest.param("left", marks=pytest.mark.slow)])
def test_it_keeps_the_rules_of_blocks(side: str) -> None:
    runtime.check_block(WallFitter(side=side, samples=60), {"scan": blocks.Scan(120)}, dt=0.1)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"window": [1.0, -1.0]}, "window: expected first < last <= first"),
        ({"window": [-4.0, 3.0]}, "window: expected first < last <= first"),
        ({"angle_min": 1.0, "angle_max": 0.0}, "angle_max: must be above angle_min = 1 by 2 pi"),
        ({"samples": 20}, "behind: the path is 0.19 m long and ends ahead of the robot"),
        ({"fit": "exact"}, "fit: expected one of control_points, least_squares"),
        ({"distance": 0.0}, "distance: expected a number above 0 m"),
        ({"side": "front"}, "side: expected one of right, left"),
    ],
)
def test_bad_parameters(parameters: dict[str, object], message: str) -> None:
    with pytest.raises(blocks.ParameterError, match=message):
        WallFitter(**parameters)
