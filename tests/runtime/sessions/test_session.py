"""Sessions: bits of an uninterrupted run, whatever is done in between, and logs that replay."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import blocks
import runtime
from runtime.graph import open_session
from runtime.sessions import Session
from tests.conftest import Run
from tests.examples import examples

FOLDER = Path(runtime.__file__).parents[1] / "graphs"
PATHS = sorted([*FOLDER.glob("*.yaml"), *(FOLDER / "gallery").rglob("*.yaml")])
NAMES = [str(p.relative_to(FOLDER).with_suffix("")) for p in PATHS]
QUICK = ["line_actuator_failure", "gallery/adaptive_arm", "gallery/noise_filter"]
QUICK += [f"gallery/{name}" for name in ("night_setback", "van_der_pol", "zero_order_hold")]
ENGINES = ("python", "compiled")
TICKS = 60

SERVO: dict[str, Any] = {
    "graph": "servo",
    "run": {"dt": 0.001, "until": 0.1, "seed": 4},
    "inputs": {"push": {"type": "Scalar", "default": 0.5, "min": -2, "max": 2}},
    "blocks": {
        "noise": {"type": "WhiteNoise", "density": 0.01},
        "gain": {"type": "Gain", "gain": 2.0},
        "sum": {"type": "Sum"},
        "x": {"type": "Integrator", "initial": 1.0},
        "held": {"type": "UnitDelay"},
        "snn": {"type": "Ensemble", "neurons": 20},
        "out": {"type": "Decoder"},
    },
    "wires": {
        "gain": {"input": "held.out"},
        "sum": {"terms": ["noise.out", "gain.out", "inputs.push"]},
        "x": {"input": "sum.out"},
        "held": {"input": "x.out"},
        "snn": {"input": ["x.out"]},
        "out": {"spikes": "snn.spikes"},
    },
    "probes": {
        "x": "x.out",
        "sum": "sum.out",
        "out": {"of": "out.value", "synapse": 0.05, "every": 3},
        "spikes": "snn.spikes",
        "push": "inputs.push",
    },
}


def same(one: Any, other: Any) -> list[str]:
    """The probes that differ."""
    return [
        name
        for name in one.probes
        if not np.array_equal(one[name], other[name], equal_nan=True)
        or not np.array_equal(one.time(name), other.time(name))
    ]


def servo(engine: str = "python", **changes: Any) -> Session:
    return runtime.load({**SERVO, **changes}).session(engine=engine)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in NAMES]
)
def test_a_branch_half_way_has_the_bits_of_a_run(name: str, engine: str) -> None:
    """In a fresh engine, after half of the ticks."""
    graph = runtime.load(FOLDER / f"{name}.yaml")
    graph = graph.set("run.until", TICKS * graph.network.dt)
    try:
        whole = graph.run(engine=engine)
    except runtime.MissingExtraError as error:
        pytest.skip(str(error))
    session = graph.session(engine=engine).step(TICKS // 2)
    other = session.branch()
    other.step(TICKS - TICKS // 2)
    assert same(whole, other.result()) == []
    session.step(7).step().step(TICKS - TICKS // 2 - 8)
    assert same(whole, session.result()) == []
    assert whole.metrics == session.result().metrics


@pytest.mark.parametrize("engine", ENGINES)
def test_a_signal_is_what_the_next_tick_records(engine: str) -> None:
    session = servo(engine)
    read = []
    for _ in range(12):
        read.append([session.read(name) for name in ("x.out", "sum.out", "inputs.push")])
        session.step()
    result = session.result()
    rows = np.column_stack([result["x"], result["sum"], result["push"]])
    assert np.array_equal(np.array(read), rows)
    assert session.read("snn.spikes").shape == (20,)
    assert session.read("x.integral") == session.read("x.out")
    together = session.read(
        "out.value", "snn.spikes", "sum.out", "snn.voltage.3", "snn.spikes[0:2]"
    )
    for value, address in zip(together, ("out.value", "snn.spikes", "sum.out"), strict=False):
        assert np.array_equal(value, session.read(address))
    assert together[3] == session.read("snn.voltage")[3] and together[4].shape == (2,)


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_written_acts_from_the_next_tick_on(engine: str) -> None:
    session = servo(engine).step(10)
    session.write("push", -1.5)
    session.step(10)
    expected = [0.5] * 10 + [-1.5] * 10
    assert session.result()["push"].tolist() == expected
    with pytest.raises(runtime.UsageError, match="'push': expected at most 2, got 3"):
        session.write("push", 3.0)
    with pytest.raises(runtime.UsageError, match="did you mean 'push'"):
        session.write("psh", 1.0)


@pytest.mark.parametrize("engine", ENGINES)
def test_blocks_keep_what_the_run_has_moved(engine: str) -> None:
    session = servo(engine).step(40)
    x, voltage, spikes = (session.read(n) for n in ("x.out", "snn.voltage", "snn.spikes"))
    session.set("x.initial", 7.0)
    session.set("gain.gain", -3.0)
    assert session.read("x.out") == x
    assert np.array_equal(session.read("snn.voltage"), voltage)
    assert np.array_equal(session.read("snn.spikes"), spikes)
    session.set("snn.max_rates", "uniform(50, 60)")
    # What start computes and the run has not touched follows the parameter.
    gain = servo(engine, blocks={**SERVO["blocks"], "snn": session_block(session)}).read("snn.gain")
    assert np.array_equal(session.read("snn.gain"), gain)
    assert np.array_equal(session.read("snn.voltage"), voltage)
    session.set("snn.neurons", 30)
    assert session.read("snn.voltage").shape == (30,)
    session.step(5)
    result = session.result()
    assert result["x"].shape == (45,) and result["spikes"].shape == (5, 30)
    assert result.time("spikes")[0] == pytest.approx(0.04)


def session_block(session: Session) -> Any:
    return session.graph.to_dict()["blocks"]["snn"]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_change_that_is_wrong_changes_nothing(engine: str) -> None:
    session, other = servo(engine).step(20), servo(engine).step(20)
    for wrong in (
        lambda: session.set("gain.gian", 1.0),
        lambda: session.without("nose"),
        lambda: session.wire("x.input", "snn.spikes"),
        lambda: session.wire("held.input", "held"),
        lambda: session.set("run.dt", 0.002),
        lambda: session.replace("gain", "Integratr"),
    ):
        with pytest.raises(runtime.SpikeblocksError):
            wrong()
    assert session.log == () and session.tick == 20
    assert same(session.step(20).result(), other.step(20).result()) == []


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_goes_on_beyond_its_end(engine: str) -> None:
    whole = runtime.load(SERVO).run(until=0.3, engine=engine)
    assert same(whole, servo(engine).run(0.09).run(0.21).result()) == []


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_kept_is_the_last_part(engine: str) -> None:
    whole = runtime.load(SERVO).run(until=4.0, engine=engine)
    session = runtime.load(SERVO).session(engine=engine, keep=0.2)
    for _ in range(40):
        session.run(0.1)
    result = session.result()
    for name in ("x", "spikes", "out"):
        rows = len(result[name])
        assert rows == (67 if name == "out" else 200)
        assert np.array_equal(result[name], whole[name][-rows:])
        assert np.array_equal(result.time(name), whole.time(name)[-rows:])


@pytest.mark.slow
def test_an_hour_takes_as_much_memory_as_some_minutes() -> None:
    resource = pytest.importorskip("resource")
    # As long from the start: a session that grows beyond its end plans anew, with other memory.
    stable = runtime.load(SERVO).set("gain.gain", -2.0).set("run.until", 3600.0)
    session = stable.session(engine="compiled", keep=10.0)
    peak = {}
    for minute in range(1, 61):
        session.run(60.0)
        session.write("push", 0.01 * minute)
        peak[minute] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # MB, on Linux
    assert session.tick == 3_600_000 and len(session.log) == 60
    sinks = session._engine.recorder.sinks.values()
    assert sum(part.nbytes for sink in sinks for part in sink.parts) < 8e6  # 25 numbers a tick
    assert peak[60] - peak[5] < 10.0
    assert session.result().time("x")[0] == pytest.approx(3590.0)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_keeps_the_last_part_as_well(engine: str, tmp_path: Path) -> None:
    graph = runtime.load({**SERVO, "run": {**SERVO["run"], "keep": "200 s", "time_unit": "s"}})
    whole = graph.run(until=1.5, engine=engine)
    assert len(whole["x"]) == 1500 and not any("run.keep" in note for note in whole.notes)
    result = graph.set("run.keep", "0.2s").run(until=1.5, engine=engine)
    assert "run.keep: recordings, metrics and plots are of the last 0.2 s" in result.notes
    again = runtime.load(result.save(tmp_path / "a") / "graph.resolved.yaml").run()
    for name in ("x", "spikes", "out"):
        rows = len(result[name])
        assert rows == (67 if name == "out" else 200)
        assert np.array_equal(result[name], whole[name][-rows:])
        assert np.array_equal(result.time(name), whole.time(name)[-rows:])
    assert same(result, again) == []


@pytest.mark.parametrize("wrong", [0, -1, True, "x", "5min", "1e999s", [1]])
def test_what_is_wrong_with_what_is_kept(wrong: Any) -> None:
    with pytest.raises(runtime.GraphError, match="run.keep: expected a time above 0, as in 60 or"):
        runtime.load(SERVO).session(keep=wrong)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_failure_is_reported_again_until_the_session_goes_back(engine: str) -> None:
    session = servo(engine).step(10)
    before = session.snapshot()
    session.set("gain.gain", 1e200)
    with pytest.raises(runtime.SimulationError) as caught:
        session.step(100)
    result, reached = session.result(), caught.value.result
    assert isinstance(reached, runtime.Result)
    assert len(reached["x"]) == len(result["x"]) == session.tick < 110
    for each in (reached, result):
        assert each.status == "failed" and each.manifest["error"] == str(caught.value)
    with pytest.raises(runtime.SimulationError):
        session.step()
    session.restore(before)
    assert session.log == ()
    assert same(session.step(10).result(), servo(engine).step(20).result()) == []


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("path", "value"),
    [("gain.gain", -1.0), ("noise.density", 0.3), ("k.value", 4.0), ("pid.kp", 3.0)],
)
def test_numbers_that_change_in_place_are_those_of_a_new_engine(
    path: str, value: float, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocks = {**SERVO["blocks"], "k": {"type": "Constant", "value": 1.0}, "pid": {"type": "PID"}}
    wires = {**SERVO["wires"], "pid": {"error": "k.value"}}
    wires["sum"] = {"terms": ["noise.out", "gain.out", "inputs.push", "pid.out"]}
    session, other = (servo(engine, blocks=blocks, wires=wires).step(15) for _ in range(2))
    saved, running = session.snapshot(), session._engine
    session.set(path, value)
    assert session._engine is running
    monkeypatch.setattr(Session, "_retune", lambda *_: False)
    other.set(path, value)
    assert same(session.step(15).result(), other.step(15).result()) == []
    assert session.graph == other.graph
    session.restore(saved)
    untouched = servo(engine, blocks=blocks, wires=wires).step(30)
    assert same(session.step(15).result(), untouched.result()) == []


CALLS = {
    "step": st.tuples(st.integers(1, 30)),
    "write": st.tuples(st.just("push"), st.floats(-2.0, 2.0)),
    "set": st.sampled_from(
        [
            ("gain.gain", -1.0),
            ("gain.gain", 0.25),
            ("noise.density", 0.5),
            ("snn.radius", 2.0),
            ("snn.neurons", 25),
            ("x.initial", 3.0),
        ]
    ),
    "wire": st.sampled_from([("gain.input", "x.out"), ("gain.input", "held.out")]),
    "without": st.sampled_from([("noise",), ("gain",)]),
    "replace": st.sampled_from([("gain", "Abs")]),
    "bypass": st.just(("gain",)),
    "overlay": st.just(({"blocks": {"gain": {"gain": 0.5}}, "run": {"until": 0.05}},)),
    "read": st.sampled_from([("sum.out",), ("out.value",), ("inputs.push",)]),
    "snapshot": st.tuples(),
    "restore": st.tuples(),
    "branch": st.tuples(),
}


@given(
    calls=st.lists(
        st.sampled_from(sorted(CALLS)).flatmap(
            lambda name: CALLS[name].map(lambda arguments: (name, arguments))
        ),
        min_size=1,
        max_size=14,
    ),
    engine=st.sampled_from(ENGINES),
)
# A snapshot of the parent: what the branch had set in place was still to be written to its graph.
@example(
    [("branch", ()), ("set", ("gain.gain", -1.0)), ("restore", ()), ("branch", ()), ("step", (2,))],
    "python",
)
@examples(30)
def test_any_session_replays_from_its_log(
    tmp_path_factory: pytest.TempPathFactory, calls: list[Any], engine: str
) -> None:
    session = servo(engine)
    saved = session.snapshot()
    for name, arguments in calls:
        if name == "snapshot":
            saved = session.snapshot()
        elif name == "restore":
            session.restore(saved)
        elif name == "branch":
            session = session.branch()
        else:
            with contextlib.suppress(runtime.GraphError):  # such as of a block that was removed
                getattr(session, name)(*arguments)
    folder = session.save(tmp_path_factory.mktemp("session") / "a")
    again = open_session(folder)
    assert (again.tick, again.log) == (session.tick, session.log)
    assert same(session.result(), again.result()) == []
    assert same(runtime.open(folder / "run"), again.result()) == []


def test_a_saved_session_is_replayed_by_the_command_line(cli: Run, tmp_path: Path) -> None:
    session = servo().step(20)
    session.write("push", 1.0)
    session.step(20)
    session.save(tmp_path / "a")
    done = cli("replay", "a")
    assert done.returncode == 0, done.stderr
    assert (
        done.stdout == "servo: 40 ticks, 1 change\nall recordings have the bits that were saved\n"
    )
    log = tmp_path / "a" / "log.jsonl"
    log.write_text(log.read_text().replace("1.0", "1.5"))
    done = cli("replay", "a", "--json")
    assert done.returncode == 1 and '"push"' in done.stdout
    log.write_text('{"tick": 20, "call": "rite", "arguments": ["push", 1.0]}\n')
    done = cli("replay", "a")
    assert (
        done.returncode == 2
        and "a session has no method 'rite', did you mean 'write'?" in done.stderr
    )
    done = cli("replay", "b")
    assert done.returncode == 2 and "'b' is no saved session" in done.stderr


class Interrupting(blocks.Block):
    """Presses Ctrl-C in the middle of a tick."""

    out = blocks.Output(blocks.Scalar)
    count = blocks.State()

    def output(self, state: Any, t: float) -> float:
        if float(state.count) == 30.0:
            os.kill(os.getpid(), signal.SIGINT)
        return float(state.count)

    def update(self, state: Any, t: float) -> None:
        state.count += 1.0


@pytest.mark.parametrize("engine", ENGINES)
def test_ctrl_c_waits_for_the_end_of_a_tick(engine: str) -> None:
    graph = runtime.Graph("counting", dt=0.001, until=0.2).add("n", Interrupting()).probe("n.out")
    session = graph.session(engine=engine)
    with pytest.raises(KeyboardInterrupt):
        session.step(200)
    assert 30 < session.tick < 200
    assert session.read("n.out") == session.tick
    session.step(200 - session.tick)
    assert session.result()["n.out"].tolist() == list(range(200))
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


class Loose(blocks.Block):
    """Keeps memory undeclared, against the rules: a generator and a count that it makes late."""

    out = blocks.Output(blocks.Scalar)

    def start(self, state: Any) -> None:
        state.first, state.both = 100.0, [0.0]
        state.again = state.both

    def output(self, state: Any, t: float) -> float:
        return float(state.both[0] + getattr(state, "first", 0.0) + getattr(state, "drawn", 0.0))

    def update(self, state: Any, t: float) -> None:
        if t > 0.005 and not hasattr(state, "mine"):
            state.mine = np.random.Generator(np.random.MT19937(3))
            del state.first
        state.again[0] += 1.0
        if hasattr(state, "mine"):
            state.drawn = state.mine.normal()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("at", [0, 3, 12])
def test_undeclared_memory_goes_over_to_a_branch(engine: str, at: int) -> None:
    graph = runtime.Graph("loose", dt=0.001, until=0.03).add("n", Loose()).probe("n.out")
    whole = graph.run(engine=engine)["n.out"]
    session = graph.session(engine=engine).step(at)
    saved, other = session.snapshot(), session.branch()
    assert np.array_equal(other.step(30 - at).result()["n.out"], whole)
    for _ in range(2):
        assert session.read("n.out") == whole[at]
        assert np.array_equal(session.step(30 - at).result()["n.out"], whole)
        session.restore(saved)


def test_what_was_found_by_an_attack(tmp_path: Path) -> None:
    session = servo()
    session.set("gain.gain", 3.0)
    session.set("blocks.gain.gain", 4.0)
    session.set("gain.gain", np.float32(5.0))
    assert session.graph.to_dict()["blocks"]["gain"]["gain"] == 5.0
    for wrong in (
        lambda: session.read("x.out.nonsense"),
        lambda: session.read("snn.spikes.55"),
        lambda: session.read("snn.voltage.99"),
        lambda: session.read("snn.voltage.-1"),
        lambda: session.read("x.integral.0"),
        lambda: session.step(2.5),  # type: ignore[arg-type]
        lambda: session.step(-3),
        lambda: session.run(None),  # type: ignore[arg-type]
        lambda: session.restore(None),  # type: ignore[arg-type]
        lambda: session.restore(servo().snapshot()),
        lambda: session.replace("gain", 3),  # type: ignore[arg-type]
        lambda: session.without(),
        lambda: session.bypass(),
        lambda: session.read(),
        lambda: session.write("push", "1"),
        lambda: session.write("push", None),
        lambda: session.write("push", [1.0]),
        lambda: session.write("push", float("nan")),
    ):
        log = session.log
        with pytest.raises(runtime.UsageError):
            wrong()
        assert session.log == log
    with pytest.raises(runtime.UsageError, match="'push': expected a number for a Scalar, got"):
        session.write("push", "1")
    with pytest.raises(runtime.UsageError, match="without: expected the name of a block, as in"):
        session.without()
    (tmp_path / "over.yaml").write_text("blocks: {gain: {gain: 7.0}}")
    session.step(np.int64(5))
    session.overlay(tmp_path / "over.yaml")
    session.set("noise.density", np.array(0.25))
    session.step(5)
    session.save(tmp_path / "a")
    (tmp_path / "over.yaml").unlink()
    assert same(open_session(tmp_path / "a").result(), session.result()) == []
