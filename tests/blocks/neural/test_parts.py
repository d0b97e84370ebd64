"""Distributions, synapses and solvers against their definitions, SciPy and Nengo."""

from __future__ import annotations

from typing import Any

import nengo
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.spatial import distance

from blocks.core import SettingError
from blocks.neural.decoder_solvers import DecoderSolver, Lasso, SingularError, ridge
from blocks.neural.distributions import Distribution
from blocks.neural.synapses import Synapse, passed, remember

DT = 0.001


@pytest.mark.parametrize(
    ("text", "cdf"),
    [
        ("uniform(-2, 3)", stats.uniform(-2, 5).cdf),
        ("normal(1, 0.5)", stats.norm(1, 0.5).cdf),
        ("exponential(2, 1)", stats.expon(1, 2).cdf),
    ],
)
def test_numbers_follow_the_distribution(text: str, cdf: object) -> None:
    drawn = Distribution.read(text).draw(np.random.default_rng(0), 4000)
    assert drawn.shape == (4000, 1)
    assert stats.kstest(drawn[:, 0], cdf).pvalue > 0.01


def test_cosine_is_that_of_random_directions() -> None:
    rng = np.random.default_rng(0)
    found = Distribution.read("cosine(5)").draw(rng, 4000)[:, 0]
    directions = Distribution.read("sphere").draw(rng, 4000, 5)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-12)
    assert stats.ks_2samp(found, directions[:, 0]).pvalue > 0.01
    assert Distribution.read("cosine").draw(rng, 3, 1, dimensions=2).shape == (3, 1)


def test_ball_is_even() -> None:
    points = Distribution.read("ball").draw(np.random.default_rng(0), 4000, 3)
    assert stats.kstest(np.linalg.norm(points, axis=1) ** 3, stats.uniform().cdf).pvalue > 0.01


def spacing(points: np.ndarray) -> float:
    """The smallest distance between two points."""
    return float(distance.pdist(points).min())


@pytest.mark.parametrize("d", [1, 2, 5])
def test_scattered_points_are_uniform_and_even(d: int) -> None:
    """As Nengo's ScatteredHypersphere and QuasirandomSequence: uniform, and no two nearly alike."""
    rng, n = np.random.default_rng(1), 500
    cube = Distribution.read("quasirandom(-2, 3)").draw(rng, n, d)
    for j in range(d):
        gaps = np.sort((cube[:, j] + 2.0) / 5.0) - (np.arange(n) + 0.5) / n
        assert np.abs(gaps).max() < 0.03  # of random points, 0.06 is usual
    plain = Distribution.read("uniform(-2, 3)").draw(rng, n, d)
    assert spacing(cube) > 2.0 * spacing(plain)
    ball = Distribution.read("scattered_ball").draw(rng, n, d)
    radii = np.linalg.norm(ball, axis=1)
    assert stats.kstest(radii**d, stats.uniform().cdf).statistic < 0.05
    assert np.abs(ball.mean(axis=0)).max() < 0.04
    sphere = Distribution.read("scattered_sphere").draw(rng, n, d)
    np.testing.assert_allclose(np.linalg.norm(sphere, axis=1), 1.0, rtol=1e-12)
    theirs = nengo.dists.ScatteredHypersphere(surface=True).sample(
        n, d, rng=np.random.RandomState(0)
    )
    spread = np.linalg.eigvalsh(np.cov(sphere.T, bias=True).reshape(d, d))
    wanted = np.linalg.eigvalsh(np.cov(theirs.T, bias=True).reshape(d, d))
    np.testing.assert_allclose(spread, wanted, atol=0.03)
    assert not np.array_equal(sphere, Distribution.read("scattered_sphere").draw(rng, n, d))


