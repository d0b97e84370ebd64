"""The LQR against scipy, 50 digits, the paper's plain iteration and laws of optimality."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import cont2discrete

import blocks
import blocks.control.lqr
import runtime
from blocks.control.lqr import definiteness, feedback_gain, linearised, riccati
from blocks.core.signals import FloatArray
from tests.blocks.direct import state_of
from tests.examples import examples

Weights = tuple[FloatArray, FloatArray]


def log(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(math.log10(low), math.log10(high)).map(lambda e: 10.0**e)


def full(n: int, scale: st.SearchStrategy[float]) -> st.SearchStrategy[FloatArray]:
    """A symmetric matrix s (G G' + 0.01 I)."""

    def build(entries: list[float], s: float) -> FloatArray:
        g = np.array(entries).reshape(n, n)
        weight = s * (g @ g.T + 0.01 * np.eye(n))
        return np.asarray(0.5 * (weight + weight.T))

    return st.builds(build, st.lists(st.floats(-1, 1), min_size=n * n, max_size=n * n), scale)


headings = st.floats(-10.0, 10.0)
speeds = st.builds(lambda v, sign: sign * v, log(0.05, 3.0), st.sampled_from([1.0, -1.0]))
steps = log(1e-4, 0.5)
models = st.sampled_from(["paper", "exact"])
scales = log(1e-4, 1e3)
q_weights = st.one_of(
    scales.map(lambda s: s * np.eye(3)),
    st.tuples(scales, scales, scales).map(np.diag),
    full(3, scales),
)
r_scales = log(1e-2, 1e2)
r_weights = st.one_of(st.tuples(r_scales, r_scales).map(np.diag), full(2, r_scales))
poses = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))


def error(got: FloatArray, expected: FloatArray) -> float:
    """Largest difference, relative to the largest entry."""
    return float(np.abs(got - expected).max() / np.abs(expected).max())


def world(v_r: float, theta: float, dt: float, model: str) -> Weights:
    """A_k and B_k as the paper prints them, or held over a step, typed anew from the text."""
    a = np.array([[0, 0, -v_r * math.sin(theta)], [0, 0, v_r * math.cos(theta)], [0, 0, 0]])
    if model == "paper":
        b = np.array(
            [
                [math.cos(theta), -v_r * math.sin(theta) * dt],
                [math.sin(theta), v_r * math.cos(theta) * dt],
                [0, 1],
            ]
        )
        return np.eye(3) + dt * a, dt * b
    b = np.array([[math.cos(theta), 0], [math.sin(theta), 0], [0, 1]])
    held = expm(dt * np.block([[a, b], [np.zeros((2, 5))]]))
    return held[:3, :3], held[:3, 3:]


def plain_iteration(
    a: FloatArray, b: FloatArray, q: FloatArray, r: FloatArray, n: int
) -> FloatArray:
    """The paper's equation, n times from zero."""
    p = np.zeros_like(q)
    for _ in range(n):
        p = -a.T @ p @ b @ np.linalg.inv(r + b.T @ p @ b) @ b.T @ p @ a + q + a.T @ p @ a
    return p


def _solve(a: Any, b: Any) -> Any:
    """Gauss elimination with pivots, on arrays of Decimals."""
    a, b = a.copy(), b.copy()
    for i in range(len(a)):
        pivot = max(range(i, len(a)), key=lambda row: abs(a[row, i]))
        a[[i, pivot]], b[[i, pivot]] = a[[pivot, i]], b[[pivot, i]]
        for row in range(len(a)):
            if row != i:
                factor = a[row, i] / a[i, i]
                a[row] -= factor * a[i]
                b[row] -= factor * b[i]
    return b / np.diag(a)[:, None]


