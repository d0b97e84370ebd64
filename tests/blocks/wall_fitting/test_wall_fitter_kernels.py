"""The wall fitter in loops against its numpy form: function by function, and on whole scans."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from blocks.wall_fitting import bspline, contour, offset
from blocks.wall_fitting.fitter import WallFitter
from blocks.wall_fitting.kernels import bspline as bspline_kernels
from blocks.wall_fitting.kernels import contour as contour_kernels
from blocks.wall_fitting.kernels import curves as curve_kernels
from blocks.wall_fitting.kernels import fitter as fitter_kernels
from blocks.wall_fitting.kernels import offset as offset_kernels
from runtime.compiler.fields import written
from tests.blocks.fitter import Fit, Fitter, Pose
from tests.blocks.raycast import PAPER, Room, square
from tests.blocks.wall_fitting.test_wall_fitter_scans import NOTHING, scans
from tests.compilers import skip_without_compiler
from tests.examples import examples
from tests.runtime.engine.compiled_block import CompiledBlock

FORMS = ("control_points", "least_squares")
CORNERS = np.array([[-2.0, -1.0], [1.5, -1.5], [2.0, 1.0], [0.4, 0.2], [-0.5, 2.0]])
Loops = Callable[[Fitter, np.ndarray, Pose], Fit]


def same(found: np.ndarray, expected: np.ndarray, tolerance: float = 1e-13) -> None:
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=tolerance)


def same_fit(found: Fit, expected: Fit) -> None:
    """Second derivatives make of a rounding what they make of any other noise."""
    assert found[2] == expected[2]
    same(found[1], expected[1], 1e-11)
    same(found[0][:, :3], expected[0][:, :3], 1e-11)
    scale = max(1.0, float(np.abs(expected[0][:, 3]).max()))
    same(found[0][:, 3] / scale, expected[0][:, 3] / scale, 1e-10)


def views(seed: int, noise: float, lost: float) -> Iterator[tuple[np.ndarray, Pose]]:
    """Scans in rooms: along the paper's walls, in a narrow room, in one with a sharp corner."""
    rng = np.random.default_rng(seed)
    poses = PAPER.contour(0.18, 0.1)
    for room in (PAPER, PAPER, Room(square(0.5)), Room(CORNERS)):
        near = poses[rng.integers(len(poses))] + rng.normal(0.0, [0.03, 0.03, 0.2])
        inside = rng.uniform([-0.4, -0.4, -3.0], [0.4, 0.3, 3.0])
        x, y, theta = (near if room is PAPER else inside).tolist()
        scan = room.cast((x, y, theta)) + noise * rng.standard_normal(360)
        scan[rng.uniform(size=360) < lost] = math.inf
        yield scan, (x, y, theta)


def as_python(fitter: Fitter, scan: np.ndarray, pose: Pose) -> Fit:
    return fitter.block._output_kernel(fitter.state, 0.0, scan, pose)


@pytest.fixture(scope="module")
def compiled() -> Loops:
    """What the compiled engine runs, for least squares and a wall on the left.

    One text does for all fitters of a degree and a form of scan: their numbers are no part of it.
    """
    skip_without_compiler()
    known: list[CompiledBlock] = []

    def run(fitter: Fitter, scan: np.ndarray, pose: Pose) -> Fit:
        few = written(fitter.state.context.types["scan"].shape)
        fits = (
            each
            for each in known
            if written(each.kinds["scan"].shape) == few
            and each.kernel.fitting(fitter.block, fitter.state) is not None
        )
        compiled = next(fits, None)
        if compiled is None:
            compiled = CompiledBlock(fitter.block, fitter.state, {})
            known.append(compiled)
        compiled.fields(fitter.block, fitter.state)
        return compiled.call("output", 0.0, scan, pose)

    return run


def compare(fitter: Fitter, loops: Loops, scan: np.ndarray, pose: Pose) -> float:
    """Both forms on one scan; what they keep of it is numpy's. Returns whether there is a path."""
    found = loops(fitter, scan, pose)
    expected = fitter(scan, pose)
    same_fit(found, expected)
    return expected[2]


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.slow
def test_rooms(form: str, side: str, degree: int) -> None:
    fitter = Fitter(fit=form, side=side, degree=degree)
    seen = sum(
        compare(fitter, as_python, scan, pose) for scan, pose in views(degree, 0.005 * degree, 0.1)
    )
    assert seen > 1