def test_choice_and_given_numbers() -> None:
    rng = np.random.default_rng(0)
    rows = Distribution.read("choice([[1, 0], [0, -1]])").draw(rng, 50, 2)
    assert {tuple(row) for row in rows.tolist()} == {(1.0, 0.0), (0.0, -1.0)}
    assert set(Distribution.read("choice([-1, 1])").draw(rng, 50)[:, 0]) == {-1.0, 1.0}
    np.testing.assert_array_equal(Distribution.read(0.5).draw(rng, 3)[:, 0], 0.5)
    np.testing.assert_array_equal(Distribution.read([1, 2, 3]).draw(rng, 3)[:, 0], [1, 2, 3])
    with pytest.raises(ValueError, match="expected 4 numbers, got an array of shape"):
        Distribution.read([1, 2, 3]).draw(rng, 4)
    with pytest.raises(ValueError, match="expected entries of 3 numbers, got 2"):
        Distribution.read("choice([[1, 0]])").draw(rng, 4, 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("uniforn(1, 2)", "did you mean 'uniform'"),
        ("uniform(1)", r"expected uniform\(low, high\)"),
        ("uniform(2, 1)", "with low at most high"),
        ("uniform(1, 2); import os", "expected a number, an array or one of"),
        ("__import__('os')", "expected a number, an array or one of"),
        ("choice([])", "with one entry or more"),
        ("choice([1, [2]])", "entries of one length"),
        ("choice([1, 2,])", "separated by commas"),
        ("normal(1, x)", "separated by commas"),
        ("sphere(3)", "expected sphere"),
        ([1, "a"], None),
        (True, None),
    ],
)
def test_wrong_distributions(text: object, message: str | None) -> None:
    with pytest.raises(ValueError, match=message):
        Distribution.read(text)


@given(st.text(max_size=40))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        Distribution.read(text)
    except SettingError as error:
        assert error.problems


numbers = st.floats(-1e6, 1e6).map(lambda x: round(x, 3))


@given(st.lists(numbers, min_size=1, max_size=5))
def test_what_is_written_is_read_again(values: list[float]) -> None:
    made = Distribution("choice", (values,))
    assert Distribution.read(made.written()) == made


SYNAPSES = [
    (0.005, nengo.Lowpass(0.005)),
    ("alpha(0.02)", nengo.Alpha(0.02)),
    ("second_order(50, 0.4)", nengo.LinearFilter([2500.0], [1.0, 40.0, 2500.0])),
    (1e-5, nengo.Lowpass(1e-5)),
    ("triangle(0.0204)", nengo.Triangle(0.0204)),
    ("triangle(0.0003)", nengo.Triangle(0.0003)),
    ({"type": "linear", "num": [1, 2], "den": [1, 300]}, nengo.LinearFilter([1, 2], [1, 300])),
    (
        {"type": "linear", "num": [1e4, 5], "den": [2, 30, 200, 1e4]},
        nengo.LinearFilter([1e4, 5], [2, 30, 200, 1e4]),
    ),
    ({"type": "linear", "num": [5], "den": [0.01, 5]}, nengo.LinearFilter([5], [0.01, 5])),
    *(
        (
            {"type": "linear", "num": num, "den": den, "discrete": True},
            nengo.LinearFilter(num, den, analog=False),
        )
        for num, den in (
            ([0.1], [1, -0.9]),
            ([0.2, 0.1], [2, -1.8]),
            ([0.05, 0.02], [1, -1.5, 0.57]),
            ([0.05], [1, -1.5, 0.57]),
            ([0.05, 0.02, 0.01], [1, -1.5, 0.57]),
        )
    ),
]


@pytest.mark.parametrize(("written", "theirs"), SYNAPSES, ids=[str(s) for s, _ in SYNAPSES])
def test_synapses_are_nengos(written: object, theirs: nengo.synapses.Synapse) -> None:
    u = np.random.default_rng(0).standard_normal(300)
    synapse = Synapse.read(written)
    a, b = synapse.matrices(DT)
    assert Synapse.read(synapse.written()) == synapse
    assert synapse.order_at(DT) == len(b)
    x, found = np.zeros((len(b), 1)), []
    for value in u:
        found.append(passed(x, a, b, np.array([value])))
        remember(x, a, b, np.array([value]), found[-1])
    np.testing.assert_allclose(
        found, theirs.filt(u[:, None], dt=DT, y0=0.0), rtol=1e-10, atol=1e-13
    )


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("alfa(0.1)", "did you mean 'alpha'"),
        ("alpha(0.1, 2)", "expected a time constant"),
        ("alpha(0)", "tau: expected a number above 0 s"),
        (-1, "tau: expected a number above 0 s"),
        ("fast", "expected a synapse"),
        ({"type": "linear", "num": [1], "den": [2]}, "den: expected two coefficients or more"),
        ({"type": "linear", "num": [1, 2, 3], "den": [2, 1]}, "num: expected up to 2 coefficients"),
    ],
)
def test_wrong_synapses(written: object, message: str) -> None:
    with pytest.raises(SettingError, match=message):
        Synapse.read(written)


