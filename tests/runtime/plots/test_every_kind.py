"""Every kind of plot draws, and names its axes with their units."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

import runtime
from runtime.compare import Run
from runtime.compare.overlay import versus
from runtime.observation import PLOT_KINDS
from runtime.plots.analysis import draw_xy
from runtime.plots.figures import draw
from runtime.plots.painters import OURS
from tests.runtime.plots.test_map import graph

# A plot of each kind, and the names of its axes from top to bottom: x and y of each, with the units
# that the ports declare; a signal without a unit has none.
CASES: dict[str, tuple[dict[str, Any], list[tuple[str, str]]]] = {
    "timeseries": ({"of": ["plant.pose"]}, [("", "plant.pose [m]"), ("time [s]", "θ [rad]")]),
    "trajectory": ({"of": ["plant.pose"]}, [("x [m]", "y [m]")]),
    "xy": ({"of": ["plant.pose.x", "plant.pose.theta"]}, [("x [m]", "theta [rad]")]),
    "xyz": ({"of": ["plant.pose"]}, [("x [m]", "y [m]")]),
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


def made(amplitude: float) -> runtime.Result:
    plain = graph(
        run={"dt": 0.001, "until": 0.4, "seed": 0},
        plots={kind: {"kind": kind, **entry} for kind, (entry, _) in CASES.items()},
    )
    plain["blocks"] |= {
        "wave": {"type": "Function", "expression": f"{amplitude} * sin(4 * t)"},
        "e": {"type": "Ensemble", "neurons": 20},
        "d": {"type": "Decoder"},
    }
    plain["blocks"]["go"]["value"] = [0.5 * amplitude, 0.3]
    plain["wires"] |= {"e": {"input": "wave.out"}, "d": {"spikes": "e.spikes"}}
    return runtime.load(plain).run(engine="python")


@pytest.fixture(scope="module")
def result() -> runtime.Result:
    return made(1.0)


@pytest.fixture(scope="module")
def runs(result: runtime.Result) -> list[Run]:
    return [Run("one", Path(), result, {}), Run("other", Path(), made(0.5), {})]


def test_every_kind_has_a_case_and_a_painter() -> None:
    assert CASES.keys() == PLOT_KINDS.keys(), "give the new kind a case here"
    assert OURS.keys() == PLOT_KINDS.keys()


@pytest.mark.parametrize("kind", CASES)
def test_axes_are_named_with_units(kind: str, result: runtime.Result) -> None:
    (plot,) = (each for each in result.plots if each.kind == kind)
    axes = draw(plot, result).axes
    assert [(each.get_xlabel(), each.get_ylabel()) for each in axes] == CASES[kind][1]


def data(axes: Axes) -> list[Any]:
    """What an axes shows, as plain numbers."""
    lines = [np.nan_to_num(np.array(line.get_data(), dtype=float)).tolist() for line in axes.lines]
    return [*lines, *(np.nan_to_num(np.asarray(i.get_array())).tolist() for i in axes.images)]


@pytest.mark.parametrize("kind", CASES)
def test_every_kind_shows_the_data_of_both_runs(kind: str, runs: list[Run]) -> None:
    (plot,) = (each for each in runs[0].result.plots if each.kind == kind)
    figure = versus(runs, plot)
    shown = [item for axes in figure.axes for item in data(axes)]
    texts = " ".join(text.get_text() for text in figure.findobj(Text))
    assert "one" in texts.split() and "other" in texts.split()
    own = [data(draw(plot, run.result).axes[0]) for run in runs]
    if plot.definition.of_tuning or kind == "weights":  # both runs have the same neurons
        assert own[0] == own[1]
        assert all(shown.count(item) == 2 for item in own[0])
    else:
        for mine, theirs in (own, own[::-1]):
            assert any(item in shown for item in mine if item not in theirs)


def test_two_pairs_of_two_runs_have_four_looks(runs: list[Run]) -> None:
    pairs = ("plant.pose.x", "plant.pose.y", "plant.pose.theta", "plant.pose.y")
    recorded = {run.label: run.result.recording for run in runs}
    others = {label: [find(name) for name in pairs] for label, find in recorded.items()}
    figure = Figure()
    axes = draw_xy(figure, others["one"], 0.4, others)
    named = [line for line in axes.lines if not str(line.get_label()).startswith("_")]
    assert [line.get_label() for line in named] == [
        f"y over {name}, {run}" for run in ("one", "other") for name in ("x", "theta")
    ]
    assert len({(line.get_color(), line.get_linestyle()) for line in named}) == 4


def test_parts_have_the_same_limits_and_colours(runs: list[Run]) -> None:
    for kind in ("heatmap", "decoded", "weights"):
        (plot,) = (each for each in runs[0].result.plots if each.kind == kind)
        upper, lower = (part.axes for part in versus(runs, plot).subfigs)
        assert [(a.get_xlim(), a.get_ylim()) for a in upper] == [
            (a.get_xlim(), a.get_ylim()) for a in lower
        ]
        images = [image.get_clim() for axes in (upper[0], lower[0]) for image in axes.images]
        assert len(set(images)) <= 1


def test_a_run_without_the_signal_is_named(runs: list[Run]) -> None:
    (plot,) = (each for each in runs[0].result.plots if each.kind == "raster")
    probes = {n: r for n, r in runs[1].result.probes.items() if n not in plot.of}
    other = replace(runs[1], result=replace(runs[1].result, probes=probes))
    texts = [text.get_text() for text in versus([runs[0], other], plot).findobj(Text)]
    assert "not recorded: other" in texts
