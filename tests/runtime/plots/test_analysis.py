"""Plots of signals against each other, and over frequency."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import runtime
from runtime.errors import GraphError
from runtime.graph import Graph
from runtime.plots.analysis import density
from runtime.plots.figures import draw
from tests.runtime.engine.test_continuous import OSCILLATOR, graph_of


def shown(kind: str, of: list[str], **more: Any) -> Any:
    """The top axes of a plot of the oscillator."""
    graph = with_plot(kind, of, **more)
    result = graph.run()
    return draw(result.plots[0], result).axes[0]


def with_plot(kind: str, of: list[str], **more: Any) -> Graph:
    plot = {"kind": kind, "of": of}
    return graph_of({**OSCILLATOR, "plots": {"p": plot}}, engine="python", **more)


def test_a_phase_plane_of_an_oscillator_is_a_circle() -> None:
    axes = shown("xy", ["position.out", "speed.out"])
    x, y = axes.lines[0].get_data()
    np.testing.assert_allclose(np.hypot(x, y), 1.0, atol=1e-4)
    assert (x[0], y[0]) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("of", "message"),
    [
        (["position.out"], r"expected pairs of columns, .*; got 1"),
        (["position.out", "speed.out", "spring.out"], r"got 3"),
    ],
)
def test_what_a_phase_plane_cannot_show(of: list[str], message: str) -> None:
    with pytest.raises(GraphError, match=message):
        with_plot("xy", of).check()


def test_the_spectrum_of_an_oscillator_has_its_peak_at_its_frequency() -> None:
    axes = shown("spectrum", ["position.out"], until=400.0)
    frequencies, power = axes.lines[0].get_data()
    assert frequencies[np.nanargmax(power)] == pytest.approx(1.0 / (2.0 * np.pi), abs=0.02)


def test_the_area_under_a_density_is_the_variance() -> None:
    values = np.random.default_rng(0).standard_normal(100_000)
    frequencies, power = density(values, 0.01)
    assert np.trapezoid(power, frequencies) == pytest.approx(values.var(), rel=0.02)
    assert power[5:-5].mean() == pytest.approx(2.0 * 0.01, rel=0.05)  # white: 2 dt sigma^2


def test_a_short_run_has_no_spectrum() -> None:
    assert density(np.ones(1), 0.1)[1].tolist() == [0.0]
    axes = shown("spectrum", ["position.out"], until=0.1)
    assert not axes.lines


def test_a_flight_is_drawn_in_space_with_equal_scales() -> None:
    flight = {"kind": "xyz", "of": ["quad.position", "path.position"]}
    quadrotor = runtime.load("gallery/papers/quadrotor").overlay({"plots": {"flight": flight}})
    result = quadrotor.run(until=0.5, engine="python")
    axes: Any = draw(next(p for p in result.plots if p.name == "flight"), result).axes[0]
    labelled = {line.get_label(): line for line in axes.lines}
    for name in ("quad.position", "path.position"):
        np.testing.assert_array_equal(np.transpose(labelled[name].get_data_3d()), result[name])
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    extents, box = np.diff(limits)[:, 0], np.array(axes.get_box_aspect())
    np.testing.assert_allclose(extents / extents.max(), box / box.max(), rtol=1e-9)
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()) == ("x [m]", "y [m]", "z [m]")


def test_space_needs_three_columns_each() -> None:
    plots = {"flight": {"kind": "xyz", "of": ["quad.position", "path.position[0]"]}}
    with pytest.raises(GraphError, match="expected triples of columns"):
        runtime.load("gallery/papers/quadrotor").overlay({"plots": plots}).check()