def activities(n: int, points: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(n)
    x = rng.uniform(-1, 1, (points, 1))
    gain, bias = nengo.LIF().gain_bias(rng.uniform(200, 400, n), rng.uniform(-1, 0.9, n))
    rates = nengo.LIF().rates(x * rng.choice((-1.0, 1.0), n), gain, bias)
    return rates, np.hstack([x, np.sin(3 * x)])


@pytest.mark.parametrize("n", [50, 300])
def test_decoders_are_nengos(n: int) -> None:
    a, y = activities(n, 200)
    rng = np.random.default_rng(0)
    pairs = {
        "l2": nengo.solvers.LstsqL2(reg=0.1),
        "l2_nz": nengo.solvers.LstsqL2nz(reg=0.1),
        "nnls": nengo.solvers.Nnls(),
        "nnls_l2": nengo.solvers.NnlsL2(reg=0.1),
        "nnls_l2_nz": nengo.solvers.NnlsL2nz(reg=0.1),
    }
    for name, theirs in pairs.items():
        expected, _ = theirs(a, y)
        found = DecoderSolver.read(name).solve(a, y, rng)
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def test_decoders_with_noise_are_nengos() -> None:
    """Given the same generator, both draw the same noise."""
    a, y = activities(50, 400)
    expected, _ = nengo.solvers.LstsqNoise(noise=0.1)(a, y, rng=np.random.RandomState(3))
    same: Any = np.random.RandomState(3)
    found = DecoderSolver.read("l2_noise").solve(a, y, same)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


@pytest.mark.filterwarnings("ignore:Objective did not converge")
@pytest.mark.parametrize(("l1", "l2", "rtol"), [(1e-2, 0.03, 1e-3), (1e-3, 0.01, 3e-3)])
def test_lasso_is_nengos_within_its_tolerance(l1: float, l2: float, rtol: float) -> None:
    """Nengo's stops at scikit-learn's duality gap of 1e-4; ours is never worse."""
    pytest.importorskip("sklearn", reason="scikit-learn, which Nengo's LstsqL1 needs")
    a, y = activities(30, 200)
    expected, _ = nengo.solvers.LstsqL1(l1=l1, l2=l2)(a, y)
    found = Lasso(l1=l1, l2=l2).solve(a, y, np.random.default_rng(0))
    np.testing.assert_allclose(found, expected, atol=rtol * np.abs(expected).max())
    s, m = a.max(), len(a)

    def cost(d: np.ndarray) -> float:
        fit = np.square(a @ d - y).sum() / (2 * m)
        return float(fit + l1 * s * np.abs(d).sum() + l2 * s**2 * np.square(d).sum() / 2)

    assert cost(found) <= cost(expected)


def test_lasso_meets_its_optimality_conditions() -> None:
    """Zero is in the subdifferential (Karush, Kuhn and Tucker); many decoders are zero."""
    a, y = activities(30, 200)
    solver = Lasso(l1=1e-2, l2=0.03)
    decoders = solver.solve(a, y, np.random.default_rng(0))
    s = a.max()
    slope = a.T @ (a @ decoders - y) / len(a) + solver.l2 * s**2 * decoders
    zero = decoders == 0.0
    assert 0.2 < zero.mean() < 0.99
    assert (np.abs(slope[zero]) <= solver.l1 * s * (1 + 1e-6)).all()
    np.testing.assert_allclose(slope[~zero], -solver.l1 * s * np.sign(decoders[~zero]), rtol=2e-3)


def test_singular_systems_are_reported() -> None:
    a = np.zeros((30, 3))
    with pytest.raises(SingularError, match="no neuron fires at any of the points"):
        ridge(a, np.ones((30, 1)), 0.0)
