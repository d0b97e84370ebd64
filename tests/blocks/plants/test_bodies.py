"""Bodies in space against scipy, with equations written anew here, and what is conserved."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import blocks
import runtime
from tests.blocks.direct import state_of

J = np.diag([0.0820, 0.0845, 0.1377])
ARM, RATIO, MASS, G, TAU = 0.315, 0.008004, 4.34, 9.81, 0.02
DRAG = np.diag([0.8, 0.7, 0.5])


def quaternion_rate(q: Any, w: Any) -> Any:
    return 0.5 * np.concatenate([[-q[1:] @ w], q[0] * w + np.cross(q[1:], w)])


def quadrotor(t: float, x: Any, commands: Any, force: Any, wind: Any) -> Any:
    """Lee, Leok and McClamroch (2010), with z up, drag and rotors that lag; moments from r x F."""
    v, q, w, f = x[3:6], x[6:10], x[10:13], x[13:17]
    rotation = Rotation.from_quat([q[1], q[2], q[3], q[0]]).as_matrix()
    places = ARM * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    moment = sum(np.cross(places[i], [0, 0, f[i]]) for i in range(4))
    moment = moment + np.array([0, 0, RATIO * (f[0] - f[1] + f[2] - f[3])])
    pull = rotation @ [0, 0, f.sum()] - rotation @ DRAG @ rotation.T @ (v - wind) + force
    turning = np.linalg.solve(J, moment - np.cross(w, J @ w))
    rise = (np.clip(commands(t), 0, 25) - f) / TAU
    return np.concatenate([v, pull / MASS - [0, 0, G], quaternion_rate(q, w), turning, rise])


def test_a_quadrotor_flies_as_scipy_says() -> None:
    def commands(t: float) -> Any:
        return 10.6 + np.array([0.3, -0.2, 0.1, 0.4]) * np.sin([3 * t, 2 * t, 5 * t, 4 * t])

    force, wind = np.array([0.5, -1.0, 0.3]), np.array([2.0, 1.0, -0.5])
    texts = [f"10.6 + {a}*sin({w}*t)" for a, w in ((0.3, 3), (-0.2, 2), (0.1, 5), (0.4, 4))]
    graph = runtime.load(
        {
            "run": {"dt": 0.01, "until": 1.5, "solver": "dopri5", "rtol": 1e-12, "atol": 1e-12},
            "blocks": {
                "rotors": {"type": "Function", "expression": texts},
                "force": {"type": "Constant", "value": force.tolist()},
                "wind": {"type": "Constant", "value": wind.tolist()},
                "it": {
                    "type": "Quadrotor",
                    "drag": np.diag(DRAG).tolist(),
                    "velocity0": [1, 0.5, -0.2],
                    "rate0": [0.1, -0.2, 0.3],
                },
            },
            "wires": {"it": {"rotors": "rotors.out", "force": "force.value", "wind": "wind.value"}},
            "probes": {"x": "it.x", "thrust": "it.thrust", "a": "it.acceleration"},
        }
    )
    result = graph.run()
    begin = [0, 0, 0, 1, 0.5, -0.2, 1, 0, 0, 0, 0.1, -0.2, 0.3, *[0.25 * MASS * G] * 4]
    given_to = (commands, force, wind)
    times = 0.01 * np.arange(150)
    exact = solve_ivp(
        quadrotor, (0, 1.5), begin, "DOP853", times, rtol=1e-12, atol=1e-12, args=given_to
    )
    np.testing.assert_allclose(result["x"], exact.y[:13].T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(result["thrust"], exact.y[13:].T, rtol=0, atol=1e-9)
    rates = [quadrotor(t, x, *given_to)[3:6] for t, x in zip(times, exact.y.T, strict=True)]
    np.testing.assert_allclose(result["a"], rates, rtol=0, atol=1e-8)


def test_a_free_body_keeps_energy_and_momentum() -> None:
    inertia = np.array([[2.0, 0.1, 0.0], [0.1, 3.0, 0.2], [0.0, 0.2, 4.0]])
    entry = {"type": "RigidBody", "inertia": inertia.tolist(), "rate0": [0.3, 2.0, 0.1]}
    graph = runtime.load(
        {
            "run": {"dt": 0.01, "until": 20.0, "solver": "dopri5", "rtol": 1e-11, "atol": 1e-12},
            "blocks": {"it": {**entry, "velocity0": [1, 2, 3], "attitude0": [1, 1, 0, 0]}},
            "probes": {"q": "it.attitude", "w": "it.rate", "p": "it.position"},
        }
    )
    result = graph.run()
    q, w = result["q"], result["w"]
    energy = np.einsum("ki,ij,kj->k", w, inertia, w)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    turned = Rotation.from_quat(q[:, [1, 2, 3, 0]]).apply(w @ inertia)
    np.testing.assert_allclose(turned, turned[:1].repeat(len(q), 0), atol=1e-7)
    np.testing.assert_allclose(result["p"][-1], 19.99 * np.array([1, 2, 3]), rtol=1e-9)
    # The middle axis is not stable: it turns over.
    assert w[:, 1].min() < -1.5


wrenches = st.tuples(st.floats(20, 60), st.floats(-2, 2), st.floats(-2, 2), st.floats(-0.05, 0.05))


@given(wrenches, st.sampled_from(["plus", "cross"]))
def test_a_mixer_gives_what_the_quadrotor_makes_of_it(wrench: Any, layout: str) -> None:
    mixer = blocks.RotorMixer(layout=layout)
    thrusts = mixer.output(state_of(mixer), 0.0, np.array(wrench))
    quad = blocks.Quadrotor(layout=layout)
    np.testing.assert_allclose(state_of(quad).allocation @ thrusts, wrench, atol=1e-9)


@given(st.lists(st.floats(-500, 500), min_size=4, max_size=4))
def test_what_rotors_cannot_do_keeps_directions(wrench: Any) -> None:
    mixer = blocks.RotorMixer()
    state = state_of(mixer)
    thrusts = mixer.output(state, 0.0, np.array(wrench))
    assert (thrusts >= -1e-9).all() and (thrusts <= 25 + 1e-9).all()
    got = np.linalg.solve(state.inverse, thrusts)
    # Both torques by one factor, as large as a difference of 25 N between two rotors allows.
    factor = min(1.0, 25 * mixer.arm / max(abs(wrench[1]), abs(wrench[2]), 1e-9))
    np.testing.assert_allclose(got[1:3], factor * np.array(wrench[1:3]), atol=1e-9)
    # The thrust as near to the wanted one as these leave.
    tilt = state.inverse[:, 1:3] @ got[1:3]
    nearest = 4 * np.clip(0.25 * wrench[0], -tilt.min(), 25 - tilt.max())
    np.testing.assert_allclose(got[0], nearest, atol=1e-9)
    assert got[3] * wrench[3] >= -1e-9 and abs(got[3]) <= abs(wrench[3]) + 1e-9


def test_an_impossible_inertia_is_refused() -> None:
    for inertia, part in (
        ([1, 1, 3], "none above the sum"),
        ([[1, 2, 0], [0, 1, 0], [0, 0, 1]], "symm"),
    ):
        try:
            blocks.RigidBody(inertia=inertia)
        except blocks.ParameterError as error:
            assert part in str(error)
        else:
            raise AssertionError(inertia)
