"""Ticks, rates, determinism and failures."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
import runtime
from blocks.core.signals import Same
from runtime.cli.explain import explain_json
from tests.examples import examples


class Clock(blocks.Block):
    """Returns the time."""

    out = blocks.Output(blocks.Scalar, unit="s")

    def output(self, state, t):
        return t


class Counter(blocks.Block):
    """Counts calls of its three methods, and passes its input on."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Scalar)
    calls = blocks.State(3, doc="start, output, update")

    def start(self, state):
        state.calls[0] += 1

    def output(self, state, t, x):
        state.calls[1] += 1
        return x

    def update(self, state, t, out):
        state.calls[2] += 1


def test_time_is_computed_not_accumulated() -> None:
    result = runtime.Graph(dt=0.1, until=100.0).add("clock", Clock()).probe("clock.out").run()
    assert np.array_equal(result["clock.out"], np.arange(1000) * 0.1)
    assert np.array_equal(result.time("clock.out"), result["clock.out"])
    assert result.ticks == 1000


@pytest.mark.parametrize("every", [1, 3, 10])
def test_each_method_is_called_once_per_tick_of_the_block(every: int) -> None:
    graph = runtime.Graph(dt=0.01, until=0.61)
    graph = graph.add("clock", Clock()).add("count", Counter(), dt=0.01 * every)
    graph = graph.connect("clock.out", "count.x").probe("count.calls", every=1)
    last = graph.run()["count.calls"][-1]
    # The last row is recorded before the update of the last tick, number 60.
    ticks = 60 // every + 1
    assert last.tolist() == [1, ticks, ticks - (60 % every == 0)]


def test_outputs_hold_between_the_ticks_of_a_slow_block() -> None:
    graph = runtime.Graph(dt=0.01, until=0.5)
    graph = graph.add("clock", Clock()).add("slow", blocks.Gain(gain=2.0), dt=0.05)
    graph = graph.add("fast", blocks.Gain(gain=1.0))
    graph = graph.connect("clock.out", "slow.input").connect("slow.out", "fast.input")
    result = graph.probe("fast.out").probe("slow.out").run()
    held = np.repeat(2.0 * np.arange(0, 50, 5) * 0.01, 5)
    np.testing.assert_allclose(result["fast.out"], held)
    np.testing.assert_allclose(result["slow.out"], held[::5])
    np.testing.assert_allclose(result.time("slow.out"), np.arange(0, 50, 5) * 0.01)


def test_long_chains_run_without_recursion() -> None:
    length = 2000
    wires = {f"b{i}": {"input": f"b{i - 1}.out" if i > 1 else "b0.value"} for i in range(1, length)}
    types = {f"b{i}": {"type": "Gain", "gain": 1.001} for i in range(1, length)}
    graph = runtime.load(
        {
            "run": {"dt": 0.1, "until": 0.5},
            "blocks": {"b0": {"type": "Constant", "value": 1.0}, **types},
            "wires": wires,
            "probes": {"end": f"b{length - 1}.out"},
        }
    )
    np.testing.assert_allclose(graph.run()["end"], 1.001 ** (length - 1))


@given(
    order=st.permutations(range(6)), edges=st.sets(st.tuples(st.integers(0, 5), st.integers(0, 5)))
)
@examples(40)
def test_any_acyclic_wiring_computes_what_numpy_does(
    order: list[int], edges: set[tuple[int, int]]
) -> None:
    """Sums of sums: out_j = 1 + sum over i -> j of out_i, for any order of declaration."""
    edges = {(min(e), max(e)) for e in edges if e[0] != e[1]}
    graph = runtime.Graph(dt=1.0, until=1.0).add("one", blocks.Constant(value=1.0))
    for j in order:
        graph = graph.add(f"s{j}", blocks.Sum())
    for j in order:
        graph = graph.connect("one.value", f"s{j}.terms")
        for i, k in sorted(edges):
            if k == j:
                graph = graph.connect(f"s{i}.out", f"s{j}.terms")
        graph = graph.probe(f"p{j}", f"s{j}.out")
    adjacency = np.zeros((6, 6))
    for i, j in edges:
        adjacency[j, i] = 1.0
    expected = np.linalg.solve(np.eye(6) - adjacency, np.ones(6))
    result = graph.run()
    assert [result[f"p{j}"][0] for j in range(6)] == pytest.approx(expected.tolist())


