"""Blocks whose first tick is later than that of the run, beside the samples that they must take."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from blocks.core import Block, BlockState, Input, Output, Scalar, State

ENGINES = ["python", "compiled"]


def load(blocks: dict[str, Any], wires: dict[str, Any], *of: str, **run: Any) -> runtime.Graph:
    return runtime.load(
        {
            "graph": "late",
            "run": {"dt": 0.001, "until": 0.05, **run},
            "blocks": blocks,
            "wires": wires,
            "probes": {each.replace(".", "_"): {"of": each, "every": 1} for each in of},
        }
    )


def taken(values: Any, every: int, offset: int) -> Any:
    """What a block with this step and offset holds of a signal: at first its value at 0."""
    ticks = np.arange(len(values))
    last = (ticks - offset) // every * every + offset
    return values[np.where(last < 0, 0, last)]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("offset", [0, 2, 9])
def test_a_late_block_samples_on_its_own_ticks(offset: int, engine: str) -> None:
    made = {
        "u": {"type": "Function", "expression": "sin(40 * t) + 1"},
        "g": {"type": "Gain", "gain": 2.0, "dt": 0.01, "offset": offset / 1000},
        "d": {"type": "UnitDelay", "initial": 5.0, "dt": 0.01, "offset": offset / 1000},
        "x": {"type": "Integrator"},
    }
    wires = {name: {"input": "u.out"} for name in ("g", "d")} | {"x": {"input": "g.out"}}
    result = load(made, wires, "g.out", "d.out", "x.out").run(engine=engine)
    u = np.sin(40 * 0.001 * np.arange(50)) + 1
    held = taken(u, 10, offset)
    np.testing.assert_allclose(result["g_out"], 2 * held, rtol=1e-14)
    # One of its own ticks later; before the second of them, what it begins with.
    late = np.concatenate((np.full(10 + offset, 5.0), held[offset:40]))
    np.testing.assert_allclose(result["d_out"], late, rtol=1e-14)
    np.testing.assert_allclose(result["x_out"][1:], np.cumsum(0.002 * held)[:-1], atol=1e-14)


class Count(Block):
    """How many ticks it has had, in a form that is not compiled."""

    on = Input(Scalar, default=0.0)
    out = Output(Scalar)
    seen = State(1)

    def output(self, state: BlockState, t: float) -> float:
        return float({"n": state.seen[0]}["n"])

    def update(self, state: BlockState, t: float, on: float) -> None:
        state.seen[0] += 1.0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_block_that_python_calls_may_be_late(engine: str) -> None:
    graph = runtime.Graph("late", dt=0.001, until=0.03).add("n", Count(), dt=0.007)
    graph = graph.set("blocks.n.offset", 0.003).probe("n.out")
    probe = graph.run(engine=engine).probes["n_out"]
    np.testing.assert_allclose(probe.t, [0.003, 0.010, 0.017, 0.024])
    np.testing.assert_array_equal(probe.values.ravel(), [0, 1, 2, 3])


LATE: dict[str, Any] = {
    "u": {"type": "Function", "expression": "t"},
    "g": {"type": "Gain", "gain": 1.0, "dt": 0.01, "offset": 0.004},
    "k": {"type": "Gain", "gain": 1.0, "dt": 0.01},
    "m": {"type": "Gain", "gain": 1.0, "dt": 0.02, "offset": 0.009},
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("probe", "ticks", "columns"),
    [
        ("g.out", range(4, 50, 10), [range(4, 50, 10)]),
        ({"of": "g.out", "every": 20}, range(4, 50, 20), [range(4, 50, 20)]),
        ({"of": "g.out", "every": 7}, range(0, 50, 7), [[0, 4, 14, 14, 24, 34, 34, 44]]),
        (["g.out", "m.out"], range(4, 50, 5), [[4, 4, 14, 14, 24, 24, 34, 34, 44, 44],
                                               [0, 9, 9, 9, 9, 29, 29, 29, 29, 49]]),
        (["g.out", "k.out"], range(0, 50, 2), [[max(0, (i - 4) // 10 * 10 + 4)
                                                for i in range(0, 50, 2)],
                                               [i // 10 * 10 for i in range(0, 50, 2)]]),
    ],
)  # fmt: skip
def test_a_probe_has_rows_on_the_ticks_of_a_late_block(
    probe: Any, ticks: Any, columns: list[Any], engine: str
) -> None:
    wires = {name: {"input": "u.out"} for name in ("g", "k", "m")}
    document = {"run": {"dt": 0.001, "until": 0.05}, "blocks": LATE, "wires": wires}
    for memory in ("1G", "64"):  # in memory, and in buffers that go to disk
        run = document["run"] | {"memory": memory}
        graph = runtime.load(document | {"run": run, "probes": {"y": probe}})
        rows = graph.run(engine=engine).probes["y"]
        np.testing.assert_allclose(rows.t, np.array(ticks) / 1000, atol=1e-15)
        values = np.reshape(rows.values, (len(rows.t), -1)).T
        np.testing.assert_allclose(values, np.array(columns) / 1000, atol=1e-15)


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_measured_row_by_row_does_not_depend_on_the_offset(engine: str) -> None:
    """Of a sine that is sampled each 0.1 s, a quarter of a period later."""
    blocks = {
        "s": {"type": "Sine", "frequency": 0.5},
        "late": {"type": "Hold", "dt": 0.1, "offset": 0.05},
        "plain": {"type": "Hold", "dt": 0.1},
    }
    wires = {"late": {"input": "s.out"}, "plain": {"input": "s.out"}}
    metrics = {name: {"kind": "effort_change", "of": f"{name}.out"} for name in ("late", "plain")}
    document = {"run": {"dt": 0.01, "until": 8.0}, "blocks": blocks, "wires": wires}
    graph = runtime.load(document | {"metrics": metrics})
    result = graph.run(engine=engine)
    t = 0.05 + 0.1 * np.arange(80)
    by_hand = math.sqrt(np.mean(np.diff(np.sin(math.pi * t)) ** 2))
    assert result.metrics["late"] == pytest.approx(by_hand, rel=1e-12)
    assert result.metrics["late"] == pytest.approx(result.metrics["plain"], rel=0.01)


def test_a_probe_with_a_synapse_takes_the_values_of_a_late_block() -> None:
    """The filter sees each value once; rows between two of them show the last result."""
    wires = {name: {"input": "u.out"} for name in ("g", "k", "m")}
    document = {"run": {"dt": 0.001, "until": 0.05}, "blocks": LATE, "wires": wires}
    y, expected = 0.0, []
    for k in range(4, 50, 10):
        y += (1.0 - math.exp(-0.01 / 0.03)) * (k / 1000 - y)
        expected.append(y)
    for every in (10, 20):
        probes = {"y": {"of": "g.out", "synapse": 0.03, "every": every}}
        rows = runtime.load(document | {"probes": probes}).run().probes["y"]
        np.testing.assert_allclose(rows.t, np.arange(0.004, 0.05, every / 1000))
        np.testing.assert_allclose(rows.values, expected[:: every // 10], rtol=1e-12)


def test_a_session_and_a_run_folder_have_the_same_rows(tmp_path: Path) -> None:
    wires = {name: {"input": "u.out"} for name in ("g", "k", "m")}
    document = {"run": {"dt": 0.001, "until": 0.05}, "blocks": LATE, "wires": wires}
    graph = runtime.load(document | {"probes": {"y": "g.out"}})
    result = graph.run()
    saved = runtime.runs.open_run(result.save(tmp_path / "run"))
    session = graph.session()
    session.run(0.05)
    for rows in (saved.probes["y"], session.result().probes["y"]):
        np.testing.assert_array_equal(rows.t, result.probes["y"].t)
        np.testing.assert_array_equal(rows.values, result.probes["y"].values)
    short = graph.set("run.until", 0.003).metric("m", "final", "g.out").run()
    assert len(short["y"]) == 0 and short.metrics == {"m": None}


def test_signals_of_one_metric_must_be_on_the_same_ticks() -> None:
    wires = {name: {"input": "u.out"} for name in ("g", "k", "m")}
    document = {"run": {"dt": 0.001, "until": 0.05}, "blocks": LATE, "wires": wires}
    metric = {"kind": "iae", "of": "g.out", "reference": "k.out"}
    with pytest.raises(runtime.GraphError, match="recorded on other ticks than 'of'"):
        runtime.load(document | {"metrics": {"m": metric}}).check()


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"offset": 0.001}, "expected less than the block's dt = 0.001 s, got 0.001"),
        ({"dt": 0.01, "offset": 0.01}, "expected less than the block's dt = 0.01 s, got 0.01"),
        ({"dt": 0.01, "offset": 0.0015}, "is not a multiple of run.dt = 0.001 s"),
        ({"dt": 0.01, "offset": -0.001}, "expected a number of seconds above 0"),
    ],
)
def test_wrong_offsets(entry: dict[str, Any], message: str) -> None:
    made = {"u": {"type": "Function", "expression": "t"}, "g": {"type": "Gain", **entry}}
    with pytest.raises(runtime.GraphError) as caught:
        load(made, {"g": {"input": "u.out"}}).check()
    assert f"blocks.g.offset: {message}" in str(caught.value).replace("0.0015 s ", "")


def test_explain_shows_the_first_tick(cli: Any, tmp_path: Path) -> None:
    file = tmp_path / "late.yaml"
    file.write_text(
        "run: {dt: 0.001, until: 0.1}\n"
        "blocks:\n"
        "  u: {type: Sine}\n"
        "  g: {type: DiscretePID, dt: 0.01, offset: 0.004}\n"
        "wires: {g: {error: u.out}}\n"
        "probes: {g: g.out}\n"
    )
    shown: subprocess.CompletedProcess[str] = cli("explain", str(file), "--code")
    assert "from 0.004 s" in shown.stdout
    assert "if k % 10 == 4 or k == 0:" in shown.stdout
    exported = cli("export", str(file), str(tmp_path / "c"), "--block", "g")
    assert exported.returncode == 0, exported.stderr
    text = (tmp_path / "c" / "controller.c").read_text()
    assert "% 10 == 4 ||" in text