@pytest.mark.parametrize("name", NOTHING)
@pytest.mark.parametrize("form", FORMS)
def test_scans_that_hold_nothing(name: str, form: str) -> None:
    fitter = Fitter(fit=form)
    assert compare(fitter, as_python, NOTHING[name], (1.0, 2.0, 0.5)) == 0.0
    scan, pose = next(views(0, 0.01, 0.0))
    assert compare(fitter, as_python, scan, pose) == 1.0
    assert compare(fitter, as_python, NOTHING[name], pose) == 0.0


def test_a_window_without_beams() -> None:
    fitter = Fitter(beams=3, window=(0.1, 0.2))
    assert len(fitter.state.order) == 0
    assert compare(fitter, as_python, np.full(3, 0.3), (0.0, 0.0, 0.0)) == 0.0


class TiedError(Exception):
    """Two points of the line are equally near to the robot: rounding says which is nearer."""


def untied(block: WallFitter, line: np.ndarray, rows: np.ndarray) -> bspline.Samples | None:
    first, second = np.sort(np.hypot(*line.T))[:2]
    if second - first < 1e-12:
        raise TiedError
    return REFERENCE(block, line, rows)


REFERENCE = WallFitter.reference


@pytest.mark.slow  # the compiler sees a new text for each degree and form of scan
@examples(300)
@given(
    scan=scans(),
    degree=st.integers(2, 7),
    averaged=st.sampled_from([0.0, 0.01, 0.03]),
    fillet=st.sampled_from([0.0, 0.15]),
    bridge=st.sampled_from([0.0, 0.5]),
    reach=st.sampled_from([0.3, 0.9, 2.0]),
)
def test_any_scan_compiled(
    compiled: Loops,
    scan: np.ndarray,
    degree: int,
    averaged: float,
    fillet: float,
    bridge: float,
    reach: float,
) -> None:
    """Less ties: of a circle around the robot, or of one around a post, no point is nearest."""
    scan *= np.random.default_rng(0).uniform(1.0 - 1e-6, 1.0, len(scan))
    fitter = Fitter(
        len(scan),
        fit="least_squares",
        side="left",
        degree=degree,
        bin=averaged,
        fillet=fillet,
        bridge=bridge,
        reach=reach,
    )
    found = compiled(fitter, scan, (0.5, -0.5, 2.0))
    with patch.object(WallFitter, "reference", untied):
        try:
            expected = fitter(scan, (0.5, -0.5, 2.0))
        except TiedError:
            assume(False)
    same_fit(found, expected)


@pytest.mark.slow
def test_rooms_compiled(compiled: Loops) -> None:
    fitter = Fitter(fit="least_squares", side="left")
    for seed in range(10):
        for scan, pose in views(seed, 0.01, 0.1):
            compare(fitter, compiled, scan, pose)


