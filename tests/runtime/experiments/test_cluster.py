"""The same trials on a Dask cluster: a real scheduler and two workers on loopback."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from blocks.core import pip_line
from runtime.experiments.design import Seeds
from runtime.experiments.execution import Configuration, Task, run_trials
from runtime.experiments.execution.cluster import ClusterPool
from runtime.experiments.execution.trials import GraphBundle, trials_of
from runtime.graph import load
from runtime.runs import program
from tests.conftest import Run
from tests.runtime.experiments.test_survival import LATER, POINTS, SWEEP, lines
from tests.runtime.experiments.test_sweep import rows

needs_dask = pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None, reason="needs pip install -e '.[cluster]'"
)
Start = Callable[..., "subprocess.Popen[bytes]"]
Cluster = tuple[str, list["subprocess.Popen[bytes]"]]
Scheduler = tuple[str, "subprocess.Popen[bytes]"]
ROOT = Path(__file__).parents[3]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts processes that end with the test."""
    with ExitStack() as stack:

        def started(*arguments: str, path: Path | None = None) -> subprocess.Popen[bytes]:
            command = [sys.executable, "-m", *arguments]
            quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            environment = os.environ if path is None else {**os.environ, "PYTHONPATH": str(path)}
            process = subprocess.Popen(command, cwd=path or tmp_path, env=environment, **quiet)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        yield started


@pytest.fixture
def scheduler(start: Start, tmp_path: Path) -> tuple[str, subprocess.Popen[bytes]]:
    """A scheduler without workers: its address, and the process."""
    found = tmp_path / "scheduler.json"
    options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    process = start("distributed.cli.dask_scheduler", *options, "--scheduler-file", str(found))
    while not found.exists() or not found.read_text().endswith("}"):
        assert process.poll() is None
    return json.loads(found.read_text())["address"], process


def worker(start: Start, address: str, path: Path | None = None) -> subprocess.Popen[bytes]:
    """A worker; it imports what is in the folder ``path`` first."""
    options = ("--host", "127.0.0.1", "--no-nanny", "--nthreads", "1", "--no-dashboard")
    return start("distributed.cli.dask_worker", address, *options, path=path)


@pytest.fixture
def cluster(start: Start, scheduler: Scheduler) -> Cluster:
    """A scheduler with two workers: its address, and the three processes."""
    address, process = scheduler
    return address, [process, *(worker(start, address) for _ in range(2))]


def wait_for_workers(address: str, number: int) -> None:
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(number, timeout=60)


