"""Probes with a synapse: Nengo's and SciPy's filters, at any rate, in memory and on disk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nengo
import numpy as np
import pytest
from scipy import signal

import runtime
from blocks import Decoder, Ensemble, Function, WhiteNoise
from tests.conftest import Run

SYNAPSES = [
    (0.03, nengo.Lowpass(0.03)),
    ("alpha(0.02)", nengo.Alpha(0.02)),
]


def noisy(until: float = 0.7, **probe: Any) -> runtime.Graph:
    """White noise, recorded as it is and filtered."""
    graph = runtime.Graph("noisy", dt=0.001, until=until, seed=3)
    graph = graph.add("noise", WhiteNoise(density=[1e-3, 2e-3, 3e-3], signal="Vector(3)"))
    return graph.probe("raw", "noise.out").probe("smooth", "noise.out", **probe)


@pytest.mark.parametrize(("ours", "theirs"), SYNAPSES, ids=["lowpass", "alpha"])
@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_filtered_probe_is_nengos(ours: Any, theirs: Any, engine: str) -> None:
    run = noisy(synapse=ours).run(engine=engine)
    expected = theirs.filt(run["raw"], dt=0.001, y0=0)
    np.testing.assert_allclose(run["smooth"], expected, rtol=0.0, atol=1e-12)


def test_the_second_order_filter_is_exact_for_held_inputs() -> None:
    """Against SciPy's zero-order hold, whose output of tick k lacks the input of tick k."""
    omega, damping = 40.0, 0.3
    run = noisy(synapse=f"second_order({omega}, {damping})").run()
    system = ([omega**2], [1.0, 2.0 * damping * omega, omega**2])
    numerator, denominator, _ = signal.cont2discrete(system, 0.001, method="zoh")
    expected = signal.lfilter(numerator[0][1:], denominator, run["raw"], axis=0)
    np.testing.assert_allclose(run["smooth"], expected, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("memory", ["1G", "8K"], ids=["memory", "disk"])
@pytest.mark.parametrize("every", [1, 3, 700, 1024])
@pytest.mark.parametrize("until", [0.5, 1.3])
def test_a_slow_probe_shows_rows_of_the_fast_one(memory: str, every: int, until: float) -> None:
    whole = noisy(until, synapse=0.02).run()
    run = noisy(until, synapse=0.02, every=every).set("run.memory", memory).run()
    assert np.array_equal(run["smooth"], whole["smooth"][::every])
    assert np.array_equal(run.time("smooth"), whole.time("smooth")[::every])


def test_events_are_all_seen_whatever_is_recorded() -> None:
    """Spikes filtered by the probe are those filtered by a Decoder with weights of one, later."""
    graph = runtime.Graph("spikes", dt=0.001, until=1.1, seed=1)
    graph = graph.add("snn", Ensemble(neurons=5, dimensions=1))
    graph = graph.add("out", Decoder(weights=np.eye(5), synapse=0.02))
    graph = graph.connect("snn.spikes", "out.spikes").probe("value", "out.value", every=7)
    run = graph.probe("rates", "snn.spikes", synapse=0.02, every=7).run()
    assert run["value"].max() > 10.0
    np.testing.assert_allclose(run["rates"], run["value"], rtol=0.0, atol=1e-10)
    events = graph.probe("rates", "snn.fired", synapse=0.02, every=7).run()
    assert len(events["rates"]) == 158


def test_a_slow_block_is_filtered_at_its_own_rate() -> None:
    graph = noisy(synapse=0.02).set("blocks.noise.dt", 0.004)
    run = graph.run()
    expected = nengo.Lowpass(0.02).filt(run["raw"], dt=0.004, y0=0)
    np.testing.assert_allclose(run["smooth"], expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("synapse", "message"),
    [
        ("-0.1", "probes.smooth.synapse.tau: expected a number above 0"),
        ("alfa(0.1)", "probes.smooth.synapse: expected a time constant in s, or lowpass(tau)"),
        ("{type: lowpas, tau: 1}", "probes.smooth.synapse.type: expected a synapse"),
    ],
)
def test_errors(cli: Run, tmp_path: Path, synapse: str, message: str) -> None:
    path = tmp_path / "noisy.yaml"
    text = noisy(synapse=0.5).to_yaml()
    assert "synapse: 0.5" in text
    path.write_text(text.replace("synapse: 0.5", f"synapse: {synapse}"))
    done = cli("validate", str(path))
    assert done.returncode == 2
    assert message in done.stderr


def test_a_run_that_fails_at_once_has_no_filtered_rows() -> None:
    graph = runtime.Graph("fails", dt=0.001, until=0.1)
    graph = graph.add("f", Function(expression="1/t")).probe("y", "f.out", synapse=0.1)
    with pytest.raises(runtime.SimulationError, match="'f' at tick 0") as caught:
        graph.run()
    assert len(caught.value.result["y"]) == 0


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("memory", ["1G", "8K"], ids=["memory", "disk"])
@pytest.mark.parametrize(("period", "offset"), [(10, 9), (700, None), (7, 0), (3, 1)])
def test_means_and_offsets_are_of_the_rows_of_all_ticks(
    engine: str, memory: str, period: int, offset: int | None
) -> None:
    raw = noisy(1.3).run()["raw"]
    first = period - 1 if offset is None else offset
    at = np.arange(first, len(raw), period)
    graph = noisy(1.3).set("run.memory", memory)
    given = {} if offset is None else {"offset": offset}
    for mean in (True, False):
        how = {"period": period, "mean": mean, **({"offset": first} if not mean else given)}
        run = graph.set("probes.smooth", {"of": "noise.out", "every": how}).run(engine=engine)
        expected = np.array([raw[max(0, k - period + 1) : k + 1].mean(axis=0) for k in at])
        np.testing.assert_allclose(run["smooth"], expected if mean else raw[at], rtol=1e-12)
        np.testing.assert_allclose(run.time("smooth"), at * 0.001, rtol=1e-12)


def test_a_mean_does_not_depend_on_where_a_session_stops() -> None:
    how = {"period": 50, "mean": True}
    graph = noisy(0.5).set("probes.smooth", {"of": "noise.out", "every": how})
    session = graph.session(engine="python")
    for steps in (30, 1, 200, 269):
        session.step(steps)
        session.restore(session.snapshot())
    assert np.array_equal(session.result()["smooth"], graph.run(engine="python")["smooth"])


@pytest.mark.parametrize(
    ("every", "expected"),
    [
        ({"offset": 3}, "missing 'period'"),
        ({"period": 0}, "expected a number of base ticks, 1 or more"),
        ({"period": 3, "offset": -1}, "expected a number of base ticks, 0 or more"),
        ({"period": 3, "mean": 1}, "expected true or false"),
        ({"period": 3, "offset": 3, "mean": True}, "expected less than the period of 3"),
        ({"period": 3, "phase": 1}, "unknown key"),
    ],
)
def test_a_wrong_period_is_said(every: Any, expected: str) -> None:
    with pytest.raises(runtime.GraphError, match=expected):
        noisy(0.1).set("probes.smooth", {"of": "noise.out", "every": every}).check()
