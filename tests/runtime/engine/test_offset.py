"""Blocks whose first tick is later than that of the run, beside the samples that they must take."""

from __future__ import annotations

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
    # Ticks 3, 10, 17, 24 on a grid of every tick.
    ticks = np.arange(30)
    assert probe.t.tolist() == pytest.approx((ticks * 0.001).tolist())
    np.testing.assert_array_equal(probe.values.ravel(), np.maximum(0, (ticks - 3) // 7))


def test_a_probe_has_rows_on_all_ticks_of_a_late_block() -> None:
    made = {
        "u": {"type": "Function", "expression": "t"},
        "g": {"type": "Gain", "gain": 1.0, "dt": 0.01, "offset": 0.004},
    }
    graph = runtime.load(
        {
            "run": {"dt": 0.001, "until": 0.05},
            "blocks": made,
            "wires": {"g": {"input": "u.out"}},
            "probes": {"g": "g.out"},
        }
    )
    probe = graph.run().probes["g"]
    np.testing.assert_allclose(probe.t, np.arange(0, 0.05, 0.002))
    np.testing.assert_allclose(probe.values.ravel()[:8], [0, 0, 4e-3] + [4e-3] * 4 + [0.014])


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
