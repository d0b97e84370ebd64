"""Steps of adaptive solvers that are too long: they are rejected, and the run goes on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import runtime
from runtime.errors import SimulationError
from runtime.graph import Graph

ENGINES = ("python", "compiled")
ROBERTSON = ["-0.04*a + 1e4*b*c", "0.04*a - 1e4*b*c - 3e7*b**2", "3e7*b**2"]


def system(derivative: list[str], initial: list[float], **run: Any) -> Graph:
    model = {
        "type": "DynamicSystem",
        "states": ["a", "b", "c"][: len(initial)],
        "derivative": derivative,
        "initial": initial,
    }
    run = {"dt": 0.1, "until": 1.9, "solver": "dopri5", **run}
    return runtime.load({"run": run, "blocks": {"b": model}, "probes": {"x": "b.out"}})


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("solver", ["dopri5", "rodas4"])
def test_stages_beyond_the_domain_are_rejected(engine: str, solver: str) -> None:
    """x' = -sqrt(x), of which the square root of a negative number is none: x = (1 - t/2)^2."""
    result = system(["-sqrt(a)"], [1.0], engine=engine, solver=solver).run()
    t = 0.1 * np.arange(len(result["x"]))
    np.testing.assert_allclose(np.ravel(result["x"]), (1.0 - t / 2.0) ** 2, atol=2e-5)
    assert result.manifest["engine"] == engine  # compiled code comes back from a failed stage


@pytest.mark.parametrize("engine", ENGINES)
def test_a_fast_transient_needs_no_short_ticks(engine: str) -> None:
    """x' = -1000 x^3: x = 1 / sqrt(1 / x0^2 + 2000 t). A step of one tick overflows."""
    result = system(["-1000*a**3"], [1e3], engine=engine, rtol=1e-8).run()
    t = 0.1 * np.arange(1, len(result["x"]))
    np.testing.assert_allclose(np.ravel(result["x"])[1:], 1.0 / np.sqrt(2000.0 * t), rtol=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_robertson_runs_with_an_explicit_solver(engine: str) -> None:
    result = system(
        ROBERTSON, [1.0, 0.0, 0.0], engine=engine, until=1.0, rtol=1e-7, atol=1e-12
    ).run()

    def rates(t: float, x: Any) -> list[float]:
        a, b, c = x
        return [-0.04 * a + 1e4 * b * c, 0.04 * a - 1e4 * b * c - 3e7 * b**2, 3e7 * b**2]

    expected = solve_ivp(rates, (0.0, 0.9), [1.0, 0.0, 0.0], "Radau", rtol=1e-10, atol=1e-13)
    np.testing.assert_allclose(np.asarray(result["x"])[-1], expected.y[:, -1], rtol=1e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_first_step_is_estimated(engine: str) -> None:
    """A step of a whole tick misses a pulse of the derivative that is over within a hundredth."""
    result = system(["500*exp(-500*t)"], [0.0], engine=engine, dt=1.0, until=2.0, rtol=1e-4).run()
    assert np.ravel(result["x"])[1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_smallest_step_fails_and_names_the_state(engine: str) -> None:
    with pytest.raises(SimulationError, match="derivative of state 'a' is not finite") as found:
        system(["-sqrt(a)"], [1.0], engine=engine, until=3.0).run()
    assert found.value.time == pytest.approx(2.0, abs=1e-3)
    assert math.isfinite(found.value.time)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sliding_mode_ends_the_implicit_solver_with_an_error(engine: str) -> None:
    def slides(solver: str, rates: list[str], rtol: float) -> Graph:
        run = {"dt": 0.001, "until": 0.005, "solver": solver, "rtol": rtol}
        return system(rates, [0.015, 0.01], **run)

    jumping = ["-2 if a > b else 2", "-3 if b > a else 1.5"]
    message = r"at tick 1 .*rodas4 crawls at t = 0.001\d* s: 1001 of .* \(a sliding mode\): use dop"
    with pytest.raises(SimulationError, match=message):
        slides("rodas4", jumping, 1e-6).run(engine=engine)
    # Sliding, a' = b': -2 p + 2 (1 - p) = 1.5 p - 3 (1 - p), so that p = 10 / 17 of the time a > b.
    along, meeting = 2.0 - 4.0 * 10.0 / 17.0, 0.005 / 3.5
    expected = 0.015 - 2.0 * meeting + along * (0.004 - meeting)
    smooth = [each.format("tanh((a - b)/1e-4)") for each in ("-2*{}", "-0.75 + 2.25*{}")]
    for solver, rates in (("dopri5", jumping), ("rodas4", smooth)):
        x = np.asarray(slides(solver, rates, 1e-4).run(engine=engine)["x"])
        np.testing.assert_allclose(x[4], [expected, expected], atol=1e-4)