@needs_dask
@pytest.mark.slow
def test_a_cluster_of_two_programs_is_refused_with_both_names(
    start: Start, scheduler: Scheduler, here: Run, draw: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other"
    for name in ("blocks", "runtime", "graphs"):
        shutil.copytree(ROOT / name, other / name, ignore=shutil.ignore_patterns("__pycache__"))
    source = other / "blocks" / "generic" / "__init__.py"
    source.write_text(source.read_text() + "\nCHANGED = True\n")
    address, _ = scheduler
    worker(start, address, other)
    wait_for_workers(address, 1)
    sweep = ("sweep", "draw.yaml", *SWEEP, "--no-plots", "--scheduler", address)
    done = here(*sweep)
    assert done.returncode == 2, done.stderr
    assert re.search(
        r"worker tcp://127\.0\.0\.1:\d+ has another program, 'spikeblocks", done.stderr
    )
    assert f"this is '{program()}'" in done.stderr
    done = here(*sweep, "--resume", "--mixed")
    assert done.returncode == 0, done.stderr
    assert len(rows(tmp_path / "sweeps" / "draw")) == POINTS


@needs_dask
@pytest.mark.slow
def test_a_worker_without_the_package_is_left_out(
    start: Start, scheduler: Scheduler, here: Run, draw: Path, tmp_path: Path
) -> None:
    without = tmp_path / "without"
    without.mkdir()
    (without / "runtime.py").write_text("raise ModuleNotFoundError(\"No module named 'runtime'\")")
    address, _ = scheduler
    worker(start, address, without)
    wait_for_workers(address, 1)
    sweep = ("sweep", "draw.yaml", *SWEEP, "--no-plots", "--scheduler", address)
    done = here(*sweep)
    assert done.returncode == 2
    assert "no worker can run trials: tcp://127.0.0.1" in done.stderr
    assert "No module named 'runtime'" in done.stderr
    worker(start, address)
    wait_for_workers(address, 2)
    done = here(*sweep, "--resume")
    assert done.returncode == 0, done.stderr
    assert "is left out: ModuleNotFoundError" in done.stderr
    assert len(rows(tmp_path / "sweeps" / "draw")) == POINTS


@needs_dask
@pytest.mark.slow
def test_trials_go_to_the_worker_that_has_what_a_block_imports(
    start: Start,
    scheduler: Scheduler,
    here: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    has = tmp_path / "has"
    has.mkdir()
    (has / "only_here.py").write_text("VALUE = 2.0\n")
    (tmp_path / "own.py").write_text(
        "import only_here\n"
        "from blocks import Block, Output, Scalar\n"
        "class Mine(Block):\n"
        '    """A number of another module."""\n'
        "    out = Output(Scalar)\n"
        "    def output(self, state, t):\n"
        "        return only_here.VALUE\n"
    )
    (tmp_path / "g.yaml").write_text(
        "graph: g\nrun: {dt: 0.1, until: 0.5}\nblocks:\n  a: {type: Mine, module: own.py}\n"
        "  k: {type: Gain, gain: 1.0}\nwires: {k: {input: a.out}}\n"
        "probes: {y: k.out}\nmetrics: {m: {kind: mean, of: y}}\n"
    )
    monkeypatch.syspath_prepend(str(has))
    address, _ = scheduler
    worker(start, address)
    wait_for_workers(address, 1)
    sweep = ("sweep", "g.yaml", "--vary", "k.gain=0..1:20", "--no-plots", "--scheduler", address)
    done = here(*sweep)
    assert done.returncode == 2, done.stdout
    assert "No module named 'only_here'" in done.stderr
    worker(start, address, has)
    wait_for_workers(address, 2)
    done = here(*sweep, "--resume")
    assert done.returncode == 0, done.stderr
    found = rows(tmp_path / "sweeps" / "g")
    assert len(found) == 20
    lines = (tmp_path / "sweeps/g/starts.jsonl").read_text().splitlines()
    record = json.loads(lines[-1])["workers"]
    assert [each["trials"] for each in record if each["unfit"]] == [0]
    assert sum(each["trials"] for each in record) == 20


@needs_dask
@pytest.mark.slow
def test_a_cluster_without_workers_is_waited_for_with_a_word_and_not_for_ever(
    scheduler: Scheduler, here: Run, draw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.experiments.execution.cluster.LONGEST_WAIT", 6.0)
    address, _ = scheduler
    done = here("sweep", "draw.yaml", *SWEEP, "--no-plots", "--scheduler", address)
    assert done.returncode == 2
    assert f"waiting: no worker at {address}" in done.stderr
    assert "no worker for 6 s; start workers, and --resume continues" in done.stderr


@needs_dask
@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_same_index(
    script: Path, here: Run, cluster: Cluster, draw: Path, tmp_path: Path
) -> None:
    local = here("sweep", "--no-plots", "draw.yaml", *SWEEP, *LATER, "--name", "local")
    assert local.returncode == 0, local.stderr

    address, processes = cluster
    index = tmp_path / "sweeps" / "draw" / "index.csv"
    command = [script, "sweep", "draw.yaml", *SWEEP, *LATER, "--scheduler", address]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE) as sweep:
        while lines(index) < 8:
            assert sweep.poll() is None
        processes[1].kill()
        assert lines(index) < POINTS
        message = sweep.communicate()[1].decode()
    assert sweep.returncode == 0, message
    assert rows(index.parent) == rows(tmp_path / "sweeps" / "local")


@needs_dask
@pytest.mark.slow
def test_an_ablation_on_a_cluster_that_loses_a_worker_gives_the_same_index(
    script: Path, here: Run, cluster: Cluster, draw: Path, tmp_path: Path
) -> None:
    removed = ("--without", "half", "--bypass", "half", "--bypass", "twice", "--seeds", "0..11")
    ablate = ("ablate", "draw.yaml", "--set", "draw.how=brief", *removed, "--no-plots", "-q")
    done = here(*ablate, "-j", "2", "--name", "local")
    assert done.returncode == 0, done.stderr
    local, dask = (tmp_path / "ablations" / name for name in ("local", "dask"))

    address, processes = cluster
    with subprocess.Popen(
        [script, *ablate, "--scheduler", address, "--name", "dask"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
    ) as ablation:
        while not dask.exists():
            assert ablation.poll() is None
        while lines(dask / "index.csv") < 8:
            assert ablation.poll() is None
        processes[1].kill()
        assert lines(dask / "index.csv") < 48
        message = ablation.communicate()[1].decode()
    assert ablation.returncode == 0, message
    assert len(rows(dask)) == 48
    assert rows(dask) == rows(local)
    table, ours = (json.loads((at / "ablation.json").read_text()) for at in (dask, local))
    assert table["table"] == ours["table"]


@needs_dask
@pytest.mark.slow
def test_a_tuning_on_a_cluster_tries_the_same_configurations(
    here: Run, cluster: Cluster, draw: Path, tmp_path: Path
) -> None:
    pytest.importorskip("optuna")
    tune = ("tune", "draw.yaml", "--vary", "draw.level=0..10", "--seeds", "0..1", "--trials", "8")
    quiet = ("--held-out", "10..11", "--no-plots", "-q")
    for place in (("-j", "1", "--name", "local"), ("--scheduler", cluster[0], "--name", "dask")):
        done = here(*tune, *quiet, *place)
        assert done.returncode == 0, done.stderr
    for name in ("index.csv", "held_out.csv"):
        local, dask = (
            sorted(
                line.rpartition(",")[0]
                for line in (tmp_path / "tunings" / folder / name).read_text().splitlines()
            )
            for folder in ("local", "dask")
        )
        assert local == dask


def resident(dask_worker: object = None) -> int:
    """The memory of this process (bytes)."""
    import psutil

    return int(psutil.Process().memory_info().rss)


TRIALS = 100_000
NOISE = {
    "run": {"dt": 0.01, "until": 0.05},
    "blocks": {"noise": {"type": "WhiteNoise", "density": 1.0}},
    "probes": {"y": "noise.out"},
    "metrics": {"m": {"kind": "mean", "of": "y"}},
}


@needs_dask
@pytest.mark.slow
def test_a_hundred_thousand_short_trials_need_no_more_memory_than_the_first() -> None:
    """Calls of one trial each would keep 1.2 kB of it: Dask's own bounded logs of calls."""
    from distributed import Client, LocalCluster

    bundle = GraphBundle.of(load(NOISE))
    trials = trials_of([Configuration(0, (), bundle)], Seeds(((0, TRIALS - 1),)))
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local:
        pool = ClusterPool(local.scheduler_address, program())
        done, means, used = 0, set(), []
        with Client(local.scheduler_address, set_as_default=False) as client:
            for _, result in run_trials(trials, pool, Task):
                assert result.status == "ok", result.reason
                means.add(result.metrics["m"])
                done += 1
                if done in (TRIALS // 4, TRIALS):
                    used.append([resident(), *client.run(resident).values()])
        pool.leave(True)
    assert (done, len(means)) == (TRIALS, TRIALS)
    here, *workers = (last - first for first, last in zip(*used, strict=True))
    assert max(workers) / TRIALS < 200
    # This process has the scheduler, too, and the means above.
    assert here / TRIALS < 600


@needs_dask
@pytest.mark.slow
def test_a_lost_scheduler_ends_the_sweep_with_its_rows_kept(
    script: Path, here: Run, cluster: Cluster, draw: Path, tmp_path: Path
) -> None:
    address, processes = cluster
    index = tmp_path / "sweeps" / "draw" / "index.csv"
    slow = ("sweep", "draw.yaml", *SWEEP, *LATER)
    command = [script, *slow, "--scheduler", address]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE) as sweep:
        while lines(index) < 4:
            assert sweep.poll() is None
        processes[0].kill()
        message = sweep.communicate(timeout=60)[1].decode()
    assert sweep.returncode == 2, message
    assert f"--scheduler {address}: the scheduler no longer answers" in message
    assert "Traceback" not in message
    assert here(*slow).returncode == 0
    assert len(rows(index.parent)) == POINTS


@needs_dask
def test_a_missing_scheduler_is_reported(
    here: Run, draw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.experiments.execution.cluster.CONNECT_TIMEOUT", 0.2)
    done = here("sweep", "draw.yaml", *SWEEP, *LATER, "--scheduler", "tcp://127.0.0.1:9")
    assert done.returncode == 2
    assert "--scheduler tcp://127.0.0.1:9: no scheduler answers there" in done.stderr


def test_a_missing_extra_is_reported(
    here: Run, draw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    done = here("sweep", "draw.yaml", *SWEEP, *LATER, "--scheduler", "tcp://127.0.0.1:9")
    assert done.returncode == 4
    assert pip_line("cluster") in done.stderr
