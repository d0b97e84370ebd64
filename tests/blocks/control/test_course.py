"""The deviation of the course: geometry, and its slope near the path."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blocks import CourseError
from tests.blocks.direct import state_of

angles = st.floats(-1.5, 1.5)


def deviation(block: CourseError, lateral: float, heading: float, at: float) -> float:
    error = (-math.sin(at) * lateral, math.cos(at) * lateral, heading)
    return block.output(state_of(block), 0.0, error, (3.0, -1.0, at))


@given(lateral=st.floats(-9.0, 9.0), at=angles, v_r=st.floats(0.1, 3.0), ahead=st.floats(0.2, 5.0))
def test_it_is_zero_when_looking_at_the_point_ahead(
    lateral: float, at: float, v_r: float, ahead: float
) -> None:
    block = CourseError(v_r=v_r, lookahead_time=ahead)
    bearing = math.atan2(-lateral, v_r * ahead)
    assert deviation(block, lateral, bearing, at) == pytest.approx(0.0, abs=1e-12)
    assert deviation(block, lateral, bearing + 0.2, at) == pytest.approx(0.2)


def test_near_the_path_it_is_the_sum_of_both_errors() -> None:
    block = CourseError(v_r=0.2, lookahead_time=1.0)
    assert deviation(block, 1e-4, 2e-4, 0.7) == pytest.approx(2e-4 + 5.0 * 1e-4, rel=1e-6)