@given(order=st.permutations(range(5)), every=st.lists(st.integers(1, 3), min_size=5, max_size=5))
@examples(20)
def test_blocks_run_by_rate_and_then_by_name_however_they_are_written(
    order: list[int], every: list[int]
) -> None:
    graph = runtime.Graph(dt=0.5, until=3.0)
    for i in order:
        graph = graph.add(f"clock{i}", blocks.Clock(), dt=0.5 * every[i])
    names = [step["block"] for step in explain_json(graph)["order"]]
    assert names == [f"clock{i}" for _, i in sorted(zip(every, range(5), strict=True))]


def test_loops_through_state_run_and_algebraic_loops_are_refused() -> None:
    graph = runtime.Graph(dt=1.0, until=5.0)
    graph = (
        graph.add("one", blocks.Constant(value=1.0))
        .add("sum", blocks.Sum())
        .add("delay", blocks.UnitDelay())
    )
    graph = graph.connect("one.value", "sum.terms").connect("delay.out", "sum.terms")
    graph = graph.connect("sum.out", "delay.input")
    assert graph.probe("sum.out").run()["sum.out"].tolist() == [1, 2, 3, 4, 5]
    with pytest.raises(runtime.GraphError, match=r"algebraic loop: .*sum\.out ▸ .*UnitDelay"):
        graph.bypass("delay").check()


NAMES = ("line_actuator_failure", "sine_estimation_error")


@pytest.mark.parametrize("name", NAMES)
def test_same_seed_same_bits_in_another_process(name: str, tmp_path: Path) -> None:
    here = runtime.load(name).run(seed=5, until=0.5)
    code = f"import sys, runtime\nruntime.load({name!r}).run(seed=5, until=0.5).save(sys.argv[1])"
    folder = tmp_path / "other"
    subprocess.run([sys.executable, "-c", code, str(folder)], check=True)
    there = runtime.open(folder)
    assert set(here) == set(there)
    for probe in here.probes:
        assert np.array_equal(here[probe], there[probe])
    assert here.metrics == there.metrics


@pytest.mark.parametrize("name", NAMES)
def test_a_run_runs_again_from_its_own_folder(name: str, tmp_path: Path) -> None:
    changed = runtime.load(name).without("adaptive.snn_v").set("lqr.q", [0.1, 0.2, 0.3])
    folder = changed.run(seed=3, until=0.3).save(tmp_path / "first")
    again = runtime.load(folder / "graph.resolved.yaml").run().save(tmp_path / "second")
    with np.load(folder / "probes.npz") as first, np.load(again / "probes.npz") as second:
        assert set(first.files) == set(second.files)
        for key in first.files:
            assert np.array_equal(first[key], second[key]), key
    assert json.loads((folder / "metrics.json").read_text()) == json.loads(
        (again / "metrics.json").read_text()
    )


def test_removing_a_block_leaves_noise_and_neurons_of_the_others() -> None:
    """Open loop, so that only the random draws could differ."""
    graph = runtime.load("sine_estimation_error").set("plots", {}).set("metrics", {})
    graph = graph.set("blocks.plant", {"type": "Constant", "signal": "Pose", "value": [1, 2, 0.5]})
    graph = graph.set("wires.plant", None).set("probes", {})
    for block in ("noise", "match", "error", "truth", "miss"):
        for port in graph.document.plain()["wires"][block]:
            source = graph.document.plain()["wires"][block][port]
            if source == "plant.pose":
                graph = graph.wire(f"{block}.{port}", "plant.value")
    for probe in ("noise.measured", "adaptive.snn_omega.spikes", "adaptive.snn_omega.weights"):
        graph = graph.set(f"probes.{probe.replace('.', '_')}", probe)
    whole = graph.run(until=0.3)
    for gone in ("adaptive.snn_v", "lqr", "miss"):
        part = graph.without(gone).run(until=0.3)
        for probe in whole.probes:
            assert np.array_equal(whole[probe], part[probe]), (gone, probe)
    assert not np.array_equal(
        whole["noise_measured"], graph.run(seed=1, until=0.3)["noise_measured"]
    )


