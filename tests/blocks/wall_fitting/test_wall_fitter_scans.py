"""The wall fitter on scans that hold nothing, or nonsense."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.blocks.fitter import Fitter
from tests.blocks.raycast import Room, square
from tests.examples import examples

NOTHING = {
    "all misses": np.full(360, math.inf),
    "all NaN": np.full(360, math.nan),
    "a single point": np.where(np.arange(360) == 90, 0.3, math.inf),
    "all points equal": np.zeros(360),
    "negative": np.full(360, -0.5),
    "far away": np.full(360, 3.0),
}


@pytest.mark.parametrize("name", NOTHING)
def test_a_scan_that_holds_nothing_keeps_the_last_path(name: str) -> None:
    fitter, pose = Fitter(), (0.0, -1.8, 0.1)
    path, wall, valid = fitter(Room(square(2.0)).cast(pose), pose)
    assert valid == 1.0
    for x in (0.1, 0.2):
        kept, same, valid = fitter(NOTHING[name], (x, -1.8, 0.0))
        assert valid == 0.0
        np.testing.assert_array_equal(kept, path)
        np.testing.assert_array_equal(same, wall)
        assert not np.shares_memory(kept, fitter.state.last_path)


@pytest.mark.parametrize("name", NOTHING)
def test_before_the_first_path_it_is_straight_ahead(name: str) -> None:
    path, wall, valid = Fitter()(NOTHING[name], (1.0, 2.0, 0.5))
    assert valid == 0.0
    way = np.arange(150) * 0.01 - 0.3
    expected = [1.0 + way * math.cos(0.5), 2.0 + way * math.sin(0.5), 0.5 + 0.0 * way, 0.0 * way]
    np.testing.assert_allclose(path, np.transpose(expected), atol=1e-12)
    assert (wall == (1.0, 2.0)).all()


RANGES = st.one_of(
    st.floats(0.05, 1.2),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([math.inf, math.nan, -math.inf, 0.0, -0.3, 0.3, 0.31, 1e300, 5e-324]),
)


@st.composite
def scans(draw: st.DrawFn) -> np.ndarray:
    """Runs of equal, drifting, jumping or absent ranges."""
    n = draw(st.sampled_from([1, 2, 3, 12, 90, 180]))
    ranges = np.concatenate(
        [
            np.full(length, start) + slope * np.arange(length)
            for start, slope, length in draw(
                st.lists(
                    st.tuples(RANGES, st.sampled_from([0.0, 0.01, -0.02]), st.integers(1, 60)),
                    min_size=1,
                    max_size=20,
                )
            )
        ]
    )
    scan = np.resize(ranges, n)
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    scan += rng.normal(0.0, draw(st.sampled_from([0.0, 0.01, 0.3])), n)
    scan[rng.uniform(size=n) < draw(st.sampled_from([0.0, 0.1, 0.5]))] = math.inf
    return scan


@examples(300)
@given(
    first=scans(),
    form=st.sampled_from(["control_points", "least_squares"]),
    side=st.sampled_from(["right", "left"]),
    averaged=st.sampled_from([0.0, 0.03]),
    fillet=st.sampled_from([0.0, 0.15]),
)
def test_no_scan_breaks_it(
    first: np.ndarray, form: str, side: str, averaged: float, fillet: float
) -> None:
    fitter = Fitter(len(first), fit=form, side=side, bin=averaged, fillet=fillet)
    for scan in (first, np.full(len(first), math.inf)):
        path, wall, valid = fitter(scan, (0.5, -0.5, 2.0))
        assert path.shape == (150, 4)
        assert wall.shape == (100, 2)
        assert np.isfinite(path).all()
        assert np.isfinite(wall).all()
        assert valid in (0.0, 1.0)
        # What walks along the path measures its window in these.
        assert np.hypot(*np.diff(path[:, :2], axis=0).T).min() > 1e-3
    assert valid == 0.0
