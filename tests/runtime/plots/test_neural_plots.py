"""Plots of populations: tuning and response curves, sorted rasters, decoded signals, weights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import runtime
from blocks import Decoder, Ensemble, Function, WhiteNoise
from blocks.neural import LIF, PLACES
from runtime.errors import GraphError
from runtime.plots.figures import draw
from runtime.plots.tuning import tuning_of
from tests.conftest import Run

N = 30


def population(d: int = 1, **more: Any) -> runtime.Graph:
    """A population that follows sines, decoded as it is."""
    waves = [f"sin(6*t + {i})" for i in range(d)]
    graph = runtime.Graph("population", dt=0.001, until=0.6, seed=4)
    graph = graph.add("x", Function(expression=waves if d > 1 else waves[0]))
    graph = graph.add("a", Ensemble(neurons=N, radius=1.5, **more)).add("out", Decoder())
    return graph.connect("x.out", "a.input").connect("a.spikes", "out.spikes")


def figure(graph: runtime.Graph) -> Figure:
    result = graph.run()
    return draw(result.plots[0], result)


@pytest.mark.parametrize("d", [1, 2])
def test_response_curves_are_the_models_rates(d: int) -> None:
    """The rates of LIF neurons with the run's gains and biases, along each one's encoder."""
    graph = population(d).plot("p", "response_curves", "a.spikes")
    result = graph.run()
    axes = draw(result.plots[0], result).axes[0]
    gain, bias = result.states["a.gain"], result.states["a.bias"]
    expected = LIF().rates(gain[:, None] * PLACES + bias[:, None])
    drawn = np.array(sorted(line.get_ydata().tolist() for line in axes.lines))
    np.testing.assert_allclose(drawn, sorted(expected.tolist()), rtol=1e-9, atol=1e-9)


def test_tuning_curves_are_rates_over_each_dimension() -> None:
    result = population(2).plot("p", "tuning_curves", "a.spikes").run()
    first, second = draw(result.plots[0], result).axes
    found = tuning_of(result.probes["a.spikes.tuning"])
    gain, bias = result.states["a.gain"], result.states["a.bias"]
    np.testing.assert_allclose(np.linalg.norm(found.encoders, axis=1), 1.0, rtol=1e-12)
    for axis, axes in enumerate((first, second)):
        drive = (gain * found.encoders[:, axis])[:, None] * PLACES + bias[:, None]
        drawn = np.array(sorted((line.get_ydata() for line in axes.lines), key=np.sum))
        expected = np.array(sorted(LIF().rates(drive), key=np.sum))
        # Interpolated between 401 places, which matters only where a neuron sets in.
        assert np.abs(drawn - expected).mean() < 0.1
        assert np.abs(drawn - expected).mean(axis=1).max() < 0.5


def test_tuning_needs_no_run(cli: Run, tmp_path: Path) -> None:
    graph = population().plot("p", "tuning_curves", "a.spikes").plot("q", "timeseries", "out.value")
    (tmp_path / "population.yaml").write_text(graph.to_yaml())
    done = cli("explain", "population.yaml", "--plots", "figures")
    assert (done.returncode, done.stdout) == (0, "figures/p.png\n"), done.stderr
    assert (tmp_path / "figures" / "p.png").read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "runs").exists()
    (tmp_path / "none.yaml").write_text(population().to_yaml())
    done = cli("explain", "none.yaml", "--plots", "figures")
    assert done.returncode == 2
    assert "no plot that needs no run; such kinds are tuning_curves" in done.stderr


def test_a_raster_is_sorted_by_preferred_direction() -> None:
    """The input turns once per 2 pi / 6 s, and with it the neurons that fire most."""
    graph = runtime.Graph("turning", dt=0.001, until=2.0 * np.pi / 6.0, seed=1)
    graph = graph.add("x", Function(expression=["cos(6*t)", "sin(6*t)"]))
    graph = graph.add("a", Ensemble(neurons=200, intercepts="uniform(0.3, 0.9)"))
    graph = graph.connect("x.out", "a.input").plot("p", "raster", "a.fired", sort="direction")
    axes = figure(graph).axes[0]
    t, neuron = axes.lines[0].get_data()
    assert axes.get_ylabel() == "preferred direction"
    places, labels = axes.get_yticks(), [text.get_text() for text in axes.get_yticklabels()]
    assert labels == ["−180°", "−90°", "0°", "90°", "180°"]
    angle = np.interp(neuron, places, np.radians([-180, -90, 0, 90, 180]))
    # Neurons fire for inputs within 73 degrees of their own direction, most in the middle.
    off = np.angle(np.exp(1j * (angle - 6.0 * t)))
    assert np.abs(off).mean() < np.radians(40.0)
    assert abs(off.mean()) < np.radians(5.0)


def test_a_sorted_raster_in_one_dimension_is_a_fan() -> None:
    """Neurons of one encoder are together, the most easily driven of both kinds in the middle."""
    graph = population(encoders="choice([-1, 1])").plot("p", "raster", "a.fired", sort="direction")
    result = graph.run()
    found = tuning_of(result.probes["a.fired.tuning"])
    order = found.order()
    signs, intercepts = np.sign(found.encoders[order, 0]), found.intercepts[order]
    assert np.array_equal(signs, np.sort(signs))
    assert (np.diff(intercepts[signs < 0]) <= 0.0).all()
    assert (np.diff(intercepts[signs > 0]) >= 0.0).all()
    assert draw(result.plots[0], result).axes[0].get_ylabel() == "neuron, sorted by tuning"


def noise(d: int = 1) -> runtime.Graph:
    """White noise of deviation 0.5 around a ramp, and the ramp itself."""
    graph = runtime.Graph("noise", dt=0.001, until=20.0, seed=2)
    graph = graph.add("ideal", Function(expression="0.1*t - 1"))
    graph = graph.add("noise", WhiteNoise(density=0.5 * 0.001**0.5))
    graph = graph.add("sum", Function(expression="u[0] + u[1]"))
    graph = graph.connect("ideal.out", "sum.u").connect("noise.out", "sum.u")
    return graph


@pytest.mark.parametrize("over", [None, "ideal.out"], ids=["time", "signal"])
def test_the_band_is_the_deviation_of_the_noise(over: str | None) -> None:
    options: dict[str, Any] = {"window": 2.0} if over is None else {"over": over}
    graph = noise().plot("p", "decoded", "sum.out", "ideal.out", **options)
    result = graph.run()
    deviation = float(np.std(result["sum.out"] - result["ideal.out"]))
    assert deviation > 0.1
    upper, lower = draw(result.plots[0], result).axes
    band = upper.collections[0].get_paths()[0].vertices
    middle = np.abs(band[:, 0] - np.median(band[:, 0])) < 0.25 * np.ptp(band[:, 0])
    x, y = band[middle].T
    ideal = x if over else 0.1 * x - 1.0
    np.testing.assert_allclose(np.abs(y - ideal), deviation, atol=0.3 * deviation)
    assert np.abs(lower.lines[0].get_ydata()).max() < 0.4 * deviation
    assert any("rms error" in text.get_text() for text in lower.texts)


def test_weights_are_drawn_by_rank() -> None:
    graph = population(2, neuron="LIF").set("blocks.out.learning", {"rule": "pes"})
    graph = graph.set("blocks.out.function", ["0", "0"]).connect("x.out", "out.error")
    graph = graph.probe("w", "out.weights", every=10).plot("p", "weights", "w")
    result = graph.run()
    upper, lower = draw(result.plots[0], result).axes
    w = result["w"].reshape(len(result["w"]), -1)
    drawn = np.array([line.get_ydata()[-1] for line in upper.lines])
    assert len(drawn) == 40
    assert (drawn.min(), drawn.max()) == (w[-1].min(), w[-1].max())
    expected = np.sqrt(np.mean(w**2, axis=1))  # the weights begin at zero
    np.testing.assert_allclose(lower.lines[0].get_ydata(), expected)


@pytest.mark.parametrize(
    ("kind", "of", "options", "message"),
    [
        ("tuning_curves", ["x.out"], {}, "expected the spikes of an Ensemble, as in a.spikes"),
        ("response_curves", ["a"], {}, "'a' is a block; expected one of its outputs: a.spikes"),
        ("raster", ["out.value"], {}, "a raster needs spikes"),
        ("raster", ["a.fired"], {"sort": "angle"}, "expected one of activity, direction"),
        ("decoded", ["out.value"], {}, "expected two signals"),
        ("decoded", ["out.value", "a.spikes"], {}, "as many columns in both, got 1 and 30"),
        ("decoded", ["out.value", "x.out"], {"over": "a.spikes"}, "expected one column, got 30"),
        ("weights", ["a.tuning"], {}, "'a' has no output or state 'tuning'"),
    ],
)
def test_what_these_plots_cannot_show(
    kind: str, of: list[str], options: dict[str, Any], message: str
) -> None:
    with pytest.raises(GraphError, match=message):
        population().plot("p", kind, *of, **options).check()


def test_a_filtered_raster_is_refused() -> None:
    graph = population().probe("rates", "a.fired", synapse=0.1).plot("p", "raster", "rates")
    with pytest.raises(GraphError, match="a raster needs spikes as they are, without a synapse"):
        graph.check()


def test_neurons_of_unknown_direction_cannot_be_sorted_by_it() -> None:
    graph = runtime.load("sine_estimation_error")
    spikes = next(p for p in graph.observation.plots if p.kind == "raster").of[0]
    with pytest.raises(GraphError, match="the preferred directions behind .* are not known"):
        graph.plot("p", "raster", spikes, sort="direction").check()