@st.composite
def lines(draw: st.DrawFn) -> np.ndarray:
    """Polylines (m, 2) that bend, turn back and stand still, away from the origin."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    m = draw(st.integers(1, 80))
    turn = np.cumsum(rng.normal(0.0, draw(st.sampled_from([0.0, 0.1, 1.0])), m))
    length = rng.uniform(0.0, 0.02, m) * (rng.uniform(size=m) < 0.9)
    steps = length[:, None] * np.column_stack((np.cos(turn), np.sin(turn)))
    return np.cumsum(steps, axis=0) + rng.uniform(-0.3, 0.3, 2)


@given(line=lines(), reach=st.integers(1, 9))
def test_lines(line: np.ndarray, reach: int) -> None:
    same(offset_kernels.tangents_kernel(line, reach), offset.tangents(line, reach), 1e-12)
    same(bspline_kernels.arc_length_kernel(line), bspline.arc_length(line))
    assert fitter_kernels.nearest_row(line) == np.einsum("ij,ij->i", line, line).argmin()
    others = line[::2] + np.array([0.1, 0.05])
    same(offset_kernels.nearest_kernel(line, others), offset.nearest(line, others), 1e-12)


@given(line=lines(), seed=st.integers(0, 2**32 - 1), near=st.sampled_from([0.01, 0.05]))
def test_rows(line: np.ndarray, seed: int, near: float) -> None:
    rows = travelled(line, seed)
    same(offset_kernels.onward_kernel(rows), offset.onward(rows))
    path = np.random.default_rng(seed).normal(0.0, 0.3, (20, 4))
    path[:, :2] += line[0]
    found = fitter_kernels.against_kernel(path, rows, near)
    np.testing.assert_array_equal(found, offset.against(path[:, :2], path[:, 2], rows, near))


def travelled(line: np.ndarray, seed: int) -> np.ndarray:
    """A line with any directions of travel, (m, 4)."""
    angle = np.random.default_rng(seed).uniform(-math.pi, math.pi, len(line))
    return np.column_stack((line, np.cos(angle), np.sin(angle)))


@given(
    line=lines(),
    start=st.floats(-1.0, 1.0),
    length=st.floats(0.01, 2.0),
    samples=st.integers(1, 50),
)
def test_stretch(line: np.ndarray, start: float, length: float, samples: int) -> None:
    arc = bspline.arc_length(line)
    found = offset_kernels.stretch_kernel(line, arc, start, length, samples)
    same(found, offset.stretch(line, start, length, samples), 1e-12)


@given(line=lines(), radius=st.sampled_from([0.0, 0.05, 0.15]))
def test_fillets(line: np.ndarray, radius: float) -> None:
    even = offset.resampled(line, max(2, round(float(bspline.arc_length(line)[-1]) / 0.01)))
    found = offset_kernels.filleted_kernel(even, radius, 0.01, 0.003)
    same(found, offset.filleted(even, radius, 0.01, 0.003), 1e-12)


@given(
    angle=st.floats(-math.pi, math.pi),
    slant=st.floats(-3.0, 3.0),
    distance=st.floats(0.05, 0.5),
    begin=st.booleans(),
)
def test_caps(angle: float, slant: float, distance: float, begin: bool) -> None:
    end = 0.6 * np.array([math.cos(angle), math.sin(angle)])
    tangent = np.array([math.cos(angle + slant), math.sin(angle + slant)])
    expected = offset.cap(end, tangent, distance, 0.02, begin)
    rows = np.empty((100, 4))
    side = 1.0 if begin else -1.0
    n = offset_kernels.cap_kernel(np.concatenate((end, tangent)), distance, 0.02, side, rows, 0)
    same(rows[:n], expected)


@given(
    pieces=st.lists(st.tuples(lines(), st.floats(-0.5, 0.5)), min_size=1, max_size=6),
    bridge=st.sampled_from([0.0, 0.3, 1.0]),
)
def test_pieces_that_are_followed(pieces: list[tuple[np.ndarray, float]], bridge: float) -> None:
    moved = [
        travelled(line + np.array([shift, 0.2 * i]), i) for i, (line, shift) in enumerate(pieces)
    ]
    ends = np.cumsum([0, *map(len, moved)])
    bounds = np.column_stack((ends[:-1], ends[1:]))
    found = offset_kernels.followed_kernel(np.concatenate(moved), bounds, bridge)
    np.testing.assert_array_equal(found, offset.followed(moved, bridge))


@given(scan=scans(), reach=st.sampled_from([0.3, 0.9]), spacing=st.sampled_from([0.0, 0.03]))
def test_chains(scan: np.ndarray, reach: float, spacing: float) -> None:
    window = (math.radians(-200.0), math.radians(80.0))
    beams = contour.Beams.of(len(scan), -math.pi, math.pi, window, False)
    limit = beams.incidence(0.14)
    expected = contour.Returns.of(scan, beams)
    returns = contour_kernels.returned(scan, beams.order, beams.bearing, beams.direction)
    np.testing.assert_array_equal(returns[:, 0], expected.ranges)
    np.testing.assert_array_equal(returns[:, 1], expected.bearing)
    np.testing.assert_array_equal(returns[:, 2:], expected.points)
    kept, bounds, edges = contour_kernels.chain_kernel(returns, beams.bearing, reach, 0.01, limit)
    ends = beams.bearing[[0, -1]]
    chains = contour.chain(expected, ends, reach, 0.01, limit) if len(returns) > 1 else None
    if chains is None:
        assert len(kept) == 0
        return
    np.testing.assert_array_equal(kept[:, 2:], chains.returns.points)
    np.testing.assert_array_equal(bounds, chains.bounds)
    np.testing.assert_array_equal(edges, chains.edges)
    arc = contour.chain_arcs(chains)
    same(contour_kernels.chain_arcs_kernel(kept, bounds), arc)
    means, first = contour_kernels.averages_kernel(kept, bounds, arc, spacing)
    expected_means, expected_first = contour.averages(chains, arc, spacing)
    np.testing.assert_array_equal(first, expected_first)
    same(means, expected_means)


@given(seed=st.integers(0, 2**32 - 1), beams=st.sampled_from([3, 40, 360]))
def test_hidden_points(seed: int, beams: int) -> None:
    rng = np.random.default_rng(seed)
    scan = np.where(rng.uniform(size=beams) < 0.3, math.inf, rng.uniform(0.2, 1.0, beams))
    directions = contour.Beams.of(beams, -math.pi, math.pi, (-3.4, 1.4), False)
    returns = contour.Returns.of(scan, directions)
    assume(len(returns) > 1)
    rows = np.column_stack((returns.ranges, returns.bearing, returns.points))
    points = rng.uniform(-1.0, 1.0, (50, 2))
    found = [curve_kernels.is_hidden(x, y, rows, 0.14) for x, y in points]
    np.testing.assert_array_equal(found, returns.hide(points, 0.14))


@given(degree=st.integers(0, 7), more=st.integers(1, 30), each=st.integers(2, 9))
def test_bands_of_the_basis(degree: int, more: int, each: int) -> None:
    points = degree + more
    samples = each * points
    dense = bspline.basis_matrices(points, degree, samples)
    for first, bands in (
        bspline_kernels.banded_matrices(points, degree, samples),
        [
            part[None] if i else part
            for i, part in enumerate(bspline_kernels.even_basis(points, degree, samples))
        ],
    ):
        for band, whole in zip(bands, dense, strict=False):
            spread = np.zeros((samples, points + degree + 1))
            for i, k in enumerate(first):
                spread[i, k : k + degree + 1] = band[i]
            same(spread[:, :points], whole)
            assert not spread[:, points:].any()


@given(
    degree=st.integers(2, 7),
    more=st.integers(1, 20),
    bend=st.sampled_from([0.0, 0.03]),
    seed=st.integers(0, 2**32 - 1),
)
def test_least_squares(degree: int, more: int, bend: float, seed: int) -> None:
    """Against a solver of dense systems; the curve is what counts, and better conditioned."""
    points = degree + more
    data = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.01, (5 * points, 2)), axis=0)
    first, values = bspline_kernels.even_basis(points, degree, len(data))
    found = bspline_kernels.fit_kernel(first, values, data, points, bend)
    whole = bspline.basis_matrices(points, degree, len(data))[0]
    second = np.diff(np.eye(points), n=2, axis=0)
    ridge = bend * second.T @ second + (bspline.RIDGE if bend else 0.0) * np.eye(points)
    expected = np.linalg.solve(whole.T @ whole + ridge, whole.T @ data)
    same(bspline_kernels.positions(first, values, found), whole @ expected, 1e-12)


@given(
    seed=st.integers(0, 2**32 - 1),
    degree=st.integers(2, 5),
    start=st.floats(0.0, 0.5),
    length=st.floats(0.1, 1.0),
)
def test_even_samples(seed: int, degree: int, start: float, length: float) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(0.02, 0.1, (12, 2)), axis=0) * (-1.0, 1.0)
    first, bands = bspline_kernels.banded_matrices(12, degree, 60)
    found = bspline_kernels.sampled_evenly_kernel(first, bands, points, length / 30, 31, start)
    expected = bspline.BSpline(points, degree).sampled_evenly(length / 30, 31, start, 60)
    same(found[:, :2], expected.position)
    same(found[:, 2], expected.theta, 1e-12)
    same(found[:, 3], expected.kappa, 1e-9)
