"""MPC: without limits the LQR; with them, a general solver of the same program."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are
from scipy.optimize import minimize, nnls

import blocks
from blocks import LQR, MPC
from blocks.control.lqr import linearised
from blocks.control.quadratic_program import minimum, nearest
from blocks.control.tracking import offsets
from tests.blocks.control.test_trackers import STEP, ask, drive
from tests.blocks.direct import state_of
from tests.examples import examples

numbers = st.floats(-0.5, 0.5)


@given(numbers, numbers, numbers, st.floats(-7.0, 7.0), st.integers(1, 20))
@examples(30)
def test_without_limits_it_is_the_lqr(
    along: float, lateral: float, heading: float, at: float, steps: int
) -> None:
    weights = {"q": [2.0, 2.0, 0.5], "r": [1.0, 0.3], "v_r": 0.4}
    mpc = MPC(**weights, horizon=steps * STEP, steps=steps, omega_max=math.inf)
    got = ask(mpc, state_of(mpc, dt=STEP), along, lateral, heading, at)
    lqr = LQR(**weights)
    expected = ask(lqr, state_of(lqr, dt=STEP), along, lateral, heading, at)
    assert got == pytest.approx(expected, rel=1e-7, abs=1e-9)


def cost_of(mpc: MPC, x0: np.ndarray) -> Callable[[np.ndarray], float]:
    """The cost of a plan from a state, by simulating the model."""
    a, b = linearised(mpc.v_r, 0.0, mpc.horizon / mpc.steps, mpc.model)
    q, r = np.diag(mpc.q), np.diag(mpc.r)
    beyond = solve_discrete_are(a, b, q, r) - q

    def cost(commands: np.ndarray) -> float:
        x, total = x0, 0.0
        for u in commands.reshape(-1, 2):
            total += float(u @ r @ u)
            x = a @ x + b @ u
            total += float(x @ q @ x)
        return total + float(x @ beyond @ x)

    return cost


@given(st.floats(-2.0, 2.0), st.floats(-1.5, 1.5), st.floats(-0.5, 0.5), st.floats(-0.4, 0.4))
@examples(10)
def test_at_its_limits_it_is_a_general_solver(
    lateral: float, heading: float, before: float, turn: float
) -> None:
    mpc = MPC(v_r=0.5, horizon=0.8, steps=4, omega_max=0.6, omega_rate=2.0, v_max=0.7, v_rate=1.0)
    state = state_of(mpc, dt=STEP)
    state.last[:] = 0.5, before
    x = np.array([0.3, lateral, heading])
    u = np.array(mpc.output(state, 0.0, tuple(x), (0.0, 0.0, 0.0), turn))

    h = 0.2
    added = np.array([0.5, turn])
    last = np.array([0.5, before])

    def room(commands: np.ndarray) -> np.ndarray:
        total = commands.reshape(-1, 2) + added
        changes = np.abs(np.diff(np.vstack((last, total)), axis=0))
        allowed = np.array([1.0, 2.0]) * np.array([[STEP], [h], [h], [h]])
        return np.concatenate(
            ((np.array([0.7, 0.6]) - np.abs(total)).ravel(), (allowed - changes).ravel())
        )

    start, cost = np.tile(last - added, 4), cost_of(mpc, x)
    found = minimize(
        cost,
        start,
        method="SLSQP",
        constraints={"type": "ineq", "fun": room},
        options={"ftol": 1e-12, "maxiter": 500},
    )
    # Both are feasible, and no general solver finds a better plan than ours.
    bounds = mpc.bounds(state, turn)
    plan = minimum(state.free, state.root, state.of_x, state.of_z, x, bounds)
    assert room(plan).min() > -1e-7
    np.testing.assert_allclose(plan[:2], u)
    if found.success:
        assert cost(plan) <= found.fun + 1e-6 * (1.0 + abs(found.fun))


def least_distance(rows: np.ndarray, room: np.ndarray) -> np.ndarray | None:
    """The same by non-negative least squares on the dual; None where there is none.

    Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23.
    """
    used = np.isfinite(room)
    if not used.any():
        return np.zeros(rows.shape[1])
    system = np.vstack((-rows[used].T, -room[used]))
    target = np.append(np.zeros(rows.shape[1]), 1.0)
    multipliers, _ = nnls(system, target, maxiter=10_000)
    residual = system @ multipliers - target
    return None if residual[-1] > -1e-9 else -residual[:-1] / residual[-1]


@given(seed=st.integers(0, 2**31), d=st.integers(1, 6), k=st.integers(0, 14), plain=st.booleans())
@examples(200)
def test_the_active_set_method_finds_what_least_squares_finds(
    seed: int, d: int, k: int, plain: bool
) -> None:
    """Small integers make rows that repeat, oppose and depend on each other."""
    draw = np.random.default_rng(seed)
    rows = draw.integers(-2, 3, (k, d)).astype(float) if plain else draw.standard_normal((k, d))
    room = draw.integers(-2, 4, k).astype(float) if plain else draw.standard_normal(k) + 0.5
    room[draw.random(k) < 0.2] = math.inf
    expected = least_distance(rows, room)
    if expected is None:
        with pytest.raises(ArithmeticError, match="no command satisfies the limits"):
            nearest(rows, room)
        return
    found = nearest(rows, room)
    assert (rows @ found - room).max(initial=0.0) < 1e-8
    np.testing.assert_allclose(found, expected, atol=1e-7 * (1.0 + np.abs(expected).max()))


def test_the_limits_hold_in_a_run() -> None:
    mpc = MPC(v_r=0.5, omega_max=0.8, omega_rate=1.5, v_max=0.6, v_rate=0.5)
    result = drive(mpc, 1.0, 1.5, 12.0, STEP)
    assert abs(result["plant.pose"][-1, 1]) < 0.02
    state = state_of(mpc, dt=STEP)
    turns = [ask(mpc, state, 0.0, 1.0, 1.5 - 0.01 * k)[1] for k in range(150)]
    assert max(abs(turn) for turn in turns) <= 0.8 + 1e-9
    assert np.abs(np.diff(turns)).max() <= 1.5 * STEP + 1e-9
    assert min(turns) == pytest.approx(-0.8)


def test_the_error_is_taken_in_the_paths_frame() -> None:
    mpc = MPC()
    error = (0.1, 0.2, 0.3)
    along, lateral = offsets(error, 1.0)
    state = state_of(mpc, dt=STEP)
    turned = mpc.output(state, 0.0, error, (0.0, 0.0, 1.0), 0.0)
    straight = mpc.output(state, 0.0, (along, lateral, 0.3), (0.0, 0.0, 0.0), 0.0)
    assert turned == pytest.approx(straight)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"v_r": 0.0}, "v_r: at 0 the lateral error"),
        ({"v_max": 0.5}, "v_max: expected at least .v_r. = 1 m/s, got 0.5"),
    ],
)
def test_bad_parameters(parameters: dict[str, float], message: str) -> None:
    with pytest.raises(blocks.ParameterError, match=message):
        MPC(**parameters)


def test_the_horizon_is_not_shorter_than_its_ticks() -> None:
    with pytest.raises(blocks.ParameterError, match=r"horizon: expected at least steps \* dt"):
        state_of(MPC(horizon=0.05), dt=STEP)
