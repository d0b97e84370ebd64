"""The tracking error: wrapping, and what a turn of the world leaves as it was."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import blocks
from blocks.core import wrap
from tests.blocks.direct import state_of

Pose = tuple[float, float, float]
BEYOND = float(np.nextafter(math.pi, 4.0))
angles = st.floats(-1e4, 1e4)
poses = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-20, 20))


def compare(pose: Pose, reference: Pose) -> Any:
    block = blocks.TrackingError()
    return block.output(state_of(block), 0.0, pose, reference)


@given(st.floats(allow_nan=False, allow_infinity=False))
@example(math.pi)
@example(-math.pi)
@example(BEYOND)
@example(-BEYOND)
@example(3.0 * math.pi)
@example(-3.0 * math.pi)
def test_wrapped_angles_lie_in_the_half_open_turn(angle: float) -> None:
    assert -math.pi < wrap(angle) <= math.pi


@given(st.floats(-1e6, 1e6))
def test_wrapping_takes_whole_turns_off(angle: float) -> None:
    """Exactly, in rational numbers: no digit of a small error is lost."""
    turns = (Fraction(angle) - Fraction(wrap(angle))) / Fraction(math.tau)
    assert turns.denominator == 1 or wrap(angle) == math.pi


@given(st.floats(-math.pi, math.pi, exclude_min=True))
def test_what_is_wrapped_stays(angle: float) -> None:
    assert wrap(angle) == angle


@given(angles)
def test_wrapping_leaves_sine_and_cosine(angle: float) -> None:
    assert math.sin(wrap(angle)) == pytest.approx(math.sin(angle), abs=1e-11)
    assert math.cos(wrap(angle)) == pytest.approx(math.cos(angle), abs=1e-11)


def test_no_number_stays_none() -> None:
    assert math.isnan(wrap(math.nan))


@given(poses, poses)
def test_error_is_pose_minus_reference(pose: Pose, reference: Pose) -> None:
    state, position, heading, lateral, along = compare(pose, reference)
    assert state[:2] == (pose[0] - reference[0], pose[1] - reference[1])
    assert state[2] == heading == wrap(pose[2] - reference[2])
    assert position == pytest.approx(math.dist(pose[:2], reference[:2]), abs=1e-12)
    # e_p is the offset's length in any frame.
    assert math.hypot(lateral, along) == pytest.approx(position, abs=1e-10)


@given(poses, poses, st.floats(-10, 10), st.floats(-50, 50), st.floats(-50, 50))
def test_a_turn_and_shift_of_the_world_is_not_seen(
    pose: Pose, reference: Pose, turn: float, dx: float, dy: float
) -> None:
    def moved(p: Pose) -> Pose:
        c, s = math.cos(turn), math.sin(turn)
        return c * p[0] - s * p[1] + dx, s * p[0] + c * p[1] + dy, p[2] + turn

    before, after = compare(pose, reference), compare(moved(pose), moved(reference))
    assert after[1] == pytest.approx(before[1], abs=1e-9)
    assert math.remainder(after[2] - before[2], math.tau) == pytest.approx(0.0, abs=1e-9)
    assert after[3:] == pytest.approx(before[3:], abs=1e-9)


@given(st.floats(-10, 10), st.floats(-3, 3), st.floats(-3, 3))
def test_left_and_ahead_are_positive(theta: float, along: float, lateral: float) -> None:
    """Put the robot so far ahead and so far left of the reference, as its own axes point."""
    forward = (math.cos(theta), math.sin(theta))
    left = (-math.sin(theta), math.cos(theta))
    x, y = (1.0 + along * f + lateral * n for f, n in zip(forward, left, strict=True))
    got = compare((x, y, theta), (1.0, 1.0, theta))
    assert got[3] == pytest.approx(lateral, abs=1e-12)
    assert got[4] == pytest.approx(along, abs=1e-12)


def test_a_robot_turned_too_far_left_has_a_positive_error() -> None:
    assert compare((0, 0, 0.2), (0, 0, 0.1))[2] == pytest.approx(0.1)
    assert compare((0, 0, 3.1), (0, 0, -3.1))[2] == pytest.approx(6.2 - math.tau)
