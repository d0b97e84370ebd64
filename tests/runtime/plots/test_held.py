"""A value that is held is drawn as steps, a continuous one as a line, wherever it is drawn."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import runtime
from runtime.compare import Run
from runtime.compare.overlay import versus
from runtime.plots.figures import draw
from runtime.plots.style import draw_series
from runtime.runs import read_run


def graph(every: float = 0.5, **run: Any) -> runtime.Graph:
    """A sine, sampled, beside an integrator, a step, noise and its filtered form."""
    return runtime.load(
        {
            "graph": "clocks",
            "run": {"dt": 0.125, "until": 4.0, **run},
            "blocks": {
                "wave": {"type": "Sine", "frequency": 0.25},
                "clock": {"type": "UnitDelay", "dt": every},
                "twice": {"type": "Gain", "gain": 2.0},
                "area": {"type": "Integrator"},
                "step": {"type": "Step", "time": 2.0},
                "late": {"type": "Step", "time": 3.0},
            },
            "wires": {
                "clock": {"input": "wave.out"},
                "twice": {"input": "clock.out"},
                "area": {"input": "wave.out"},
            },
            "probes": {
                "all": {"of": ["wave.out", "clock.out", "twice.out", "area.out", "step.out"]},
                "slow": "clock.out",
                "smooth": {"of": "late.out", "synapse": 0.5},
                "state": "area.integral",
            },
            "plots": {"all": {"kind": "timeseries", "of": ["all", "slow", "smooth", "state"]}},
        }
    )


HELD = {"clock.out", "twice.out", "step.out"}


def drawn_at(line: Line2D, t: float) -> float:
    """What a reader of the picture takes for the value at a time."""
    x, y = (np.asarray(values, dtype=float) for values in line.get_data())
    if str(line.get_drawstyle()) == "steps-post":
        return float(y[np.searchsorted(x, t, side="right") - 1])
    return float(np.interp(t, x, y))


def lines_of(figure: Figure) -> list[Line2D]:
    return [x for a in figure.axes for x in a.lines if not str(x.get_label()).startswith("_")]


def test_the_picture_shows_the_value_between_two_rows() -> None:
    """The sampled sine is sin(2 pi t / 4) at the last tick of its clock but one, at any time."""
    result = graph().run()
    lines = {str(x.get_label()): x for x in lines_of(draw(result.plots[0], result))}
    for t in np.linspace(0.51, 3.99, 97):
        held = math.sin(0.5 * math.pi * (0.5 * math.floor(t / 0.5) - 0.5)) if t >= 0.5 else 0.0
        assert drawn_at(lines["clock.out"], t) == pytest.approx(held, abs=1e-9)
        assert drawn_at(lines["twice.out"], t) == pytest.approx(2.0 * held, abs=1e-9)
        assert drawn_at(lines["step.out"], t) == (1.0 if t >= 2.0 else 0.0)
    assert drawn_at(lines["wave.out"], 1.0625) == pytest.approx(
        math.sin(0.5 * math.pi * 1.0625), abs=0.02
    )


def test_what_changes_between_ticks_and_what_is_filtered_is_a_line(tmp_path: Path) -> None:
    result = graph().run()
    flags = {
        label: held
        for recorded in result.probes.values()
        for label, held in zip(recorded.labels, recorded.held, strict=True)
        if recorded.name != "smooth"
    }
    assert {label for label, held in flags.items() if held} == HELD
    assert result.probes["smooth"].held == (False,)
    saved = read_run(result.save(tmp_path / "run"))
    assert {n: r.held for n, r in saved.probes.items() if any(r.held)} == {
        n: r.held for n, r in result.probes.items() if any(r.held)
    }
    assert result.recording("clock.out").held == (True,)


def test_two_runs_in_one_figure_are_drawn_alike(tmp_path: Path) -> None:
    one, other = graph().run(), graph(1.0).run()
    runs = [Run(name, tmp_path, run, {}) for name, run in (("one", one), ("other", other))]
    figure = versus(runs, one.plots[0])
    styles = {
        str(axes.get_ylabel()): {str(line.get_drawstyle()) for line in axes.lines[:2]}
        for axes in figure.axes
    }
    assert styles["clock"] == styles["step"] == {"steps-post"}
    assert styles["wave"] == styles["area"] == {"default"}


@given(
    values=st.lists(st.sampled_from([0.0, 1.0, -2.0, math.nan, math.inf]), min_size=2, max_size=60),
    most=st.integers(4, 30),
    at=st.floats(0.0, 0.999),
)
def test_steps_are_right_also_where_a_long_series_is_thinned(
    values: list[float], most: int, at: float
) -> None:
    """Within a block of thinned rows the value drawn is one that the block has; ends are exact."""
    t, y = np.arange(float(len(values))), np.array(values)
    axes = Figure().subplots()
    draw_series(axes, t, np.where(np.isfinite(y), y, 7.0), True, most)
    line = axes.lines[0]
    shown = np.where(np.isfinite(y), y, 7.0)
    time = at * len(y)
    size = -(-2 * len(y) // most) if len(y) > most else 1
    near = slice(max(0, int(time) - size), int(time) + size)
    assert drawn_at(line, time) in shown[near]
    assert drawn_at(line, 0.0) == shown[0]
    assert drawn_at(line, len(y) - 0.01) == shown[-1]
    assert float(np.asarray(line.get_xdata())[-1]) == len(y)


def test_lines_without_a_unit_share_the_axes_of_those_with_one() -> None:
    """Truth in m and its estimate, whose vector has no unit, are compared in one axes."""
    document: dict[str, Any] = {
        "run": {"dt": 0.1, "until": 1.0},
        "blocks": {
            "truth": {"type": "Pendulum", "angle0": 0.3},
            "estimate": {"type": "Gain", "gain": 0.9},
            "other": {"type": "Lowpass", "tau": 0.1},
        },
        "wires": {"estimate": {"input": "truth.angle"}, "other": {"input": "estimate.out"}},
        "probes": {"both": {"of": ["truth.angle", "estimate.out"]}, "rate": "truth.rate"},
        "plots": {
            "both": {"kind": "timeseries", "of": "both"},
            "all": {"kind": "timeseries", "of": ["both", "rate"]},
        },
    }
    result = runtime.load(document).run()
    (axes,) = draw(result.plots[0], result).axes
    assert len(lines_of(axes.figure)) == 2
    assert axes.get_ylabel().endswith("[rad]")
    # With two units, nothing says which of them it has.
    assert len(draw(result.plots[1], result).axes) == 3