def polished(a: FloatArray, b: FloatArray, q: FloatArray, r: FloatArray) -> Weights:
    """P and K of the Riccati equation: scipy's, after Newton's method in 50 digits.

    Where all poles lie within 1e-6 of the circle scipy itself is good to three digits only.
    """
    start = solve_discrete_are(a, b, q, r)
    with localcontext() as context:
        context.prec = 50
        exact = np.vectorize(Decimal, otypes=[object])
        a, b, q, r, p = (exact(m.astype(object)) for m in (a, b, q, r, start))
        one = exact(np.eye(9).astype(object))
        for _ in range(4):
            k = _solve(r + b.T @ p @ b, b.T @ p @ a)
            f = a - b @ k
            rest = (q + k.T @ r @ k).reshape(9, 1)
            p = _solve(one - np.kron(f.T, f.T), rest).reshape(3, 3)
        k = _solve(r + b.T @ p @ b, b.T @ p @ a)
        return p.astype(float), k.astype(float)


@examples(150)
@given(headings, speeds, steps, models, q_weights, r_weights)
def test_riccati_and_gain_to_1e_10(
    theta: float, v_r: float, dt: float, model: str, q: FloatArray, r: FloatArray
) -> None:
    a, b = linearised(v_r, theta, dt, model)
    p = riccati(a, b, q, r)
    expected_p, expected_k = polished(a, b, q, r)
    assert error(p, expected_p) < 1e-10
    assert error(feedback_gain(a, b, r, p), expected_k) < 1e-10
    assert np.array_equal(p, p.T)


@examples(100)
@given(headings, speeds, log(0.005, 0.5), q_weights, r_weights)
def test_riccati_is_scipys(
    theta: float, v_r: float, dt: float, q: FloatArray, r: FloatArray
) -> None:
    a, b = linearised(v_r, theta, dt)
    expected = solve_discrete_are(a, b, q, r)
    # scipy is good to about 1e-16 over the distance of the slowest pole from the circle.
    k = np.linalg.solve(r + b.T @ expected @ b, b.T @ expected @ a)
    slowest = 1.0 - np.abs(np.linalg.eigvals(a - b @ k)).max()
    assert error(riccati(a, b, q, r), expected) < 1e-8 + 1e-12 / slowest


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.2, -2.0, 9.0])
@pytest.mark.parametrize(
    "q",
    [
        np.diag([1.0, 1.0, 1.0]),
        np.diag([10.0, 1.0, 0.1]),
        np.array([[2.0, 0.5, 0.0], [0.5, 1.0, -0.3], [0.0, -0.3, 0.7]]),
        np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]) + np.diag([0.0, 1.0, 0.0]),
        np.diag([1.0, 1.0, 0.0]),
    ],
)
def test_riccati_is_the_papers_iteration(theta: float, q: FloatArray) -> None:
    r = np.array([[1.0, 0.2], [0.2, 0.5]])
    a, b = linearised(0.8, theta, 0.1)
    expected = plain_iteration(a, b, q, r, 2000)
    assert error(plain_iteration(a, b, q, r, 1900), expected) < 1e-12  # converged
    assert error(riccati(a, b, q, r), expected) < 1e-10


@pytest.mark.parametrize("theta", [0.0, 0.3, -2.0])
@pytest.mark.parametrize("q", [[0, 1, 1], [0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, 0]])
def test_states_without_weight(theta: float, q: list[float]) -> None:
    """Semi-definite weights that do not see every state: scipy refuses them, the paper does not."""
    a, b = linearised(1.0, 0.0, 0.1)
    turn = np.array(
        [[math.cos(theta), -math.sin(theta), 0], [math.sin(theta), math.cos(theta), 0], [0, 0, 1]]
    )
    weight, r = turn.T @ np.diag(np.array(q, float)) @ turn, np.eye(2)
    expected = plain_iteration(a, b, weight, r, 600)
    np.testing.assert_allclose(riccati(a, b, weight, r), expected, rtol=0.0, atol=1e-8)


def test_a_doubling_is_counted_as_the_iterations_it_stands_for() -> None:
    q, r = np.diag([1.0, 2.0, 3.0]), np.eye(2)
    a, b = linearised(1.0, 0.4, 0.2)
    second = riccati(a, b, q, r, tolerance=math.inf, max_iterations=2)
    np.testing.assert_allclose(second, plain_iteration(a, b, q, r, 2), rtol=1e-13)
    with pytest.raises(ValueError, match="has not converged after 1 iterations"):
        riccati(a, b, q, r, tolerance=math.inf, max_iterations=1)
    with pytest.raises(ValueError, match="has not converged after 8 iterations"):
        riccati(a, b, q, r, max_iterations=8)
    riccati(a, b, q, r, max_iterations=4096)


