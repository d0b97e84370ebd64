"""The same trials on a Dask cluster: a real scheduler and two workers on loopback."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from blocks.core import pip_line
from runtime.experiments.design import Seeds
from runtime.experiments.execution import Configuration, Task, run_trials
from runtime.experiments.execution.trials import GraphBundle, trials_of
from runtime.experiments.execution.worker_pool import cluster_pool
from runtime.graph import load
from tests.conftest import Run
from tests.runtime.experiments.test_survival import LATER, POINTS, SWEEP, lines
from tests.runtime.experiments.test_sweep import rows

needs_dask = pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None, reason="needs pip install -e '.[cluster]'"
)
Start = Callable[..., "subprocess.Popen[bytes]"]
Cluster = tuple[str, list["subprocess.Popen[bytes]"]]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts processes that end with the test."""
    with ExitStack() as stack:

        def started(*arguments: str) -> subprocess.Popen[bytes]:
            command = [sys.executable, "-m", *arguments]
            quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            process = subprocess.Popen(command, cwd=tmp_path, **quiet)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        yield started


@pytest.fixture
def cluster(start: Start, tmp_path: Path) -> Cluster:
    """A scheduler with two workers: its address, and the three processes."""
    found = tmp_path / "scheduler.json"
    options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    scheduler = start("distributed.cli.dask_scheduler", *options, "--scheduler-file", str(found))
    while not found.exists() or not found.read_text().endswith("}"):
        assert scheduler.poll() is None
    address = json.loads(found.read_text())["address"]
    options = ("--host", "127.0.0.1", "--no-nanny", "--nthreads", "1", "--no-dashboard")
    workers = [start("distributed.cli.dask_worker", address, *options) for _ in range(2)]

    return address, [scheduler, *workers]


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
        pool = cluster_pool(local.scheduler_address)
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
    monkeypatch.setattr("runtime.experiments.execution.worker_pool.CONNECT_TIMEOUT", 0.2)
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
