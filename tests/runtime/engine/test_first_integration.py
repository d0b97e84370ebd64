"""The integration of the first tick in compiled code, with the results of Python's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import runtime
from runtime.engine.replay import ExactRunner
from tests.compilers import needs_compiler

pytestmark = needs_compiler


def ring(solver: str, derivative: str = "b") -> runtime.Graph:
    states = {"type": "DynamicSystem", "states": ["a", "b"], "derivative": [derivative, "-9*a"]}
    return runtime.load(
        {
            "run": {"dt": 0.1, "until": 1.0, "solver": solver},
            "blocks": {
                "b": {**states, "initial": [1.0, 0.0]},
                "above": {"type": "Relay", "switch_on": 0.9, "switch_off": 0.4},
            },
            "wires": {"above": {"input": "b.out.0"}},
            "probes": {"x": "b.out", "on": "above.out"},
        }
    )


@pytest.mark.parametrize("solver", ["euler", "rk4", "dopri5", "rodas4"])
def test_the_first_tick_is_integrated_in_c(monkeypatch: pytest.MonkeyPatch, solver: str) -> None:
    done: list[bool] = []
    integrate = ExactRunner.integrate

    def noted(self: ExactRunner, scope: dict[str, Any]) -> bool:
        done.append(integrate(self, scope))
        return done[-1]

    monkeypatch.setattr(ExactRunner, "integrate", noted)
    compiled = ring(solver).run(engine="compiled")
    assert done == [True] and compiled.notes == []
    python = ring(solver).run(engine="python")
    for probe in ("x", "on"):
        np.testing.assert_allclose(compiled[probe], python[probe], rtol=0.0, atol=1e-13)
    assert np.ptp(compiled["on"]) > 0.0


@pytest.mark.parametrize("solver", ["rk4", "dopri5"])
def test_a_failure_in_the_first_integration_is_pythons(solver: str) -> None:
    texts = []
    for engine in ("python", "compiled"):
        with pytest.raises(runtime.SimulationError) as caught:
            ring(solver, "1/(a - 1)").run(engine=engine)
        texts.append(str(caught.value))
    assert texts[0] == texts[1]
    assert "at tick 0" in texts[0]
