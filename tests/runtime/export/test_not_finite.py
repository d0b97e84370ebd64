"""What an exported controller does with NaN, with infinite numbers, and with parts that are off."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks import Block, Input, Output, Scalar, State
from runtime.errors import UsageError
from runtime.export import export
from tests.runtime.export.test_export import Stepped, chain, needs_compiler

PART = """
graph: part
inputs: {on: Scalar, x: Scalar}
outputs: {total: total.out}
blocks:
  enable: {type: %s}
  total: {type: DiscreteIntegrator}
wires:
  enable: {input: inputs.on}
  total: {input: inputs.x}
"""


class Squared(Block):
    """input ─▶ [ Squared ] ─▶ out: the sum of all squares before, at most 1."""

    input = Input(Scalar, doc="x")
    out = Output(Scalar, doc="min(sum, 1)")
    weights = State(1, doc="sum of x * x")

    def output(self, state: Any, t: float) -> float:
        return min(float(state.weights[0]), 1.0)

    def update(self, state: Any, t: float, input: float) -> None:
        state.weights[0] += input * input


@needs_compiler
@pytest.mark.slow
def test_neurons_survive_an_input_that_is_not_finite(tmp_path: Path) -> None:
    graph = runtime.Graph("neurons", dt=0.001, until=0.2)
    graph = graph.add("signal", blocks.Sine(amplitude=0.9))
    graph = graph.add("snn", blocks.Ensemble(neurons=20, dimensions=1)).add(
        "value", blocks.Decoder()
    )
    graph = graph.add("mux", blocks.Gain(gain=[[1.0]])).connect("signal.out", "mux.input")
    graph = graph.connect("mux.out", "snn.input").connect("snn.spikes", "value.spikes")
    for hold in (False, True):
        folder = tmp_path / str(hold)
        export(graph, folder, others=["signal"], hold=hold)
        made = Stepped(folder, 1, 1)
        for _ in range(100):
            assert made.step(0.8) == ""
        before = made.outputs[0]
        said = made.step(math.nan)
        assert said == ("" if hold else "input signal.out is not finite")
        if not hold:
            assert made.outputs[0] == before
            assert made.step(0.8) == said
            made.init()
        for _ in range(200):
            assert made.step(0.8) == ""
        assert made.outputs[0] == pytest.approx(0.8, abs=0.25)


@needs_compiler
def test_without_a_first_value_there_is_nothing_to_hold(tmp_path: Path) -> None:
    export(chain(blocks.Gain(gain=3.0)), tmp_path, blocks=["block"], hold=True)
    made = Stepped(tmp_path, 1, 1)
    assert made.step(math.inf) == "input noise.out is not finite"
    made.init()
    assert made.step(2.0) == "" and made.step(math.nan) == "" and made.outputs[0] == 6.0


@needs_compiler
def test_a_state_that_is_not_finite_is_named_and_not_kept(tmp_path: Path) -> None:
    export(chain(Squared()), tmp_path, blocks=["block"])
    made = Stepped(tmp_path, 1, 1)
    assert made.step(3.0) == ""
    assert made.step(1e200) == "state block.weights is not finite"
    made.reset()
    assert made.step(3.0) == "" and made.outputs[0] == 0.0


@needs_compiler
@pytest.mark.parametrize("switch", ["Enable", "Enable, while_off: reset", "Trigger"])
@pytest.mark.parametrize("inside", [True, False])
def test_parts_that_run_at_times_are_exported(switch: str, inside: bool, tmp_path: Path) -> None:
    (tmp_path / "part.yaml").write_text(PART % switch)
    (tmp_path / "graph.yaml").write_text(
        "graph: whole\nrun: {dt: 0.01, until: 1.0}\nblocks:\n"
        "  when: {type: Pulse, period: 0.2, width: 0.05}\n  x: {type: Sine}\n"
        "  part: {graph: part.yaml}\n  after: {type: Gain, gain: 2.0}\n"
        "wires:\n  part: {on: when.out, x: x.out}\n  after: {input: part.total}\n"
    )
    graph = runtime.load(tmp_path / "graph.yaml")
    chosen = {"blocks": ["part"]} if inside else {"blocks": ["part.total"]}
    made = export(graph, tmp_path / "out", **chosen)
    expected = {"when.out", "x.out"} if inside else {"part.enable.on", "x.out"}
    assert set(made.inputs) == expected
    assert made.outputs == ("part.total.out",)
    assert "part.total.out: largest difference 0\n" in made.report
    result = graph.probe("total", "part.total.out").run()
    assert np.ptp(result["total"]) > 0.0


HOSTILE = [
    "INFINITY",
    "NULL",
    "NAN",
    "M_PI",
    "linux",
    "asm",
    "typeof",
    "int",
    "c",
    "ctx",
    "t",
    "in",
]


@needs_compiler
@pytest.mark.parametrize("kind", ["Gain", "UnitDelay", "Lowpass"])
@pytest.mark.slow
def test_blocks_and_parts_may_have_any_name(kind: str, tmp_path: Path) -> None:
    options = {"Gain": ", gain: 2.0", "UnitDelay": "", "Lowpass": ", tau: 0.05"}[kind]
    lines = ["graph: '*/ #error \\'", "run: {dt: 0.01, until: 0.2}", "blocks:", "  x: {type: Sine}"]
    lines += [f"  {name}: {{type: {kind}{options}}}" for name in HOSTILE]
    lines += ["  M: {graph: P*part.yaml}", "wires:"]
    for name, source in zip(HOSTILE, ["x", *HOSTILE], strict=False):
        lines.append(f"  {name}: {{input: {source}.out}}")
    lines.append("  M: {a: in.out}")
    part = "graph: p\ninputs: {a: Scalar}\noutputs: {PI: PI.out}\nwires:\n  PI: {input: inputs.a}\n"
    part += f"blocks:\n  PI: {{type: {kind}{options}}}\n"
    (tmp_path / "P*part.yaml").write_text(part)
    (tmp_path / "graph.yaml").write_text("\n".join(lines) + "\n")
    folder = tmp_path / "a folder? * 'x'"
    made = export(runtime.load(tmp_path / "graph.yaml"), folder, others=["x"])
    assert "largest difference 0\n" in made.report
    from tests.runtime.export.test_every_block import COMPILERS, run

    for compiler in COMPILERS:
        assert "fine" in run(folder, compiler, "-O1", "controller.c", "controller_test.c")
        # Without -std=c99, linux and unix are macros.
        assert "fine" in run(folder, compiler, "-std=gnu99", "controller.c", "controller_test.c")


@pytest.mark.parametrize("name", ["linux", "NAN", "math", "context", "int", "1a", "a" * 61, "é"])
def test_names_that_c_has_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--name"):
        export(chain(blocks.Gain(gain=2.0)), tmp_path / "out", blocks=["block"], name=name)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_nan_in_the_states_of_an_earlier_run_is_named(engine: str, tmp_path: Path) -> None:
    graph = chain(Squared())
    graph.run().save(tmp_path / "run")
    states = dict(np.load(tmp_path / "run" / "states.npz"))
    states["block.weights"][0] = math.nan
    np.savez(tmp_path / "run" / "states.npz", **states)
    again = graph.set("initial", {"block.weights": str(tmp_path / "run")})
    with pytest.raises(runtime.SimulationError, match="'block'.*1 of 1 numbers.*'weights' are NaN"):
        again.run(engine=engine)
