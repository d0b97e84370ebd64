"""Geometric control against its own equations in matrices, and what they promise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import blocks
import runtime
from blocks.control.geometric import wanted_frames
from tests.blocks.direct import state_of

M, G, J = 4.34, 9.81, np.diag([0.0820, 0.0845, 0.1377])
numbers = st.floats(-2, 2)
triple = st.tuples(numbers, numbers, numbers)


def hat(w: Any) -> Any:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def vee(m: Any) -> Any:
    return np.array([m[2, 1], m[0, 2], m[1, 0]])


@given(triple, triple, triple, triple, triple, triple, st.floats(-3, 3))
def test_it_is_the_papers_law(
    position: Any, velocity: Any, rate: Any, q: Any, a: Any, jerk: Any, yaw: float
) -> None:
    block = blocks.GeometricControl()
    x, v, w, ad, jd = map(np.array, (position, velocity, rate, a, jerk))
    quaternion = np.array([4.0, *q])
    zero = np.zeros(3)
    found = block.output(state_of(block), 0.0, x, v, quaternion, w, zero, zero, ad, jd, yaw, zero)
    now = Rotation.from_quat(quaternion[[1, 2, 3, 0]]).as_matrix()
    e3 = np.array([0.0, 0, 1])

    def wanted(x: Any, v: Any, ad: Any) -> Any:
        return -block.kx * x - block.kv * v + M * G * e3 + M * ad

    def frame(force: Any) -> Any:
        z = force / np.linalg.norm(force)
        side = np.cross(z, [math.cos(yaw), math.sin(yaw), 0])
        y = side / np.linalg.norm(side)
        return np.column_stack([np.cross(y, z), y, z])

    force = wanted(x, v, ad)
    if np.linalg.norm(np.cross(force, [math.cos(yaw), math.sin(yaw), 0])) < 5.0:
        return  # its direction is nearly that of the heading: no frame
    thrust = force @ now[:, 2]
    # The frame a moment before and after, on a motion with that thrust.
    moves = max(thrust, 0.0) * now[:, 2] / M - G * e3
    h = 1e-6
    before, after = (frame(wanted(x + s * v, v + s * (moves - ad), ad + s * jd)) for s in (-h, h))
    desired = frame(force)
    turn = vee(desired.T @ (after - before) / (2 * h))
    error = 0.5 * vee(desired.T @ now - now.T @ desired)
    own = now.T @ desired @ turn
    moment = -block.kr * error - block.kw * (w - own) + np.cross(w, J @ w) - J @ hat(w) @ own
    np.testing.assert_allclose(found[0], thrust, rtol=1e-9, atol=1e-9)
    scale = 1.0 + np.abs(moment).max()
    np.testing.assert_allclose(found[1:], moment, atol=2e-5 * scale)


@given(triple, st.floats(-3, 3))
def test_the_wanted_frame_is_a_rotation(tilt: Any, yaw: float) -> None:
    frames = wanted_frames(np.array(tilt) + np.array([0, 0, 30.0]), np.array(tilt), yaw)
    np.testing.assert_allclose(frames[0].T @ frames[0], np.eye(3), atol=1e-12)
    # R' R_c' is skew: what changes stays a rotation.
    skew = frames[0].T @ frames[1]
    np.testing.assert_allclose(skew, -skew.T, atol=1e-12)


def test_from_upside_down_it_comes_to_the_path() -> None:
    """The paper's second example: it recovers from an attitude near 180 degrees."""
    flip = math.radians(178)
    graph = runtime.load(
        {
            "run": {"dt": 0.005, "until": 6.0, "solver": "rk4"},
            "blocks": {
                "quad": {
                    "type": "Quadrotor",
                    "tau": 0.005,
                    "largest": 100.0,
                    "attitude0": [math.cos(flip / 2), math.sin(flip / 2), 0, 0],
                },
                "path": {"type": "Lemniscate", "size": [0, 0, 0]},
                "control": {"type": "GeometricControl"},
                "mixer": {"type": "RotorMixer", "largest": 100.0},
            },
            "wires": {
                "quad": {"rotors": "mixer.rotors"},
                "control": {
                    **{
                        name: f"quad.{name}"
                        for name in ("position", "velocity", "attitude", "rate")
                    },
                    "target": "path.position",
                },
                "mixer": {"wrench": "control.wrench"},
            },
            "probes": {"errors": "control.errors", "q": "quad.attitude"},
        }
    )
    result = graph.run()
    assert np.abs(result["errors"]).max() > 0.5
    assert np.abs(result["errors"][-1]).max() < 1e-3
    assert abs(abs(result["q"][-1, 0]) - 1.0) < 1e-3