@given(headings, speeds, steps)
def test_paper_model_is_as_printed(theta: float, v_r: float, dt: float) -> None:
    for got, expected in zip(
        linearised(v_r, theta, dt, "paper"), world(v_r, theta, dt, "paper"), strict=True
    ):
        np.testing.assert_allclose(got, expected, rtol=1e-14, atol=0.0)


@given(headings, speeds, steps)
def test_exact_model_is_the_zero_order_hold(theta: float, v_r: float, dt: float) -> None:
    got_a, got_b = linearised(v_r, theta, dt, "exact")
    a, b = world(v_r, theta, dt, "exact")
    np.testing.assert_allclose(got_a, a, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(got_b, b, rtol=1e-12, atol=1e-15)
    rates = np.array([[0, 0, -v_r * math.sin(theta)], [0, 0, v_r * math.cos(theta)], [0, 0, 0]])
    inputs = np.array([[math.cos(theta), 0], [math.sin(theta), 0], [0, 1]])
    held = cont2discrete((rates, inputs, np.eye(3), np.zeros((3, 2))), dt, "zoh")
    np.testing.assert_allclose(got_a, held[0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(got_b, held[1], rtol=1e-12, atol=1e-15)


def test_models_differ_by_half_the_second_order_term() -> None:
    _, paper = linearised(0.7, 0.6, 0.05, "paper")
    _, exact = linearised(0.7, 0.6, 0.05, "exact")
    half = 0.5 * 0.7 * 0.05**2
    expected = np.array([[0, -half * math.sin(0.6)], [0, half * math.cos(0.6)], [0, 0]])
    np.testing.assert_allclose(paper - exact, expected, rtol=1e-12, atol=1e-18)


def command(block: blocks.LQR, dt: float, theta: float, e: tuple[float, float, float]) -> Any:
    state = state_of(block, dt=dt)
    return block.output(state, 0.0, e, (3.0, -1.0, theta))


def lists(weight: FloatArray) -> list[Any]:
    return list(weight.tolist())


@examples(80)
@given(headings, speeds, log(0.005, 0.5), models, q_weights, r_weights, poses)
def test_command_is_the_world_frames(
    theta: float,
    v_r: float,
    dt: float,
    model: str,
    q: FloatArray,
    r: FloatArray,
    e: tuple[float, float, float],
) -> None:
    """u = -K(theta) e with K of the Riccati equation in the world's frame."""
    block = blocks.LQR(q=lists(q), r=lists(r), v_r=v_r, model=model)
    a, b = world(v_r, theta, dt, model)
    _, k = polished(a, b, q, r)
    got = np.array(command(block, dt, theta, e))
    # K stands on A and B as they were rounded here, which a slow pole amplifies.
    assert np.abs(got + k @ e).max() <= 1e-8 * np.abs(k).max() * (1.0 + np.abs(e).max())


@pytest.mark.parametrize("q", [[0.5, 0.5, 2.0], [1.0, 5.0, 0.3]])
@pytest.mark.parametrize("theta", [0.0, 2.1, -8.0])
def test_solvers_agree(q: list[float], theta: float) -> None:
    e = (0.3, -0.2, 0.5)
    ours, direct = (
        command(blocks.LQR(q=q, r=[1.0, 2.0], v_r=0.6, solver=solver), 0.02, theta, e)
        for solver in ("riccati", "dare")
    )
    np.testing.assert_allclose(ours, direct, rtol=1e-10)


@examples(60)
@given(headings, speeds, steps, models, q_weights, r_weights)
def test_closed_loop_is_stable(
    theta: float, v_r: float, dt: float, model: str, q: FloatArray, r: FloatArray
) -> None:
    a, b = world(v_r, theta, dt, model)
    k = feedback_gain(a, b, r, riccati(a, b, q, r))
    assert np.abs(np.linalg.eigvals(a - b @ k)).max() < 1.0


@examples(40)
@given(headings, speeds, log(0.02, 0.5), q_weights, r_weights, poses)
def test_cost_paid_and_cost_to_go_are_conserved(
    theta: float,
    v_r: float,
    dt: float,
    q: FloatArray,
    r: FloatArray,
    e: tuple[float, float, float],
) -> None:
    """Bellman: what was paid plus x'Px is x_0'Px_0 at every step of the optimal run."""
    block = blocks.LQR(q=lists(q), r=lists(r), v_r=v_r)
    state = state_of(block, dt=dt)
    a, b = world(v_r, theta, dt, "paper")
    c, s = math.cos(theta), math.sin(theta)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    x, paid, budget = np.array(e), 0.0, 0.0
    for step in range(20):
        u = np.array(block.output(state, 0.0, tuple(x.tolist()), (0.0, 0.0, theta)))
        to_go = x @ turn @ state.cost_to_go @ turn.T @ x
        budget = budget or to_go
        assert paid + to_go == pytest.approx(budget, rel=1e-9, abs=1e-300), step
        paid += x @ q @ x + u @ r @ u
        x = a @ x + b @ u


@examples(30)
@given(speeds, log(0.01, 0.5), q_weights, r_weights, log(1e-3, 1e3))
def test_gain_depends_on_the_ratio_of_weights(
    v_r: float, dt: float, q: FloatArray, r: FloatArray, factor: float
) -> None:
    gains = [
        blocks.LQR(q=lists(s * q), r=lists(s * r), v_r=v_r).solve(dt, 0.7)[1] for s in (1.0, factor)
    ]
    assert error(gains[1], gains[0]) < 1e-9


@pytest.fixture
def solutions(monkeypatch: pytest.MonkeyPatch) -> list[FloatArray]:
    """The weights Q of every Riccati equation that is solved."""
    solved: list[FloatArray] = []

    def counted(a: FloatArray, b: FloatArray, q: FloatArray, *rest: Any) -> FloatArray:
        solved.append(q)
        return riccati(a, b, q, *rest)

    monkeypatch.setattr("blocks.control.lqr.riccati", counted)
    return solved


def after_start(block: blocks.LQR, solutions: list[FloatArray]) -> blocks.BlockState:
    state = state_of(block)
    solutions.clear()
    return state


def test_gain_is_kept_while_the_heading_stands(solutions: list[FloatArray]) -> None:
    block = blocks.LQR(q=[1.0, 4.0, 1.0])
    state = after_start(block, solutions)
    for theta, count in [(0.5, 1), (0.5, 1), (0.5, 1), (0.6, 2), (0.6, 2), (0.5, 3)]:
        block.output(state, 0.0, (0.1, 0.2, 0.3), (0.0, 0.0, theta))
        assert len(solutions) == count
        assert state.solved_at[0] == theta


@pytest.mark.parametrize("q", [[2.0, 2.0, 5.0], [[2, 0, 0], [0, 2, 0], [0, 0, 5]]])
def test_weights_that_see_no_direction_are_solved_once(
    q: list[Any], solutions: list[FloatArray]
) -> None:
    block = blocks.LQR(q=q)
    state = after_start(block, solutions)
    for theta in (0.0, 0.5, -1.0, 7.0):
        block.output(state, 0.0, (0.1, 0.2, 0.3), (0.0, 0.0, theta))
    assert not solutions


@pytest.mark.parametrize(
    "q",
    [
        [2.0, 2.1, 5.0],
        [[2, 0.1, 0], [0.1, 2, 0], [0, 0, 5]],
        [[2, 0, 0.1], [0, 2, 0], [0.1, 0, 5]],
        [[2, 0, 0], [0, 2, 0.1], [0, 0.1, 5]],
    ],
)
def test_weights_that_see_a_direction_are_solved_anew(
    q: list[Any], solutions: list[FloatArray]
) -> None:
    block = blocks.LQR(q=q)
    state = after_start(block, solutions)
    block.output(state, 0.0, (0.1, 0.2, 0.3), (0.0, 0.0, 1.0))
    assert len(solutions) == 1


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"v_r": 0.0}, "LQR.v_r: at 0 the lateral error is uncontrollable"),
        ({"q": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]}, "LQR.q: a weight must be symmetric"),
        ({"r": [[1, 0.5], [0.4, 1]]}, "LQR.r: a weight must be symmetric"),
        ({"q": [1, -1, 1]}, "LQR.q: a weight must be positive semi-definite"),
        ({"q": [1e4, 1e4, -1e-13]}, "LQR.q: a weight must be positive semi-definite"),
        ({"q": [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}, "LQR.q: a weight must be positive semi-def"),
        ({"q": [[0, 1, 0], [1, 1, 0], [0, 0, 1]]}, "LQR.q: a weight must be positive semi-def"),
        ({"r": [1, 0]}, "LQR.r: a weight must be positive definite"),
        ({"r": [1, -1]}, "LQR.r: a weight must be positive definite"),
        ({"r": [[1, 1], [1, 1]]}, "LQR.r: a weight must be positive definite"),
        ({"r": [[0.1, 0.3], [0.3, 0.9]]}, "LQR.r: a weight must be positive definite"),
        ({"q": [1, 1]}, "LQR.q: expected an array of 3 or 3x3 numbers"),
        ({"r": [[1, 0, 0], [0, 1, 0]]}, "LQR.r: expected an array of 2 or 2x2 numbers"),
        ({"model": "euler"}, "LQR.model: expected one of paper, exact, got the string 'euler'"),
    ],
)
def test_bad_parameters(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(blocks.ParameterError) as caught:
        blocks.LQR(**parameters)
    assert message in str(caught.value)


def test_all_that_is_wrong_is_said_at_once() -> None:
    with pytest.raises(blocks.ParameterError) as caught:
        blocks.LQR(v_r=0, q=[-1, 1, 1], r=[0, 1])
    assert [name for name, _ in caught.value.problems] == ["v_r", "q", "r"]


@examples(60)
@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6), log(1e-8, 1e8), log(1e-4, 1e4))
def test_semi_definite_weights_of_any_size_are_taken(
    entries: list[float], scale: float, unit: float
) -> None:
    """G G' of rank two, in units of one's own, has a smallest eigenvalue of zero and rounding."""
    g = scale * np.array(entries).reshape(3, 2) * np.array([[1.0], [1.0], [unit]])
    q = g @ g.T
    # A square below 2.2e-308 is stored with fewer digits, and is no longer a square to rounding.
    assume(all(x == 0.0 or x > 1e-290 for x in np.diag(q)))
    assert blocks.LQR(q=lists(np.asarray(0.5 * (q + q.T)))).weights[0].shape == (3, 3)


