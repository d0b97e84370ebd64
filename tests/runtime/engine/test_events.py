"""Events between ticks: located to rounding, in order of time, by both engines alike."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime

ENGINES = ("python", "compiled")
GALLERY = Path(__file__).parents[3] / "graphs" / "gallery"


def recorded(blocks: dict[str, Any], wires: dict[str, Any], of: str, **run: Any) -> np.ndarray:
    document = {"run": run, "blocks": blocks, "wires": wires, "probes": {"y": of}}
    result = runtime.load(document).run()
    assert run["engine"] == "python" or result.manifest["engine"] == "compiled"
    return np.asarray(result["y"])


def falling(t: np.ndarray, g: float, height: float, share: float) -> np.ndarray:
    """The height of a ball dropped from rest that keeps a share of its speed at each bounce."""
    at, speed = math.sqrt(2.0 * height / g), share * math.sqrt(2.0 * height * g)
    y = height - 0.5 * g * t**2
    while at < t[-1]:
        since = t - at
        y = np.where(since >= 0.0, speed * since - 0.5 * g * since**2, y)
        at, speed = at + 2.0 * speed / g, share * speed
    return y


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("solver", ["rk4", "dopri5", "rodas4"])
def test_a_ball_bounces_as_in_the_closed_form(engine: str, solver: str) -> None:
    graph = runtime.load(str(GALLERY / "published" / "gravity_ball.yaml")).set("run.dt", 0.01)
    y = np.asarray(graph.set("run.solver", solver).run(engine=engine)["out"])[:, 1]
    expected = falling(0.01 * np.arange(len(y)), 9.81, 10.0, 0.8)
    np.testing.assert_allclose(y, expected, atol=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("solver", ["euler", "heun", "rk4", "dopri5"])
def test_integrate_and_reset_loses_nothing(engine: str, solver: str) -> None:
    """x' = pi, back to 0 at 1: 314 resets in 100 s, and 100 pi - 314 left; events in a chain of
    blocks, where one makes the next one happen, as well."""
    one = {
        "x": {
            "type": "DynamicSystem",
            "states": ["x", "n"],
            "derivative": ["pi", "0"],
            "initial": [0, 0],
            "events": [{"when": "x >= 1", "then": ["0", "n + 1"]}],
        }
    }
    run = {"dt": 0.1, "until": 100.1, "engine": engine, "solver": solver}
    x, n = recorded(one, {}, "x.out", **run)[-1]
    assert (n, x) == (314.0, pytest.approx(100.0 * math.pi - 314.0, abs=1e-9))
    chain = {
        "pi": {"type": "Constant", "value": math.pi},
        "x": {"type": "Integrator"},
        "full": {"type": "Compare", "operator": ">=", "value": 1.0},
        "hits": {"type": "HitCrossing", "level": 0.5, "direction": "rising"},
    }
    wires = {
        "x": {"input": "pi.value", "reset": "full.out"},
        "full": {"input": "x.out"},
        "hits": {"input": "full.out"},
    }
    assert recorded(chain, wires, "hits.count", **run)[-1] == 314.0
    assert recorded(chain, wires, "x.out", **run)[-1] == pytest.approx(x, abs=1e-9)
