"""A first-order hold samples on its own ticks, and moves along a line between them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import runtime
from runtime import check_block
from runtime.graph import Graph

ENGINES = ("python", "compiled")
DT, PERIOD, UNTIL = 0.01, 0.1, 1.0


def graph(block: dict[str, Any], **run: Any) -> Graph:
    """sin(t) into a hold, and the hold into an integrator and a gain."""
    return runtime.load(
        {
            "run": {"dt": DT, "until": UNTIL, **run},
            "blocks": {
                "wave": {"type": "Function", "expression": "sin(t)"},
                "hold": {"type": "FirstOrderHold", "dt": PERIOD, **block},
                "area": {"type": "Integrator"},
                "twice": {"type": "Gain", "gain": 2.0},
            },
            "wires": {
                "hold": {"input": "wave.out"},
                "area": {"input": "hold.out"},
                "twice": {"input": "hold.out"},
            },
            "probes": {"out": "hold.out", "area": "area.out", "twice": "twice.out"},
        }
    )


def line(t: float, start: float, late: float = 0.0) -> float:
    """The closed form: between the samples before the last two ticks of the block."""
    # At a tick of the block, the line of the step before ends, at the same value.
    k = math.ceil(round((t - late) / PERIOD, 9)) - 1
    before, last = (math.sin(late + PERIOD * i) if i >= 0 else start for i in (k - 1, k))
    return before + (last - before) * (t - late - PERIOD * k) / PERIOD if k >= 0 else start


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("late", [0.0, 0.03])
def test_the_output_is_the_line_at_every_base_tick(engine: str, late: float) -> None:
    result = graph({"initial": -0.5, **({"offset": late} if late else {})}).run(engine=engine)
    found, twice = np.ravel(result["out"]), np.ravel(result["twice"])
    assert len(found) == round(UNTIL / DT)  # a row per base tick, not per sample
    expected = [line(DT * i, -0.5, late) for i in range(len(found))]
    np.testing.assert_allclose(found, expected, atol=1e-13)
    np.testing.assert_array_equal(twice, 2.0 * found)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("solver", ["heun", "rk4", "dopri5"])
def test_a_solver_integrates_the_line_exactly(engine: str, solver: str) -> None:
    """Trapezoids are exact for lines, where a hold would be integrated as stairs."""
    made = graph({"initial": 0.0}, solver=solver, dt=PERIOD)
    area = np.ravel(made.run(engine=engine)["area"])
    values = np.array([line(PERIOD * i, 0.0) for i in range(len(area))])
    expected = np.concatenate([[0.0], np.cumsum(0.5 * PERIOD * (values[1:] + values[:-1]))])
    np.testing.assert_allclose(area, expected, atol=1e-13)


@pytest.mark.parametrize("engine", ENGINES)
def test_both_engines_have_equal_bits_and_a_run_goes_on_with_them(engine: str) -> None:
    whole = graph({}).run(engine="python")
    session = graph({}).session(engine=engine)
    session.run(0.45)
    session.restore(session.snapshot())
    session.run(UNTIL - 0.45)
    for name in ("out", "area"):
        np.testing.assert_array_equal(session.result()[name], whole[name])


def test_its_output_depends_on_states_alone() -> None:
    """It breaks a loop that has no other state."""
    loop = {
        "run": {"dt": DT, "until": UNTIL},
        "blocks": {
            "hold": {"type": "FirstOrderHold", "dt": PERIOD, "initial": 1.0},
            "half": {"type": "Function", "expression": "u/2"},
        },
        "wires": {"hold": {"input": "half.out"}, "half": {"u": "hold.out"}},
        "probes": {"x": "hold.out"},
    }
    x = np.ravel(runtime.load(loop).run()["x"])
    # Each step of the block leads to half of the value at its start.
    assert x[[0, 5, 10, 20, 30]] == pytest.approx([1.0, 0.75, 0.5, 0.25, 0.125], abs=1e-12)


def test_the_block_keeps_the_rules() -> None:
    from blocks import FirstOrderHold

    check_block(FirstOrderHold(initial=0.3), dt=0.01)
