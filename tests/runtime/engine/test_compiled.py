"""The compiled engine against the Python engine, and its messages."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks.core import pip_line
from runtime import cli
from runtime.cli.explain import explain_json
from runtime.compiler import kernel
from runtime.engine import selection as choice
from runtime.engine.compiled import runner
from runtime.runs.simulation import simulate
from runtime.toolchain import VARIABLE, MissingCompilerError
from tests.compilers import needs_compiler

pytestmark = needs_compiler

QUICK = ("line_actuator_failure_robust", "sine_estimation_error_robust")
GRAPHS = sorted(path.stem for path in Path("graphs").glob("*.yaml"))
MUJOCO = "mujoco"


class Doubled(blocks.Block):
    """Twice the input; plain text that compiles."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Scalar)

    def output(self, state, t, x):
        return 2.0 * x


class Named(blocks.Block):
    """Counts in a dictionary, which does not compile."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Scalar)
    total = blocks.State(1)

    def start(self, state):
        state.table = {"factor": 3.0}

    def output(self, state, t, x):
        return state.table["factor"] * x + float(state.total[0])

    def update(self, state, t, x):
        state.total[0] += x


class Failing(blocks.Block):
    """Divides by the time left of a second."""

    out = blocks.Output(blocks.Scalar)
    kind = blocks.param("zero", choices=("zero", "nan"), doc="how it fails")
    kind: str

    def output(self, state, t):
        if self.kind == "nan":
            return math.inf if t >= 0.5 else 0.0
        return 1.0 / (0.5 - t)


class Broken(blocks.Block):
    """Declares a kernel that does not compile."""

    out = blocks.Output(blocks.Scalar)

    def output(self, state, t):
        return t

    @blocks.kernel_of(output)
    def _output_kernel(self, state, t):
        return np.linalg.norm(t)


def engines(graph: runtime.Graph) -> tuple[runtime.Result, runtime.Result]:
    return graph.run(engine="python"), graph.run(engine="compiled")


def assert_equal(a: runtime.Result, b: runtime.Result) -> None:
    for name, recorded in a.probes.items():
        other = b.probes[name].values
        if "Spikes" in " ".join(recorded.kinds):
            assert np.array_equal(recorded.values, other), name
        np.testing.assert_allclose(other, recorded.values, rtol=1e-7, atol=1e-7, err_msg=name)
    for name, value in a.metrics.items():
        if value is None:
            assert b.metrics[name] is None, name
        else:
            assert b.metrics[name] == pytest.approx(value, rel=1e-9, abs=1e-9), name


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in QUICK else [pytest.mark.slow])
        for name in GRAPHS
        if MUJOCO not in name
    ],
)
def test_shipped_graphs_do_the_same_under_both_engines(name: str) -> None:
    # Following a wall by its scan is chaotic: from 7 s on, when it begins, a rounding error grows
    # tenfold every 0.35 s, under one engine as between two.
    until = 8.0 if name.startswith("wall") else 2.0
    graph = runtime.load(name).set("run.until", until)
    graph = graph.probe("omega_spikes", "adaptive.snn_omega.spikes")
    assert_equal(*engines(graph))


def chain(*made: blocks.Block, dt: float | None = None) -> runtime.Graph:
    """A clock and a chain of blocks after it; the second at its own rate."""
    graph = runtime.Graph("chain", dt=0.01, until=2.0)
    graph = graph.add("source", blocks.Gain(gain=1.0)).add("delay", blocks.UnitDelay(initial=1.0))
    graph = graph.connect("delay.out", "source.input")
    last = "source.out"
    for i, block in enumerate(made):
        graph = graph.add(f"b{i}", block, dt=dt if i == 1 else None)
        graph = graph.connect(last, f"b{i}.x")
        last = f"b{i}.out"
    graph = graph.add("back", blocks.Gain(gain=0.01)).connect(last, "back.input")
    graph = graph.connect("back.out", "delay.input")
    return graph.probe("last", last).probe("delayed", "delay.out")


@pytest.mark.parametrize("dt", [None, 0.05])
def test_blocks_that_do_not_compile_are_called_between_those_that_do(dt: float | None) -> None:
    graph = chain(Doubled(), Named(), Doubled(), dt=dt)
    assert_equal(*engines(graph))
    facts = explain_json(graph.set("run.engine", "compiled"))["engine"]
    assert set(facts["from_python"]) == {"b1"}
    assert "dict" in facts["from_python"]["b1"]
    assert {"b0", "b2", "back", "delay", "source"} == set(facts["compiled"])
    assert facts["parts"] == 3


@pytest.mark.parametrize("kind", ["zero", "nan"])
def test_failures_have_the_same_message(kind: str) -> None:
    graph = runtime.Graph("failing", dt=0.125, until=2.0).add("bad", Failing(kind=kind))
    graph = (
        graph.add("more", blocks.Gain(gain=1.0)).connect("bad.out", "more.input").probe("more.out")
    )
    message, kept = [], []
    for engine in ("python", "compiled"):
        with pytest.raises(runtime.SimulationError) as caught:
            graph.run(engine=engine)
        # Python calls it a float division by zero.
        message.append(str(caught.value).partition(" (/")[0].replace("float division", "division"))
        kept.append(caught.value.result["more.out"])
    assert message[0] == message[1]
    assert message[0].startswith("block 'bad' at tick 4 (t = 0.5 s): ")
    assert np.array_equal(kept[0], kept[1])
    assert len(kept[0]) == 4


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_the_output_that_is_not_finite_is_named(engine: str) -> None:
    # The plant's pose is one output as well, and finite: only the wheels are too fast.
    graph = runtime.Graph("fast", dt=0.1, until=1.0)
    graph = graph.add("go", blocks.Constant(value=[1e308, 1e308], signal="Twist"))
    graph = graph.add("plant", blocks.DifferentialDrive(wheel_base=10.0)).connect(
        "go.value", "plant.command"
    )
    with pytest.raises(runtime.SimulationError, match="output 'wheels' is not finite"):
        graph.run(engine=engine)


class Growing(blocks.Block):
    """Numbers of which the squares, then the sums and at last they themselves are infinite."""

    pair = blocks.Output(blocks.Twist)
    vector = blocks.Output(blocks.Vector(3))
    x = blocks.State(1)

    def start(self, state):
        state.x[0] = 1e150

    def output(self, state, t):
        big = float(state.x[0])
        return (big, big), np.array([big, -big, 1.0])

    def update(self, state, t):
        big = float(state.x[0])
        state.x[0] = big * (10.0 if big < 1e307 else 1.1)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_large_numbers_are_finite_as_long_as_they_are(engine: str) -> None:
    graph = runtime.Graph("growing", dt=0.1, until=50.0)
    graph = graph.add("block", Growing()).probe("block.vector")
    with pytest.raises(runtime.SimulationError) as caught:
        graph.run(engine=engine)
    x = 1e150
    seen = []
    while math.isfinite(x):
        seen.append(x)
        x *= 10.0 if x < 1e307 else 1.1
    assert "output 'pair' is not finite" in str(caught.value)
    assert f"tick {len(seen)} " in str(caught.value)
    assert caught.value.result["block.vector"][:, 0].tolist() == seen


def test_a_kernel_that_does_not_compile_is_named_with_the_reason() -> None:
    graph = runtime.Graph("promise", dt=0.1, until=1.0).add("bad", Broken()).probe("bad.out")
    notes: list[str] = []
    result = simulate(graph.set("run.engine", "compiled").prepared(), note=notes.append)
    assert result["bad.out"][-1] == pytest.approx(0.9)
    (note,) = [text for text in notes if "bad" in text]
    assert "block 'bad' is called from Python" in note
    assert f"{__file__}:" in note
    assert "norm" in note


def files(folder: Path, kind: str) -> set[str]:
    return {path.name for path in folder.glob(kind)}


def test_rewiring_compiles_only_the_plan_and_numbers_compile_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    graph = chain(Doubled(), Doubled())
    graph.run(engine="compiled")
    texts, units = files(tmp_path, "block_*.json"), files(tmp_path, "unit_*.o")
    assert len(texts) == 3
    assert len(units) == 1  # these blocks are so small that they are in the plan's unit
    for changed in (graph.set("run.seed", 5), graph.set("blocks.back.gain", 0.02)):
        changed.run(engine="compiled")
        assert files(tmp_path, "block_*.json") == texts
        assert files(tmp_path, "unit_*.o") == units
    graph.wire("b1.x", "source.out").run(engine="compiled")
    assert files(tmp_path, "block_*.json") == texts
    assert len(files(tmp_path, "unit_*.o") - units) == 1


def gains(count: int) -> runtime.Graph:
    """A clock, and gains of different sizes after it."""
    graph = runtime.Graph("gains", dt=0.01, until=0.5).add("b0", blocks.Ramp())
    for i in range(1, count + 1):
        graph = graph.add(f"b{i}", blocks.Gain(gain=1.0 + 0.01 * (-1) ** i / i))
        graph = graph.connect(f"b{i - 1}.out", f"b{i}.input")
    return graph.probe("last", f"b{count}.out")


@pytest.mark.parametrize("is_long", [False, True])
def test_small_blocks_are_in_the_unit_of_a_plan_that_is_not_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_long: bool
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(runner, "INLINED", 10 if is_long else 11)
    a, b = engines(gains(10))
    assert np.array_equal(a["last"], b["last"])
    assert a["last"][-1] != 0.0
    assert len(files(tmp_path, "unit_*.o")) == (3 if is_long else 1)


def test_a_block_that_the_c_compiler_does_not_accept_is_called_from_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    write = kernel._write

    def wrong(*arguments: Any) -> Any:
        record, functions = write(*arguments)
        if "Doubled" in arguments[3]:
            record["text"] = record["text"].replace("2.0 *", "2.0 **")
        return record, functions

    monkeypatch.setattr(kernel, "_write", wrong)
    a, b = engines(chain(Doubled()))
    assert_equal(a, b)
    assert b.manifest["engine"] == "compiled"


def no_compiler() -> None:
    raise MissingCompilerError("no C compiler found")


def test_without_a_compiler_the_message_is_the_command_that_installs_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(choice, "find_compiler", no_compiler)
    code = cli.run(["run", "line_actuator_failure", "--engine", "compiled", "--until", "0.1"])
    assert code == 4
    assert pip_line("compiler") in capsys.readouterr().err


def test_auto_compiles_long_runs_and_has_a_note_without_a_compiler(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph = runtime.load("line_actuator_failure")
    room = runtime.load("wall_following").network
    assert room.until == 130.0
    assert choice.take_compiled(room, 1, lambda text: None)
    assert not choice.take_compiled(graph.network, 1, lambda text: None)
    short, long = graph.set("run.until", 1.0).network, graph.set("run.until", 5000.0).network
    notes: list[str] = []
    assert not choice.take_compiled(short, 1, notes.append)
    assert choice.take_compiled(short, 1000, notes.append)
    assert choice.take_compiled(long, 1, notes.append)
    assert notes == []
    monkeypatch.setattr(choice, "available", lambda: False)
    assert not choice.take_compiled(long, 1, notes.append)
    assert pip_line("compiler") in notes[0]


def test_a_run_records_its_engine_and_runs_again_with_the_same_bits(cli, tmp_path: Path) -> None:
    arguments = ("--engine", "compiled", "--until", "0.5", "--no-plots", "--json", "-q")
    done = cli("run", "line_actuator_failure", *arguments)
    assert done.returncode == 0, done.stderr
    first = json.loads(done.stdout)
    assert first["engine"] == "compiled"
    again = json.loads(
        cli("run", f"{first['run']}/graph.resolved.yaml", "--no-plots", "--json").stdout
    )
    assert again["engine"] == "compiled"
    a, b = (np.load(tmp_path / run["run"] / "probes.npz") for run in (first, again))
    assert all(np.array_equal(a[name], b[name], equal_nan=True) for name in a.files)


def test_an_unknown_engine_is_reported_with_the_known_ones(cli) -> None:
    done = cli("run", "line_actuator_failure", "--engine", "compild")
    assert done.returncode == 2
    assert "did you mean 'compiled'?" in done.stderr


class Drawn(blocks.Block):
    """Returns 1 or -1 by a flag drawn at the start, which is a constant in compiled text."""

    out = blocks.Output(blocks.Scalar)

    def start(self, state):
        state.up = bool(state.rng.random() < 0.5)

    def output(self, state, t):
        return 1.0 if state.up else -1.0


def test_draws_at_the_start_depend_on_the_seed() -> None:
    graph = runtime.Graph("drawn", dt=0.1, until=1.0).add("flag", Drawn()).probe("flag.out")
    graph = graph.set("run.engine", "compiled").check()
    found = [float(graph.with_seed(seed).run()["flag.out"][-1]) for seed in range(8)]
    expected = [float(graph.run(seed=s, engine="python")["flag.out"][-1]) for s in range(8)]
    assert found == expected
    assert set(found) == {1.0, -1.0}


def test_a_graph_is_compiled_once_for_all_seeds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    graph = chain(Doubled(), Named(), dt=0.05).set("run.engine", "compiled").check()
    notes: list[str] = []
    simulate(graph.prepared(), note=notes.append)
    assert "compiling the plan" in notes[0]
    simulate(graph.with_seed(5).prepared(), note=notes.append)
    assert len(notes) == 1


def test_profile_times_every_block(cli) -> None:
    done = cli(
        "run", "line_actuator_failure", "--until", "0.2", "--profile", "--no-plots", "--json"
    )
    rows = {row["block"]: row for row in json.loads(done.stdout)["profile"]}
    assert {"plant", "lqr", "adaptive.snn_omega", ""} <= set(rows)
    # Two evaluations and an update on each of 200 ticks; outputs of the LQR every 10th. The first
    # tick is left out: it builds and imports what blocks need.
    assert rows["plant"]["calls"] == 199 * 4
    assert rows["lqr"]["calls"] == 19
    assert sum(row["share"] for row in rows.values()) == pytest.approx(1.0, abs=0.01)
    refused = cli("run", "line_actuator_failure", "--profile", "--engine", "compiled")
    assert refused.returncode == 2
    assert "--engine python" in refused.stderr


@needs_compiler
@pytest.mark.slow
def test_instructions_of_the_processor_change_no_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for tuned in (True, False):
        if not tuned:
            monkeypatch.setattr("runtime.toolchain.library.tuning", lambda compiler: ())
        monkeypatch.setenv("SPIKEBLOCKS_CACHE", str(tmp_path / str(tuned)))
        # Another object, so that the compiled function is made again.
        graph = runtime.load("line_actuator_failure").set("run.until", 0.5)
        found.append(graph.run(engine="compiled").probes)
    for name, recording in found[0].items():
        np.testing.assert_array_equal(recording.values, found[1][name].values, err_msg=name)