class Shapeless(blocks.Block):
    """Returns a given value."""

    out = blocks.Output(blocks.Twist)
    kind: str = blocks.param(doc="what")

    def output(self, state, t):
        wrong = {"float": 1.0, "three": (1.0, 2.0, 3.0), "none": None, "list": [1.0, 2.0]}
        return {**wrong, "bool": (1.0, True)}[self.kind]


@pytest.mark.parametrize("kind", ["float", "three", "none", "list", "bool"])
def test_a_wrong_value_is_reported_on_the_first_tick(kind: str) -> None:
    graph = runtime.Graph(dt=0.1, until=1.0).add("bad", Shapeless(kind=kind))
    with pytest.raises(
        runtime.SimulationError, match=r"block 'bad' at tick 0 .*'out' must be a tuple of 2"
    ):
        graph.run()


class Pair(blocks.Block):
    """Declares two outputs and returns one."""

    a = blocks.Output(blocks.Scalar)
    b = blocks.Output(blocks.Scalar)

    def output(self, state, t):
        return 1.0


def test_a_missing_output_is_reported() -> None:
    with pytest.raises(runtime.SimulationError, match=r"expected a tuple of its outputs \(a, b\)"):
        runtime.Graph(dt=0.1, until=1.0).add("bad", Pair()).run()


class Starter(blocks.Block):
    """Fails before the first tick."""

    out = blocks.Output(blocks.Scalar)

    def start(self, state):
        raise OSError("no such device")

    def output(self, state, t):
        return 0.0


def test_a_failing_start_names_the_block_and_keeps_a_result() -> None:
    graph = runtime.Graph(dt=0.1, until=1.0).add("bad", Starter()).add("clock", Clock())
    with pytest.raises(
        runtime.SimulationError, match="block 'bad' at tick 0 .*no such device"
    ) as caught:
        graph.probe("clock.out").run()
    assert caught.value.result["clock.out"].shape == (0,)  # type: ignore[index]


class Spoiler(blocks.Block):
    """Turns its signal into a NaN at a given tick."""

    x = blocks.Input(Same("T"))
    out = blocks.Output(Same("T"))
    at: int = blocks.param(doc="tick")

    def output(self, state, t, x):
        if round(t / 0.1) < self.at:
            return x
        return x * np.nan if not isinstance(x, tuple) else (x[0], float("nan"), *x[2:])


@pytest.mark.parametrize(
    ("signal", "value"),
    [("Scalar", 1.0), ("Twist", [1.0, 2.0]), ("Vector(3)", [1.0, 2.0, 3.0])],
)
@given(at=st.integers(0, 300))
@examples(8)
def test_a_nan_in_any_signal_is_reported_at_its_tick(signal: str, value: object, at: int) -> None:
    graph = runtime.Graph(dt=0.1, until=40.0)
    graph = graph.add("c", blocks.Constant(value=value, signal=signal)).add("bad", Spoiler(at=at))
    graph = graph.connect("c.value", "bad.x").probe("bad.out")
    with pytest.raises(runtime.SimulationError, match="block 'bad'.*'out' is not finite") as caught:
        graph.run()
    assert caught.value.tick == at
    assert len(caught.value.result["bad.out"]) == at  # type: ignore[index]


def test_misses_of_a_scan_may_be_infinite_but_not_nan() -> None:
    class Eye(blocks.Block):
        """A scan that misses, and fails at 0.5 s."""

        scan = blocks.Output(blocks.Scan(2))

        def output(self, state, t):
            return np.array([np.inf, 1.0 if t < 0.5 else np.nan])

    with pytest.raises(runtime.SimulationError) as caught:
        runtime.Graph(dt=0.1, until=1.0).add("eye", Eye()).run()
    assert caught.value.tick == 5


def test_names_that_are_python_words_run() -> None:
    names = ["run", "k", "t", "array", "held", "isfinite", "probe_0", "first", "last", "a_out", "a"]
    graph = runtime.Graph(dt=0.1, until=0.3).add("clock", Clock())
    for name in names:
        graph = graph.add(name, blocks.Gain(gain=2.0)).connect("clock.out", f"{name}.input")
        graph = graph.probe(f"p_{name}", f"{name}.out")
    result = graph.run()
    for name in names:
        np.testing.assert_allclose(result[f"p_{name}"], [0.0, 0.2, 0.4])
