"""Trials whose process was killed, wherever, go on to the results of one that was not."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.experiments.execution.trials import Configuration, GraphBundle, Trial
from runtime.experiments.execution.worker import Task, TrialResult, run_task
from runtime.graph import RepeatedRuns
from tests.compilers import skip_without_compiler
from tests.conftest import Run
from tests.runtime.experiments.test_repeating import ENGINES, SWEPT, bits
from tests.runtime.experiments.test_sweep import rows

VALUES: dict[str, Any] = {"drag.gain": 0.7}
ALWAYS, NEVER = 1e-9, 3600.0  # s between two checkpoints: one after each call of the engine, none


def swept(engine: str, until: float) -> runtime.Graph:
    if engine == "compiled":
        skip_without_compiler()
    return runtime.load(SWEPT).set("run.engine", engine).set("run.until", until)


def killed(graph: runtime.Graph, place: Path, every: float, calls: int) -> bool:
    """Begin the trial in a process that is killed after so many calls; whether it was in time."""

    def progress(done: int, total: int) -> None:
        nonlocal calls
        calls -= 1
        if calls == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    child = os.fork()
    if not child:
        code = 1
        try:
            RepeatedRuns(graph).run_with_checkpoints(VALUES, 3, (place, every), progress)
            code = 0
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status) or status == 0
    return os.WIFSIGNALED(status)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the process is killed in a fork of this one")
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "kills",
    [
        [(ALWAYS, 2)],
        [(NEVER, 2)],
        # Before the first checkpoint of an attempt that went on, and twice in a row.
        [(ALWAYS, 2), (NEVER, 1), (NEVER, 1), (ALWAYS, 1)],
        pytest.param([(ALWAYS, 1)] * 12, marks=pytest.mark.slow),
        *(
            pytest.param(
                [(random.Random(k + j).choice((ALWAYS, NEVER)), 1 + (k + j) % 4) for j in range(9)],
                marks=pytest.mark.slow,
            )
            for k in range(8)
        ),
    ],
)
def test_a_killed_trial_goes_on(
    engine: str, kills: Sequence[tuple[float, int]], tmp_path: Path
) -> None:
    graph = swept(engine, 2.0)
    whole = bits(graph, RepeatedRuns(graph).run(VALUES, 3))
    place = tmp_path / "checkpoints" / "a"
    in_time = [killed(graph, place, every, calls) for every, calls in kills]
    assert in_time[0]
    runs = RepeatedRuns(graph)
    went_on = in_time[-1] and any(every == ALWAYS for every, _ in kills)
    result = runs.run_with_checkpoints(VALUES, 3, (place, ALWAYS))
    assert bits(graph, result) == whole
    assert any("went on at tick" in note for note in result.notes) == went_on
    assert not place.exists()
    # The next trial of this process has its own state.
    assert bits(graph, runs.run(VALUES, 3)) == whole


@pytest.mark.parametrize("engine", ENGINES)
def test_trials_with_checkpoints_have_the_bits_of_others(engine: str, tmp_path: Path) -> None:
    graph = swept(engine, 0.3)
    runs = RepeatedRuns(graph)
    for gain, seed, every in ((0.5, 1, NEVER), (0.7, 1, ALWAYS), (0.7, 2, NEVER), (0.5, 1, ALWAYS)):
        values = {"drag.gain": gain}
        result = runs.run_with_checkpoints(values, seed, (tmp_path / "a", every), whole=False)
        assert bits(graph, result) == bits(graph, RepeatedRuns(graph).run(values, seed))
        assert bits(graph, runs.run(values, seed)) == bits(graph, result)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the process is killed in a fork of this one")
def test_a_damaged_checkpoint_begins_anew_and_says_so(tmp_path: Path) -> None:
    graph = swept("python", 1.0)
    whole = bits(graph, RepeatedRuns(graph).run(VALUES, 3))
    assert killed(graph, tmp_path / "a", ALWAYS, 1)
    (path,) = (tmp_path / "a").glob("*/recording/checkpoint.npz")
    path.write_bytes(path.read_bytes()[:-200])
    result = RepeatedRuns(graph).run_with_checkpoints(VALUES, 3, (tmp_path / "a", NEVER))
    assert bits(graph, result) == whole
    assert any("began anew, since '" in note for note in result.notes)


def outcome(number: int, gain: float, checkpoints: tuple[Path, float] | None) -> TrialResult:
    bundle = GraphBundle.of(swept("python", 0.2))
    configuration = Configuration(number, (), bundle, (("drag.gain", str(gain)),))
    return run_task(Task(Trial(number, configuration, 1), "all", ("ok",), checkpoints=checkpoints))


def test_trials_with_and_without_checkpoints_are_equal(tmp_path: Path) -> None:
    """Also one after the other in the same process, where the second uses the engine again."""
    for number, gain in enumerate((0.5, 0.7, 0.5)):
        plain, stored = outcome(number, gain, None), outcome(number, gain, (tmp_path, ALWAYS))
        assert plain.status == stored.status == "ok"
        assert (plain.metrics, plain.signals) == (stored.metrics, stored.signals)
        assert plain.result is not None and stored.result is not None
        for name, recording in plain.result.probes.items():
            np.testing.assert_array_equal(stored.result.probes[name].values, recording.values)
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_is_refused(here: Run, tmp_path: Path) -> None:
    (tmp_path / "swept.yaml").write_text(runtime.load(SWEPT).to_yaml())
    vary = ("sweep", "swept.yaml", "--vary", "drag.gain=[0.5]", "--checkpoint", "10s")
    kept = here(*vary, "--set", "run.keep=0.1")
    assert kept.returncode == 2 and "run.keep: trials with --checkpoint have all" in kept.stderr
    far = here(*vary, "--scheduler", "tcp://localhost:1")
    assert far.returncode == 2 and "workers of a cluster need not see" in far.stderr
    assert not (tmp_path / "sweeps").exists()


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["sweep", "ablate", "tune"])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_killed_experiment_goes_on(
    verb: str, engine: str, script: Path, here: Run, tmp_path: Path
) -> None:
    if verb == "tune":
        pytest.importorskip("optuna")
    graph = swept(engine, 12.0 if engine == "python" else 400.0)
    (tmp_path / "swept.yaml").write_text(graph.to_yaml())
    plan: dict[str, tuple[str, ...]] = {
        "sweep": ("--vary", "drag.gain=0.5..1:2", "--keep", "all"),
        "ablate": ("--variant", "one", "--set", "drag.gain=1", "--seeds", "0..1"),
        "tune": ("--vary", "drag.gain=0.5..1", "--trials", "2", "--seeds", "0", "--held-out", "1"),
    }
    command = [verb, "swept.yaml", *plan[verb], "-j", "1", "-q"]
    command += [] if verb == "tune" else ["--no-plots"]
    begin = time.monotonic()
    assert here(*command, "--name", "whole").returncode == 0
    duration = time.monotonic() - begin  # how fast this machine is, so that most kills are in time
    command += ["--name", "cut", "--checkpoint", "5ms", "--resume"]
    moments, kills = random.Random(f"{verb} {engine}"), 0
    for _ in range(6):
        process = subprocess.Popen([script, *command], cwd=tmp_path, stdout=subprocess.DEVNULL)
        try:
            process.wait(timeout=moments.uniform(0.3, 0.6) * duration + 0.4)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
            kills += 1
    assert kills
    assert here(*command).returncode == 0
    (folder,) = tmp_path.glob("*/cut")
    assert not (folder / "checkpoints").exists()
    for index in folder.glob("*.csv"):
        if index.name.startswith(("index", "held")):
            whole = folder.parent / "whole" / index.name
            assert index.read_text().count("\n") == whole.read_text().count("\n")
    assert rows(folder) == rows(folder.parent / "whole")
