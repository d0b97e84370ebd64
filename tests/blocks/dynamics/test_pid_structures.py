"""The structures of a PID, and its rules in discrete time, against rational functions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import signal

import runtime
from blocks.core import FloatArray
from tests.blocks.responses import respond

KP, KI, KD, N, H = 2.0, 1.5, 0.2, 20.0, 0.01
T = H * np.arange(300)
GAINS = {"kp": KP, "ki": KI, "kd": KD, "n": N}
STRUCTURES = ["parallel", "ideal", "series"]


def rational(structure: str, integral: Any, slope: Any) -> tuple[FloatArray, FloatArray]:
    """The controller, of I = integral[0] / integral[1] and D alike; highest power first."""
    (a, b), (c, d) = ([np.poly1d(p) for p in pair] for pair in (integral, slope))
    one = b * d
    terms = {
        "parallel": KP * one + KI * a * d + KD * c * b,
        "ideal": KP * (one + KI * a * d + KD * c * b),
        "series": KP * (b + KI * a) * (d + KD * c),
    }
    return terms[structure].coeffs, one.coeffs


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_structure_is_its_rational_function(structure: str, engine: str) -> None:
    graph = runtime.load(
        {
            "run": {"dt": H, "until": 3.0, "solver": "dopri5", "rtol": 1e-9},
            "blocks": {
                "r": {"type": "Step"},
                "pid": {"type": "PID", "structure": structure, **GAINS},
            },
            "wires": {"pid": {"error": "r.out"}},
            "probes": {"y": "pid.out"},
        }
    )
    made = rational(structure, ([1], [1, 0]), ([N, 0], [1, N]))
    _, expected = signal.step(made, T=T)
    np.testing.assert_allclose(graph.run(engine=engine)["y"], expected, atol=1e-6)


# 1 / s and n s / (s + n) by each rule, in powers of z.
RULES = {
    "backward": (([H, 0], [1, -1]), ([N, -N], [1 + N * H, -1])),
    "tustin": (([H / 2, H / 2], [1, -1]), ([2 * N, -2 * N], [2 + N * H, N * H - 2])),
    "zoh": (([H], [1, -1]), ([N, -N], [1, -np.exp(-N * H)])),
}


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("method", RULES)
def test_a_sampled_structure_is_its_rational_function(
    structure: str, method: str, engine: str
) -> None:
    u = np.random.default_rng(3).standard_normal(200)
    entry = {"type": "DiscretePID", "structure": structure, "method": method, **GAINS}
    found = respond(entry, {"error": u}, dt=H, engine=engine)
    if (structure, method) == ("series", "zoh"):
        # The product of two parts that are sampled one by one is not the sampled product.
        made = rational("series", ([1], [1, 0]), ([N, 0], [1, N]))
        sampled, a, _ = signal.cont2discrete(made, H, method="zoh")
        b = sampled[0]
    else:
        b, a = rational(structure, *RULES[method])
    pad = np.zeros(max(0, len(a) - len(b)))
    np.testing.assert_allclose(found, signal.lfilter([*pad, *b], a, u), rtol=1e-9, atol=1e-9)
