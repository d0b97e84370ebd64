"""Delays between the ticks: equations with a delay against their solutions, and orders measured."""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import runtime
from blocks.core import FloatArray

ENGINES = ["python", "compiled"]


def solved(
    dt: float, blocks: dict[str, Any], wires: dict[str, Any], engine: str = "python", **run: Any
) -> tuple[FloatArray, FloatArray]:
    """Times and values of ``x.out``."""
    graph = runtime.load(
        {
            "graph": "delayed",
            "run": {"dt": dt, "until": 6.0, **run},
            "blocks": blocks,
            "wires": wires,
            "probes": {"x": "x.out"},
        }
    )
    probe = graph.run(engine=engine).probes["x"]
    return probe.t, probe.values.ravel()


def own_past(dt: float, delay: float = 1.0, **options: Any) -> float:
    """The error of x' = -x(t - delay), x = 1 before 0."""
    made = {
        "x": {"type": "Integrator", "initial": 1.0, "signal": "Scalar"},
        "past": {"type": "Delay", "delay": delay, "initial": 1.0},
        "minus": {"type": "Gain", "gain": -1.0},
    }
    wires = {
        "x": {"input": "minus.out"},
        "past": {"input": "x.out"},
        "minus": {"input": "past.out"},
    }
    t, x = solved(dt, made, wires, **options)
    # By steps (Driver, Ordinary and delay differential equations, 1977): a polynomial more on each.
    terms = [
        (-1) ** n * (t - (n - 1) * delay) ** n / factorial(n) * (t >= (n - 1) * delay - 1e-9)
        for n in range(12)
    ]
    return float(np.abs(x - sum(terms)).max())


def of_a_source(dt: float, delay: float, **options: Any) -> float:
    """The error of x' = -x (1 + cos(2 t) / 2) + w(t - delay) with w = sin(3 t)."""
    made = {
        "w": {"type": "Function", "expression": "sin(3*t)"},
        "past": {"type": "Delay", "delay": delay},
        "x": {
            "type": "DynamicSystem",
            "derivative": ["-x[0] * (1 + 0.5 * cos(2 * t)) + u[0]"],
            "initial": [0.0],
        },
    }
    t, x = solved(dt, made, {"past": {"input": "w.out"}, "x": {"u": ["past.out"]}}, **options)
    later = t >= delay - 1e-9
    right = lambda t, x: -x * (1 + 0.5 * np.cos(2 * t)) + np.sin(3 * (t - delay))  # noqa: E731
    exact = solve_ivp(
        right, (delay, 6.0), [0.0], method="DOP853", rtol=1e-12, atol=1e-14, t_eval=t[later]
    )
    return float(np.abs(x[later] - exact.y[0]).max())


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("error", [own_past, lambda dt, **o: of_a_source(dt, 0.5, **o)])
@pytest.mark.parametrize(("solver", "order"), [("heun", 2.0), ("rk4", 4.0)])
def test_a_delay_has_the_order_of_the_solver(
    error: Any, solver: str, order: float, engine: str
) -> None:
    errors = [error(dt, solver=solver, engine=engine) for dt in (0.025, 0.0125)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("delay", [0.5, 0.4567])
def test_an_adaptive_solver_is_as_exact_as_the_history(delay: float) -> None:
    options = {"solver": "dopri5", "rtol": 1e-10, "atol": 1e-12}
    errors = [of_a_source(dt, delay, **options) for dt in (0.05, 0.025)]
    # Polynomials of degree 5 between ticks; steps within a tick are those of the tolerance.
    assert np.log2(errors[0] / errors[1]) > 4.8
    assert errors[1] < 5e-9


def test_a_kink_between_ticks_costs_a_fixed_step_its_order() -> None:
    """As docs/time.md says: the first step of the past is within a tick, at 0.77."""
    errors = [own_past(dt, delay=0.77, solver="rk4") for dt in (0.025, 0.0125)]
    assert 1e-6 < errors[1] < 1e-5
    adaptive = own_past(0.025, delay=0.77, solver="dopri5", rtol=1e-10, atol=1e-12)
    assert adaptive < 3e-7


@pytest.mark.parametrize("engine", ENGINES)
def test_a_jump_does_not_ring(engine: str) -> None:
    """The past of a signal that jumps on ticks stays between the values of the jump."""
    made = {
        "x": {
            "type": "DynamicSystem",
            "derivative": ["1"],
            "initial": [0.0],
            "when": "x[0] > 0.995",
            "then": ["0"],
        },
        "past": {"type": "Delay", "delay": 0.255},
    }
    graph = runtime.load(
        {
            "graph": "saw",
            "run": {"dt": 0.01, "until": 4.0},
            "blocks": made,
            "wires": {"past": {"input": "x.out"}},
            "probes": {"past": "past.out"},
        }
    )
    past = graph.run(engine=engine)["past"]
    assert past.min() >= -1e-9
    assert past.max() <= 1.0 + 1e-9


def test_a_delay_of_its_own_step_holds() -> None:
    """With a dt of its own it is a sampled block, as any other."""
    made = {
        "w": {"type": "Function", "expression": "t"},
        "past": {"type": "Delay", "delay": 0.2, "dt": 0.1},
        "x": {"type": "Integrator"},
    }
    t, x = solved(0.05, made, {"past": {"input": "w.out"}, "x": {"input": "past.out"}})
    held = np.maximum(0.0, np.floor(t / 0.1 + 1e-9) * 0.1 - 0.2)
    np.testing.assert_allclose(x[1:], np.cumsum(0.05 * held)[:-1], atol=1e-12)
