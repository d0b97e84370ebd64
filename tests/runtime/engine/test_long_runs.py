"""The smallest step of a solver is that of the time it has come to, not of the end of the run."""

from __future__ import annotations

import numpy as np
import pytest

import runtime

ROBERTSON = ["-0.04*a + 1e4*b*c", "0.04*a - 1e4*b*c - 3e7*b**2", "3e7*b**2"]


def values(engine: str, rates: list[str], **run: float) -> np.ndarray:
    """The states at ticks: a is 1 at the start, the others 0."""
    names = ["a", "b", "c"][: len(rates)]
    initial = [1.0] + [0.0] * (len(rates) - 1)
    block = {"type": "DynamicSystem", "states": names, "initial": initial, "derivative": rates}
    solver = {"solver": "rodas4", "rtol": 1e-8, "atol": 1e-14}
    document = {"run": {**solver, **run}, "blocks": {"s": block}, "probes": {"x": "s.out"}}
    return np.asarray(runtime.load(document).run(engine=engine)["x"])


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_values_at_equal_times_do_not_depend_on_the_end(engine: str) -> None:
    # b follows a within 1e-4 s, a falls within 1e11 s.
    rates = ["-1e-11*a", "1e4*(a - b)"]
    x = values(engine, rates, dt=1e9, until=1e11)
    np.testing.assert_array_equal(x[:5], values(engine, rates, dt=1e9, until=5e9))
    expected = np.exp(-0.01 * np.arange(1, len(x)))
    np.testing.assert_allclose(x[1:], np.stack([expected, expected], axis=1), rtol=1e-6)


def test_robertson_for_long_times() -> None:
    x = values("compiled", ROBERTSON, dt=1e9, until=1.01e11)
    # For long times a is 1 / (4.8e-4 t), from b = 0.04 a / (1e4 c) and a' = -3e7 b^2.
    assert x[100, 0] == pytest.approx(1.0 / (4.8e-4 * 1e11), rel=1e-3)
    np.testing.assert_allclose(x.sum(axis=1), 1.0, atol=1e-9)
