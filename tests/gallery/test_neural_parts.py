"""The parts of graphs/parts that are made of populations, against what they should compute."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import runtime

PARTS = Path(__file__).parents[2] / "graphs" / "parts"


def graph(part: str, inputs: dict[str, Any], until: float, **entry: Any) -> runtime.Graph:
    """A part with constant inputs."""
    plain: dict[str, Any] = {
        "run": {"dt": 0.001, "until": until, "seed": 1, "engine": "python"},
        "blocks": {"it": {"graph": str(PARTS / f"{part}.yaml"), **entry}},
        "wires": {"it": {name: f"{name}.value" for name in inputs}},
    }
    for name, value in inputs.items():
        plain["blocks"][name] = {"type": "Constant", "signal": "Vector", "value": list(value)}
    return runtime.load(plain)


def unit(n: int, seed: int) -> np.ndarray:
    x = np.random.default_rng(seed).standard_normal(n)
    return np.asarray(x / np.linalg.norm(x))


def settled(made: runtime.Graph, address: str) -> np.ndarray:
    """The mean of a signal over the last three quarters of a run."""
    values = made.probe("y", address).run()["y"]
    return np.asarray(values[len(values) // 4 :].mean(axis=0))


@pytest.mark.parametrize("n", [5, 8])
def test_circular_convolution_is_that_of_the_fourier_transforms(n: int) -> None:
    a, b = unit(n, 1), unit(n, 2)
    expected = np.fft.irfft(np.fft.rfft(a) * np.fft.rfft(b), n)
    made = graph("circular_convolution", {"a": a, "b": b}, 0.1, params={"odd": bool(n % 2)})
    found = settled(made, "it.value")
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.06


def test_unbinding_by_the_inverse_gives_back_what_was_bound() -> None:
    """b is nearer to the binding of a * b with the inverse of a than to any of 20 other vectors."""
    n = 32
    a, b = unit(n, 3), unit(n, 4)
    bound = np.fft.irfft(np.fft.rfft(a) * np.fft.rfft(b), n)
    inverse = np.concatenate([a[:1], a[:0:-1]])
    params = {"neurons": 40, "neuron": "LIFRate"}
    made = graph("circular_convolution", {"a": bound, "b": inverse}, 0.02, params=params)
    found = settled(made, "it.value")
    alike = [float(found @ other) for other in [b, *(unit(n, seed) for seed in range(10, 30))]]
    assert np.argmax(alike) == 0


def test_products_of_vectors() -> None:
    a, b = np.array([0.5, -0.8, 0.9, 0.0]), np.array([0.9, 0.5, -0.8, 0.7])
    found = settled(graph("neural_product", {"a": a, "b": b}, 0.2), "it.value")
    np.testing.assert_allclose(found, a * b, atol=0.06)


def test_an_array_of_ensembles_is_one_block_or_a_repeated_part() -> None:
    """Both decode the squares of each number; with the same neurons they are the same."""
    x = np.array([0.5, -0.8, 0.2])
    params = {"function": "x**2", "synapse": 0.02}
    array = graph("ensemble_array", {"x": x}, 0.3, params=params)
    many = graph("neural_population", {"x": x}, 0.3, params=params, repeat=3)
    for made in (array, many):
        np.testing.assert_allclose(settled(made, "it.value"), x**2, atol=0.05)
    # A constant gain, bias, encoder and voltage leave nothing to chance but the points.
    fixed = {"gain": 2.0, "bias": 1.5, "encoders": 1, "voltage": 0.0}
    points = {"eval_points": np.linspace(-1, 1, 40).reshape(-1, 1).tolist()}
    for key, value in fixed.items():
        array = array.set(f"it.array.{key}", value)
        many = many.set(f"it.population.{key}", value)
    for key, value in points.items():
        array = array.set(f"it.decoded.{key}", value)
        many = many.set(f"it.decoded.{key}", value)
    one, other = (made.probe("y", "it.value").run()["y"] for made in (array, many))
    assert one.any()
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12)


def lorenz(t: float, x: np.ndarray) -> list[float]:
    return [10 * (x[1] - x[0]), -x[0] * x[2] - x[1], x[0] * x[1] - 8 / 3 * (x[2] + 28)]


@pytest.mark.slow
def test_the_lorenz_attractor_has_the_statistics_of_the_equations() -> None:
    """Means and deviations over 8 s, against 200 s of the equations in SciPy."""
    made = graph("lorenz_attractor", {}, 9.0)
    found = made.probe("y", "it.state", every=10).run()["y"][100:]
    times = np.linspace(20.0, 220.0, 20_000)
    exact = solve_ivp(lorenz, (0.0, 220.0), [1.0, 1.0, -20.0], t_eval=times, rtol=1e-8).y.T
    # The first two states are as often on one wing as on the other, in the long run.
    assert found[:, 2].mean() == pytest.approx(exact[:, 2].mean(), abs=0.8)
    rms, wanted = (np.sqrt(np.square(y[:, :2]).mean(axis=0)) for y in (found, exact))
    np.testing.assert_allclose(rms, wanted, rtol=0.1)
    assert found[:, 2].std() == pytest.approx(exact[:, 2].std(), rel=0.1)
    assert int((np.diff(np.sign(found[:, 0])) != 0).sum()) > 3