def test_definiteness_does_not_see_units() -> None:
    weight = np.array([[2.0, 0.6], [0.6, 1.0]])
    units = np.diag([1e-6, 1e5])
    # The scaled matrix has ones and rho beside them, so 1 - rho.
    assert definiteness(weight) == pytest.approx(1.0 - 0.6 / math.sqrt(2.0))
    assert definiteness(units @ weight @ units) == pytest.approx(definiteness(weight))
    assert definiteness(-np.eye(2)) == -1.0


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"max_iterations": 4},
            "lqr.max_iterations: the Riccati equation has not converged after 4",
        ),
        ({"v_r": 1e-9}, "the closer v_r = 1e-09 m/s is to 0, the longer it takes"),
        ({"q": [0, 0, 1], "solver": "dare"}, "'riccati' takes a q that leaves states out"),
    ],
)
def test_what_cannot_be_solved_is_refused_before_the_run(
    parameters: dict[str, Any], message: str
) -> None:
    graph = runtime.Graph(dt=0.01, until=0.1)
    graph = graph.add("p", blocks.Constant(value=[0, 0, 0], signal="Pose"))
    graph = graph.add("e", blocks.TrackingError()).add("lqr", blocks.LQR(**parameters))
    graph = graph.connect("p.value", "e.pose").connect("p.value", "e.reference")
    graph = graph.connect("e.state", "lqr.error").connect("p.value", "lqr.reference")
    with pytest.raises(runtime.GraphError) as caught:
        graph.check()
    assert message in str(caught.value)
