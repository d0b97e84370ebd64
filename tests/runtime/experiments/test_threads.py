"""Many trials at once on the threads of one process, as under ``dask worker``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

import blocks
import runtime
from runtime.experiments.execution import worker
from runtime.experiments.execution.trials import Configuration, GraphBundle, Trial
from runtime.experiments.execution.worker import Task, TrialResult, run_task
from tests.compilers import skip_without_compiler

THREADS = 8
OWN = '''
import numpy as np

import blocks


class Mixed(blocks.Block):
    """Both components of what it remembers, each with a share of the input."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Vector(2))
    m = blocks.State(2)

    share: float = blocks.param(0.5, doc="share of the input")

    def output(self, state, t):
        return state.m

    def update(self, state, t, x):
        for i in range(2):
            state.m[i] += self.share * (x - state.m[1 - i])
'''


@pytest.fixture
def restless() -> Iterator[None]:
    """Threads take turns every few bytecodes."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


def tasks(folder: Path, engine: str) -> list[Task]:
    """Trials of two graphs, learning and with a user block, in several configurations."""
    module = folder / "own.py"
    module.write_text(OWN)
    learning = runtime.load("line_actuator_failure").set("run.until", 0.05)
    own = runtime.Graph("own", dt=0.01, until=0.3)
    own = own.add("motion", blocks.Constant(value=[0.3, 0.2], signal="Twist"))
    own = own.add("robot", blocks.DifferentialDrive()).connect("motion.value", "robot.command")
    own = own.add("noise", blocks.PoseNoise()).connect("robot.pose", "noise.pose")
    own = own.overlay({"blocks": {"mixed": {"type": "Mixed", "module": str(module)}}})
    own = own.wire("mixed.x", "noise.measured.x").metric("spread", "rms", "mixed.out.0")
    graphs = [(own, "blocks.mixed.share", (0.1, 0.2, 0.3))]
    if engine == "python":
        graphs.append((learning, "params.v_r", (0.8, 0.9, 1.0)))
    made = []
    if engine == "compiled":
        skip_without_compiler()
    for graph, path, values in graphs:
        bundle = GraphBundle.of(graph.set("run.engine", engine))
        for value in values:
            configuration = Configuration(0, (), bundle, ((path, str(value)),))
            made += [
                Task(Trial(len(made), configuration, seed), record="all", keep=("ok",))
                for seed in range(8)
            ]
    return made


def forget() -> None:
    """Have graphs and modules read again, by all threads at once."""
    worker._load.cache_clear()
    worker._idle.clear()
    for name in [name for name in sys.modules if name.startswith("_blocks_of_")]:
        del sys.modules[name]


def bits(done: TrialResult) -> object:
    assert done.status == "ok", done.reason
    assert done.result is not None
    probes = {name: probe.values.tobytes() for name, probe in done.result.probes.items()}
    return done.metrics, probes


@pytest.mark.parametrize("engine", [pytest.param("python", marks=pytest.mark.slow), "compiled"])
@pytest.mark.slow
def test_trials_on_many_threads_equal_trials_one_by_one_bit_for_bit(
    restless: None, tmp_path: Path, engine: str
) -> None:
    trials = tasks(tmp_path, engine)
    expected = [bits(run_task(task)) for task in trials]
    assert len({repr(found) for found in expected}) == len(trials)
    for _ in range(3):
        forget()
        with ThreadPoolExecutor(THREADS) as pool:
            found = list(pool.map(run_task, trials))
        assert [bits(done) for done in found] == expected


STUCK = """
import blocks

class Stuck(blocks.Block):
    \"\"\"Does not return.\"\"\"
    out = blocks.Output(blocks.Scalar)
    level: float = blocks.param(0.0, doc="above 0 it does not return")

    def output(self, state, t):
        while self.level > 0.0:
            pass
        return t
"""


def test_a_block_that_does_not_return_is_a_time_out_and_frees_its_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "GRACE", 0.0)
    (tmp_path / "own.py").write_text(STUCK)
    block = {"type": "Stuck", "module": str(tmp_path / "own.py")}
    graph = runtime.Graph("stuck", dt=0.1, until=0.2).overlay({"blocks": {"stuck": block}})
    bundle = GraphBundle.of(graph.metric("last", "final", "stuck.out").set("run.engine", "python"))
    trials = [
        Trial(i, Configuration(i, (), bundle, (("blocks.stuck.level", str(level)),)), 0)
        for i, level in enumerate((1.0, 0.0))
    ]
    with ThreadPoolExecutor(1) as pool:
        stuck, fine = pool.map(run_task, [Task(trials[0], timeout=0.1), Task(trials[1])])
    assert stuck.status == "timeout"
    assert stuck.reason.startswith("stopped after 0.1 s")
    assert (fine.status, fine.metrics) == ("ok", {"last": 0.1})


@pytest.mark.slow
def test_threads_that_share_a_checked_graph_write_its_plan_without_each_other(
    restless: None,
) -> None:
    """All begin at once, and none has written the plan yet."""
    graph = runtime.load("line_actuator_failure").set("run.until", 0.005)
    expected = [graph.run(seed=seed, engine="python") for seed in range(THREADS)]
    for _ in range(20):
        shared, barrier = graph.set("run.engine", "python").check(), Barrier(THREADS)

        def run(
            seed: int, shared: runtime.Graph = shared, barrier: Barrier = barrier
        ) -> runtime.Result:
            barrier.wait()
            result: runtime.Result = shared.with_seed(seed).run()
            return result

        with ThreadPoolExecutor(THREADS) as pool:
            found = list(pool.map(run, range(THREADS)))
        for one, other in zip(found, expected, strict=True):
            assert one.probes.keys() == other.probes.keys()
            for name, probe in other.probes.items():
                assert one.probes[name].values.tobytes() == probe.values.tobytes()
