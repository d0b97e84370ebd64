"""Every kind of plot draws, and names its axes with their units."""

from __future__ import annotations

from typing import Any

import pytest

import runtime
from runtime.observation import PLOT_KINDS
from runtime.plots.figures import draw
from runtime.plots.painters import PAINTERS
from tests.runtime.plots.test_map import graph

# A plot of each kind, and the names of its axes from top to bottom: x and y of each, with the units
# that the ports declare; a signal without a unit has none.
CASES: dict[str, tuple[dict[str, Any], list[tuple[str, str]]]] = {
    "timeseries": ({"of": ["plant.pose"]}, [("", "x, y [m]"), ("time [s]", "θ [rad]")]),
    "trajectory": ({"of": ["plant.pose"]}, [("x [m]", "y [m]")]),
    "xy": ({"of": ["plant.pose.x", "plant.pose.theta"]}, [("x [m]", "theta [rad]")]),
    "spectrum": ({"of": ["plant.pose.x"]}, [("frequency [Hz]", "power density [m²/Hz]")]),
    "raster": (
        {"of": ["e.spikes"]},
        [("", "neuron, sorted by 1st PC"), ("time [s]", "mean rate [Hz]")],
    ),
    "tuning_curves": ({"of": ["e.spikes"]}, [("x / radius", "rate [Hz]")]),
    "response_curves": (
        {"of": ["e.spikes"]},
        [("input along the encoder / radius", "rate [Hz]"), ("", "neurons"), ("neurons", "")],
    ),
    "decoded": (
        {"of": ["d.value", "wave.out"]},
        [("", "d.value"), ("time [s]", "error")],
    ),
    "weights": ({"of": ["d.weights"]}, [("", "weights"), ("time [s]", "rms change")]),
    "heatmap": ({"of": ["lidar.scan"]}, [("time [s]", "index"), ("", "lidar.scan [m]")]),
    "map": ({"of": ["plant.pose"]}, [("x [m]", "y [m]")]),
    "wall_distance": (
        {"of": ["plant.pose"], "distance": 0.2},
        [("time [s]", "distance to wall\nminus reference [mm]")],
    ),
    "scans": (
        {"of": ["plant.pose", "lidar.scan", "fitter.wall", "fitter.path"], "distance": 0.2},
        [("", "y [m]"), ("", ""), ("x [m]", "y [m]"), ("x [m]", "")],
    ),
}


@pytest.fixture(scope="module")
def result() -> runtime.Result:
    plain = graph(
        run={"dt": 0.001, "until": 0.4, "seed": 0},
        plots={kind: {"kind": kind, **entry} for kind, (entry, _) in CASES.items()},
    )
    plain["blocks"] |= {
        "wave": {"type": "Function", "expression": "sin(4 * t)"},
        "e": {"type": "Ensemble", "neurons": 20},
        "d": {"type": "Decoder"},
    }
    plain["wires"] |= {"e": {"input": "wave.out"}, "d": {"spikes": "e.spikes"}}
    return runtime.load(plain).run(engine="python")


def test_every_kind_has_a_case_and_a_painter() -> None:
    assert CASES.keys() == PLOT_KINDS.keys(), "give the new kind a case here"
    assert PAINTERS.keys() == PLOT_KINDS.keys()


@pytest.mark.parametrize("kind", CASES)
def test_axes_are_named_with_units(kind: str, result: runtime.Result) -> None:
    (plot,) = (each for each in result.plots if each.kind == kind)
    axes = draw(plot, result).axes
    assert [(each.get_xlabel(), each.get_ylabel()) for each in axes] == CASES[kind][1]
