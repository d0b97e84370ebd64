"""Every metric has the unit that it declares: it scales with the units of length and of time.

A signal in other units is other numbers: c times the values and k times the times. A metric with
the unit ``of² s`` is then c² k times what it was, whatever it computes (dimensional homogeneity).
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from blocks.core import FloatArray
from blocks.world import World
from runtime.observation import METRIC_KINDS, OF_RUN, Series

# Powers of 2 scale floats exactly; a metric that counts or compares takes the same decisions.
SIGNAL, TIME = 4.0, 2.0
# Options in the units of the signal and of the time; all others are numbers.
LIKE_SIGNAL = {"level", "band", "target", "limit", "scale", "distance", "turning_radius"}
LIKE_TIME = {"hold", "window", "delay", "tau", "at", "after", "until"}
RATES = {"firing_rate", "synaptic_operations"}  # of spikes, which are 1/s
# Counts what is within 40 cm of a cylinder; of angles in rad.
OWN_LENGTHS = {"distance_mae_cylinders", "circular_mean", "circular_deviation"}
SAMPLED = {"distance_floor", "strayed", "loops"}  # contours are sampled at a step in m

# Options with which each metric has a value that is not 0.
CASES: dict[str, dict[str, Any]] = {
    "settling_time": {"band": 0.05, "hold": 0.5},
    "mean_abs": {},
    "rms": {},
    "max_abs": {},
    "mean": {},
    "max": {},
    "min": {},
    "final": {},
    "first_time": {"level": 0.5},
    "value_at": {"at": 0.315},
    "circular_mean": {},
    "circular_deviation": {},
    "share_above": {"level": 0.9},
    "path_length": {},
    "displacement": {},
    "lqr_cost": {"q": [2.0, 1.0], "r": [1.0, 3.0]},
    "overshoot": {"target": 0.9},
    "rise_time": {"target": 1.0},
    "steady_state_error": {"target": 1.2, "window": 0.5},
    "iae": {"target": 1.0},
    "ise": {"target": 1.0},
    "itae": {"target": 1.0},
    "energy": {},
    "effort": {"scale": 2.0},
    "effort_change": {"scale": 2.0},
    "smoothness": {"scale": 2.0},
    "saturation": {"limit": 0.9},
    "recovery_time": {"at": 0.1, "band": 0.05, "hold": 0.5},
    "rmse": {"delay": 0.01},
    "firing_rate": {},
    "synaptic_operations": {"synapses": 5},
    "distance_mae": {"distance": 0.2},
    "distance_mae_cylinders": {"distance": 0.2},
    "distance_mae_reachable": {"distance": 0.2, "turning_radius": 0.1},
    "distance_floor": {"distance": 0.2, "turning_radius": 0.3},
    "strayed": {"distance": 0.2},
    "loops": {"distance": 0.2},
}


def test_every_metric_has_a_case() -> None:
    # Those of the run are not of signals: test_stopping.py, test_metrics.py.
    assert CASES.keys() | {*OF_RUN} == METRIC_KINDS.keys(), "give the new metric a case here"


def value(kind: str, signal: float, time: float) -> float | None:
    """A metric of an oscillation that decays, of spikes or a drive along walls, in other units."""
    declared = METRIC_KINDS[kind]
    t = 0.01 * np.arange(400)
    curve = 1.0 - np.exp(-3.0 * t) * np.cos(4.0 * t)
    turn = 2.0 * math.pi * t / 3.0
    around = np.column_stack((1.7 * np.cos(turn), 1.6 * np.sin(turn)))
    columns: dict[str, FloatArray] = {
        "number": 0.25 + curve[:, None],
        "columns": np.column_stack((1.0 - curve, 0.5 - 0.5 * curve)),
        "position": around,
    }
    values = columns[declared.forms[-1]]
    if kind in RATES:
        values, signal = (np.random.default_rng(0).random((400, 3)) < 0.1) / 0.01, 1.0 / time
    series = {role: Series(time * t, signal * values) for role in declared.inputs}
    if kind == "rmse":
        series["reference"] = Series(time * t, signal * (values + 0.1))
    factors = dict.fromkeys(LIKE_SIGNAL, signal) | dict.fromkeys(LIKE_TIME, time)
    options = {
        key: factors[key] * np.array(x) if key in factors else x for key, x in CASES[kind].items()
    }
    if kind == "lqr_cost":
        options = {key: np.array(x) / signal**2 for key, x in options.items()}
    return declared.value(series, options, world(signal))


def world(signal: float) -> World:
    """A room with a post."""
    corners = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]]
    room = [[signal * x, signal * y] for x, y in corners]
    return World({"room": room, "circles": [[signal * -1.8, 0.0, signal * 0.3]]})


@pytest.mark.parametrize("kind", CASES)
def test_a_metric_scales_as_its_unit_says(kind: str) -> None:
    declared = METRIC_KINDS[kind]
    power = {"of": 0, "m": 0, "s": 0}
    for name, up in re.findall(
        r"(of|m|s)([²]?)", declared.unit.replace("1/s", "").replace("Hz", "")
    ):
        power[name] += 2 if up else 1
    if declared.unit in ("1/s", "Hz"):
        power["s"] = -1
    signal = 1.0 if kind in OWN_LENGTHS else SIGNAL
    factor = signal ** (power["of"] + power["m"]) * TIME ** power["s"]
    before, after = value(kind, 1.0, 1.0), value(kind, signal, TIME)
    assert before is not None
    assert after == pytest.approx(factor * before, rel=1e-3 if kind in SAMPLED else 1e-9)
    assert before != 0.0
