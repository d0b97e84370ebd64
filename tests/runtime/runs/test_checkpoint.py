"""Checkpoints: a run that was killed, wherever, goes on to the bits of one that was not."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
import runtime
from runtime.engine import Engine, adopt
from runtime.graph import resumable
from runtime.runs import Checkpoints, chosen_runner
from runtime.runs.checkpoint import content, read_checkpoint
from runtime.runs.fingerprint import Program
from tests.conftest import Run
from tests.examples import examples
from tests.runtime.sessions.test_session import ENGINES, FOLDER, NAMES, QUICK, SERVO

TICKS = 50


def begun(graph: runtime.Graph, ticks: int) -> Engine:
    engine = Engine(graph.program(growing=True), graph.network.seed, chosen_runner(graph.network))
    engine.prepare()
    engine.advance(ticks)
    return engine


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in NAMES]
)
def test_a_fresh_engine_goes_on_from_the_file(name: str, engine: str, tmp_path: Path) -> None:
    graph = runtime.load(FOLDER / f"{name}.yaml").set("run.engine", engine)
    graph = graph.set("run.until", TICKS * graph.network.dt)
    try:
        whole = begun(graph, TICKS).finish()
    except runtime.MissingExtraError as error:
        pytest.skip(str(error))
    half = begun(graph, TICKS // 2)
    (tmp_path / "c.npz").write_bytes(content(half))
    given, _ = read_checkpoint(tmp_path / "c.npz", half.finish().arrays)
    other = begun(graph, 0)
    adopt(other, given)
    other.advance(TICKS)
    found = other.finish()
    assert found.ticks == whole.ticks
    for probe, rows in whole.arrays.items():
        np.testing.assert_array_equal(found.arrays[probe], rows, probe)


def started(script: Path, folder: Path, engine: str) -> subprocess.Popen[bytes]:
    """The servo, running with checkpoints, from the moment at which its first one is there."""
    command = [script, "run", "servo.yaml", "-q", "--no-plots", "--checkpoint", "2ms"]
    process = subprocess.Popen([*command, "--engine", engine], cwd=folder)
    while process.poll() is None and not unfinished(folder, "recording/checkpoint.npz"):
        time.sleep(0.002)  # not for a moment that matters: the kill may come at any
    return process


def unfinished(folder: Path, file: str = "") -> list[Path]:
    """The hidden folders of runs that are not complete, with that file in them."""
    runs = folder / "runs" / "servo"
    complete = {each.name for each in runs.glob("[!.]*")}
    hidden = [path for path in runs.glob(".*") if (path / file).exists()]
    return [path for path in hidden if path.name[1:].rpartition("-")[0] not in complete]


def killed(process: subprocess.Popen[bytes], folder: Path, moment: float) -> bool:
    """Kill the run after ``moment`` seconds; returns whether that left it unfinished.

    A process may be killed when its run is complete: between the renaming of the folder and its
    own end. Such a kill tells nothing.
    """
    try:
        process.wait(timeout=moment)
    except subprocess.TimeoutExpired:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    return bool(unfinished(folder))


@pytest.mark.parametrize(
    ("engine", "kills"),
    [("compiled", 1), *(pytest.param(e, 25, marks=pytest.mark.slow) for e in ENGINES)],
)
def test_a_killed_run_goes_on(
    engine: str, kills: int, script: Path, cli: Run, tmp_path: Path
) -> None:
    until = 4.0 if engine == "python" else 60.0
    document = {**SERVO, "run": {"dt": 0.001, "until": until, "seed": 4}}
    (tmp_path / "servo.yaml").write_text(runtime.load(document).to_yaml())
    whole = runtime.load(tmp_path / "servo.yaml").run(engine=engine)
    undisturbed = started(script, tmp_path, engine)
    begin = time.monotonic()
    while unfinished(tmp_path) and undisturbed.poll() is None:
        time.sleep(0.002)
    duration = time.monotonic() - begin  # how fast this machine is, so that most kills are in time
    assert undisturbed.wait() == 0
    moments, count = random.Random(kills), 0
    for _ in range(3 * kills):
        if count == kills:
            break
        process = started(script, tmp_path, engine)
        if not killed(process, tmp_path, moments.uniform(0.0, 0.8 * duration)):
            continue
        count += 1
        done = cli("resume", "runs/servo", "--no-plots", "-q")
        assert done.returncode == 0, done.stderr
        run = runtime.open(tmp_path / "runs" / "servo" / "latest")
        assert any("went on at tick" in note for note in run.notes)
        for name in whole.probes:
            np.testing.assert_array_equal(run[name], whole[name], name)
        assert run.metrics == whole.metrics
    assert count == kills


def test_a_complete_run_goes_on_for_longer(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "servo.yaml").write_text(runtime.load(SERVO).to_yaml())
    assert cli("run", "servo.yaml", "--checkpoint", "1h", "--no-plots", "-q").returncode == 0
    done = cli("resume", "runs/servo/latest", "--no-plots")
    assert done.returncode == 2 and "is complete up to 0.1 s; --until is how" in done.stderr
    assert cli("resume", "runs/servo", "--until", "0.25", "--no-plots", "-q").returncode == 0
    run = runtime.open(tmp_path / "runs" / "servo" / "latest")
    whole = runtime.load(SERVO).run(until=0.25)
    for name in whole.probes:
        np.testing.assert_array_equal(run[name], whole[name], name)


def test_a_run_goes_on_where_it_was_written(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "servo.yaml").write_text(runtime.load(SERVO).to_yaml())
    begin = ["run", "servo.yaml", "--checkpoint", "1h", "--no-plots", "-q", "--out", "made/here"]
    assert cli(*begin).returncode == 0
    for place, until in (("made/here/servo", 0.25), ("made/here/servo/latest", 0.3)):
        assert cli("resume", place, "--until", f"{until}", "--no-plots", "-q").returncode == 0
        assert runtime.open(tmp_path / "made/here/servo/latest").manifest["until"] == until
    done = cli("resume", "made/here/servo", "--until", "0.4", "--out", "else", "--no-plots", "-q")
    assert done.returncode == 0 and (tmp_path / "else" / "servo" / "latest").exists()
    assert not (tmp_path / "runs").exists()
    (tmp_path / "made/here/servo/latest").resolve().rename(tmp_path / "mine")
    assert cli("resume", "mine", "--until", "0.5", "--no-plots", "-q").returncode == 0
    assert runtime.open(tmp_path / "servo" / "latest").manifest["until"] == 0.5


def test_the_time_of_a_tick_is_that_of_all_ticks(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """On a clock on which a start takes 100 s and a call of the progress bar 1 s; all else none."""
    clock = [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])
    prepare = Engine.prepare

    def slow(engine: Engine) -> Any:
        clock[0] += 100.0
        return prepare(engine)

    monkeypatch.setattr(Engine, "prepare", slow)

    def tick(done: int, total: int) -> None:
        clock[0] += 1.0

    source = None
    for until in (0.1, 0.3):
        graph = runtime.load({**SERVO, "run": {"dt": 0.001, "until": until}}).check()
        engine = Engine(graph.program(growing=True), 0)
        after = Checkpoints(tmp_path, 0.0, source).begin(engine, tick)
        engine.advance(graph.network.ticks // 2, after)
        engine.advance(graph.network.ticks, after)
        outcome = engine.finish()
        assert outcome.ready_s == 100.0
        assert outcome.wall_s - outcome.ready_s == clock[0] % 100.0
        source = tmp_path / "checkpoint.npz", outcome.arrays
        source[0].write_bytes(content(engine))


def test_a_run_without_a_checkpoint_says_what_to_do(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "servo.yaml").write_text(runtime.load(SERVO).to_yaml())
    assert cli("run", "servo.yaml", "--no-plots", "-q").returncode == 0
    done = cli("resume", "runs/servo", "--until", "1")
    assert done.returncode == 2 and "has no checkpoint; a run with --checkpoint 60s" in done.stderr


@cache
def servo_checkpoint() -> tuple[bytes, dict[str, Any]]:
    engine = begun(runtime.load(SERVO), 20)
    return content(engine), engine.finish().arrays


@given(share=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(0, 255))
@examples(40)
def test_a_damaged_checkpoint_is_refused(
    tmp_path_factory: pytest.TempPathFactory, share: float, flip: int
) -> None:
    """Cut off, or with any byte changed, it is refused; nothing but our error comes out of it."""
    whole, rows = servo_checkpoint()
    at = int(share * len(whole))
    rest = bytes([whole[at] ^ flip]) + whole[at + 1 :] if flip else b""
    path = tmp_path_factory.mktemp("damaged") / "checkpoint.npz"
    path.write_bytes(whole[:at] + rest)
    try:
        given, _ = read_checkpoint(path, rows)
    except runtime.UsageError:
        return
    # A byte of the archive that says nothing about the numbers, such as a date.
    path.write_bytes(whole)
    same, _ = read_checkpoint(path, rows)
    assert {k: v.tobytes() for k, v in given.arrays.items()} == {
        k: v.tobytes() for k, v in same.arrays.items()
    }


def test_a_checkpoint_of_another_graph_is_refused(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "servo.yaml").write_text(runtime.load(SERVO).to_yaml())
    assert cli("run", "servo.yaml", "--checkpoint", "1h", "--no-plots", "-q").returncode == 0
    folder = (tmp_path / "runs" / "servo" / "latest").resolve()
    written = folder / "graph.resolved.yaml"
    whole = written.read_text()
    for old, new in (
        ("neurons: 20", "neurons: 21"),
        ("gain: 2.0", "gain: 2.5"),
        ("seed: 4", "seed: 5"),
    ):
        assert old in whole
        written.write_text(whole.replace(old, new))
        done = cli("resume", str(folder), "--until", "0.2", "--no-plots", "-q")
        assert done.returncode == 2 and "is not the graph that ran" in done.stderr
    written.write_text(whole)
    assert resumable(folder, 0.2).source[0].name == "checkpoint.npz"
    with pytest.raises(runtime.UsageError, match="is complete up to 0.05 s"):
        resumable(folder, 0.05)


def test_a_checkpoint_of_another_program_is_refused(
    cli: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "servo.yaml").write_text(runtime.load(SERVO).to_yaml())
    assert cli("run", "servo.yaml", "--checkpoint", "1h", "--no-plots", "-q").returncode == 0
    folder = (tmp_path / "runs" / "servo" / "latest").resolve()
    other = Program("0.1.0", "0123456789ab")
    monkeypatch.setattr("runtime.graph.replaying.program_of", lambda *networks: other)
    with pytest.raises(runtime.UsageError, match=r"by another program.*this is '.*0123456789ab"):
        resumable(folder, 0.2)
    assert resumable(folder, 0.2, mixed=True).source[0].name == "checkpoint.npz"


def test_what_no_file_can_hold_is_named() -> None:
    class Listing(blocks.Block):
        """Keeps a list that grows."""

        out = blocks.Output(blocks.Scalar)

        def start(self, state: Any) -> None:
            state.seen = []
            state.fixed = [1, 2]

        def output(self, state: Any, t: float) -> float:
            return float(len(state.seen))

        def update(self, state: Any, t: float) -> None:
            state.seen.append(t)

    graph = runtime.Graph("listing", dt=0.01, until=0.1).add("keeps", Listing())
    engine = begun(graph, 5)
    with pytest.raises(runtime.UsageError, match=r"block 'keeps' keeps state.seen \(list\)"):
        content(engine)
