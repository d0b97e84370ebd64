"""Reports interrupted, clocks set back, and studies on a Dask cluster, by real commands."""

from __future__ import annotations

import contextlib
import csv
import importlib.util
import io
import os
import random
import select
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz.campaign import Record, cpu_seconds
from tests.fuzz.interrupts import interrupted
from tests.fuzz.kill_workers import MODULE
from tests.fuzz.odd_documents import spawned
from tests.fuzz.workspace import SCRIPT, assert_answered

TITLE = "Interrupted reports, clocks set back, Dask"
WHAT = (
    "Ctrl-C twice at random moments of the report of a run with 20 MB of recordings; runs with "
    "checkpoints and a progress bar and sweeps that are resumed, while the clock jumps by up to a "
    "year to both sides and the clocks for durations advance in steps of 1/64 s, in all "
    "processes; contests on a Dask cluster of two processes, and sweeps there with --timeout and a "
    "block that does not return; fit, which has no cluster."
)
HOLDS = (
    "Each ends within a minute with a documented exit code, without a traceback (what Python "
    "prints where Ctrl-C meets a finalizer is counted by itself). A report is "
    "whole, or the one before, and nothing lies beside it. Under jumping clocks, runs have the "
    "same bits, a folder for each, and 'latest' is the last; rows of sweeps are the same. A "
    "contest on a cluster has the rows of one without. A sweep with a block that does not "
    "return has its row as timeout, and those of all other trials."
)
# Imported by each Python process that has this folder on its path.
CLOCKS = """
import datetime, os, random, time
if "JUMPS" in os.environ:
    _draw = random.Random(f"{os.environ['JUMPS']}.{os.getpid()}")
    _real, _mono, _perf = time.time, time.monotonic, time.perf_counter
    _off = [0.0]
    def _time():
        if _draw.random() < 0.3:
            _off[0] = _draw.uniform(-3e7, 3e7)
        return _real() + _off[0]
    class _Date(datetime.datetime):
        @classmethod
        def now(cls, tz=None):
            return cls.fromtimestamp(_time(), tz)
    _Date.__name__ = _Date.__qualname__ = "datetime"
    _Date.__module__ = "datetime"
    datetime.datetime = _Date
    time.time, time.time_ns = _time, lambda: int(_time() * 1e9)
    time.monotonic = lambda: _mono() // 0.015625 * 0.015625
    time.perf_counter = lambda: _perf() // 0.015625 * 0.015625
"""
CLUSTER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    options = {"dashboard_address": None, "host": "127.0.0.1"}
    with LocalCluster(n_workers=2, threads_per_worker=1, **options) as c:
        print(c.scheduler_address, flush=True)
        sys.stdin.read()
"""
STUCK = """
import time
import blocks


class Stuck(blocks.Block):
    out = blocks.Output(blocks.Scalar)
    level: float = blocks.param(0.0, doc="above 0.5 it does not return")

    def output(self, state, t):
        while self.level > 0.5:
            time.sleep(0.05)
        return self.level + t
"""
SMALL = """
graph: small
run: {dt: 0.01, until: 0.5, seed: 1}
params: {k: 1.0}
blocks:
  go: {type: Constant, value: 1.0}
  noise: {type: WhiteNoise, density: 0.01}
  sum: {type: Sum}
  gain: {type: Gain, gain: $k}
wires:
  sum: {terms: [go.value, noise.out]}
  gain: {input: sum.out}
probes: {out: gain.out}
metrics: {first: {kind: rms, of: gain.out}}
"""
LARGE = """
graph: large
run: {dt: 0.01, until: 50.0}
blocks: {noise: {type: Noise, module: own.py}}
probes: {out: noise.out, first: noise.first}
metrics: {first: {kind: final, of: noise.first}}
"""
CONTEST = """
experiment: gains
graph: small.yaml
minimize: first
training: {seeds: 0..1}
held_out: {seeds: [10, 11]}
contestants:
  tuned: {vary: {params.k: 0.5..1.9}}
  fixed: {}
"""
PATIENCE = 60.0
WALL = ("wall_s", "worker")
SWEEP = ("sweep", "small.yaml", "--vary=params.k=0..1:4", "--seeds=0..1", "-j2", "--no-plots")
Rows = list[dict[str, str]]
Kind = Callable[[Path, random.Random], str]


@contextlib.contextmanager
def cluster() -> Iterator[str]:
    """The address of a LocalCluster in a process group of its own, which is killed at the end."""
    options: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with tempfile.TemporaryDirectory() as temporary:
        script = Path(temporary, "cluster.py")
        script.write_text(CLUSTER)
        options |= {"stderr": subprocess.DEVNULL, "cwd": temporary, "start_new_session": True}
        with subprocess.Popen([sys.executable, script], **options) as process:
            try:
                yield process.stdout.readline().decode().strip()  # type: ignore[union-attr]
            finally:
                os.killpg(process.pid, signal.SIGKILL)


def rows(folder: Path) -> dict[str, Rows]:
    """The rows of all tables of a folder, without what clocks and places make different."""
    found = {}
    for path in sorted(folder.rglob("*.csv")):
        table = csv.DictReader(io.StringIO(path.read_text(encoding="utf-8"), newline=""))
        kept = [{k: v for k, v in row.items() if k not in WALL} for row in table]
        found[str(path.relative_to(folder))] = sorted(kept, key=lambda row: row.get("trial", ""))
    return found


def report(folder: Path, moments: random.Random) -> str:
    """Interrupt a report; the report before may be there or not."""
    run = folder / "runs" / "large" / "a"
    before = b"the report before" if moments.random() < 0.5 else None
    shown = run / "report.html"
    shown.unlink(missing_ok=True)
    if before:
        shown.write_bytes(before)
    kept = {path.name for path in run.iterdir()} | {"report.html"}
    outcome, fault = interrupted(folder, ("report", str(run)), moments)
    if "Exception ignored in" in fault:  # Python's message, where Ctrl-C meets a finalizer
        outcome, fault = "in a finalizer", ""
    assert not fault, fault
    left = {path.name for path in run.iterdir()} - kept
    assert not left, f"left behind: {left}"
    written = shown.read_bytes() if shown.exists() else None
    is_whole = written is not None and written.rstrip().endswith(b"</html>")
    assert is_whole or written == before, "half a report"
    return f"{outcome}, {'a new report' if is_whole else 'as before'}"


def with_terminal(command: tuple[str, ...], folder: Path, jumps: str) -> str:
    """Run a command whose stderr is a terminal, with jumping clocks; what it showed there."""
    environment = {**os.environ, "PYTHONPATH": str(folder / "clocks"), "JUMPS": jumps}
    above, below = os.openpty()
    shown = b""
    streams: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE}
    words = [SCRIPT, *command]
    with subprocess.Popen(words, cwd=folder, env=environment, stderr=below, **streams) as process:
        os.close(below)
        with contextlib.suppress(OSError):  # the terminal's other end is closed
            while select.select([above], [], [], PATIENCE)[0] and (part := os.read(above, 65536)):
                shown += part
        os.close(above)
        if process.poll() is None:
            try:
                process.communicate(timeout=PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
    text = shown.decode("utf-8", "replace")
    assert process.returncode == 0, f"exit code {process.returncode}: {text}"
    assert "Traceback" not in text, text
    return text


def clock(folder: Path, moments: random.Random) -> str:
    """Runs and sweeps whose clocks jump, against those in ``true``."""
    jumps = str(moments.random())
    if moments.random() < 0.5:
        shutil.rmtree(folder / "runs" / "small", ignore_errors=True)
        for number in (1, 2):
            command = ("run", "small.yaml", "--no-plots", "--checkpoint", "0.01s", "--until", "20")
            with_terminal(command, folder, f"{jumps}.{number}")
            runs = {path for path in (folder / "runs" / "small").iterdir() if not path.is_symlink()}
            assert len(runs) == number, runs
            last = (folder / "runs" / "small" / "latest").resolve()
            with np.load(last / "probes.npz") as mine, np.load(folder / "true.npz") as true:
                assert mine.files == true.files
                assert all(mine[key].tobytes() == true[key].tobytes() for key in mine.files)
            newest = max(runs, key=lambda path: path.stat().st_ctime_ns)
            assert last == newest.resolve(), f"latest is {last}, not {newest}"
        return "two runs, same bits"
    swept = folder / "sweeps" / "jumping"
    shutil.rmtree(swept, ignore_errors=True)
    with_terminal((*SWEEP, "--name", "jumping"), folder, jumps)
    index = swept / "index.csv"
    lines = index.read_text().splitlines(keepends=True)
    index.write_text("".join(lines[: moments.randint(1, len(lines) - 1)]))
    with_terminal((*SWEEP, "--name", "jumping", "--resume"), folder, jumps + "x")
    assert rows(swept) == rows(folder / "sweeps" / "true"), "rows differ"
    answer = spawned(("clean", "runs"), folder)
    assert answer.code == 0, answer.err
    return "sweep resumed, same rows"


def contest(folder: Path, moments: random.Random) -> str:
    """A contest on a cluster, sometimes interrupted and resumed, against one without."""
    if importlib.util.find_spec("distributed") is None:
        return "extra missing"
    shutil.rmtree(folder / "contests" / "there", ignore_errors=True)
    command = ("contest", "gains.yaml", "--trials", "3", "--no-plots", "-q", "--name")
    outcome = "contest, same rows"
    with cluster() as address:
        there = (*command, "there", "--scheduler", address)
        if moments.random() < 0.5:
            ended, fault = interrupted(folder, there, moments)
            assert not fault, fault
            there = (*there, "--resume")
            outcome = f"contest interrupted ({ended}) and resumed, same rows"
        answer = spawned(there, folder)
        assert_answered(answer, there)
        assert answer.code == 0, answer.err
    if not (folder / "contests" / "here").exists():
        local = spawned((*command, "here", "-j", "1"), folder)
        assert local.code == 0, local.err
    assert rows(folder / "contests" / "there") == rows(folder / "contests" / "here"), "rows differ"
    return outcome


def stuck(folder: Path, moments: random.Random) -> str:
    """A sweep with a trial that does not return by itself, and four that do."""
    if importlib.util.find_spec("distributed") is None:
        return "extra missing"
    levels = [0.1, 0.2, 0.3, 0.4]
    levels.insert(moments.randint(0, len(levels)), 0.9)
    shutil.rmtree(folder / "sweeps" / "stuck", ignore_errors=True)
    command = ("sweep", "stuck.yaml", f"--vary=stuck.level={levels}", "--no-plots", "--timeout")
    with cluster() as address:
        answer = spawned((*command, f"{moments.uniform(0.2, 1.0)}", "--scheduler", address), folder)
    assert_answered(answer, command)
    assert answer.code == 0, answer.err
    (found,) = rows(folder / "sweeps" / "stuck").values()
    ended = {float(row["stuck.level"]): row["status"] for row in found}
    assert ended == {level: "ok" if level < 0.5 else "timeout" for level in levels}, found
    return "one timeout, all other rows"


def fit(folder: Path, moments: random.Random) -> str:
    """``fit`` has no cluster, and says so."""
    command = ("fit", "small.yaml", "--vary=params.k=0..1", "--scheduler", "tcp://127.0.0.1:9")
    answer = spawned(command, folder)
    assert_answered(answer, command)
    assert answer.code == 2, answer.err
    assert "--scheduler" in answer.err, answer.err
    return "refused"


# Without Ctrl-C, whose moments no seed repeats.
QUIET = (clock, stuck, fit)
KINDS = (report, clock, contest, report, clock, stuck, report, clock, report, fit)


def prepare(folder: Path) -> None:
    """Graphs, a large run, and a run and a sweep with a true clock."""
    texts = {"small": SMALL, "large": LARGE, "gains": CONTEST}
    texts["stuck"] = "graph: stuck\nrun: {dt: 0.1, until: 0.5}\nblocks: {stuck: {type: Stuck, "
    texts["stuck"] += "module: stuck.py}}\nmetrics: {last: {kind: final, of: stuck.out}}\n"
    for name, text in texts.items():
        (folder / f"{name}.yaml").write_text(text)
    (folder / "own.py").write_text(MODULE)
    (folder / "stuck.py").write_text(STUCK)
    (folder / "clocks").mkdir()
    (folder / "clocks" / "sitecustomize.py").write_text(CLOCKS)
    for command in (
        ("run", "large.yaml", "--no-plots"),
        ("run", "small.yaml", "--no-plots", "--until", "20"),
        (*SWEEP, "--name", "true"),
    ):
        answer = spawned(command, folder)
        assert answer.code == 0, f"{command}: {answer.err}"
    runs = folder / "runs"
    (runs / "large" / "latest").resolve().rename(runs / "large" / "a")
    shutil.copy(runs / "small" / "latest" / "probes.npz", folder / "true.npz")


def run(examples: int, seed: int) -> Record:
    """Try one kind after another."""
    return _tried(KINDS, examples, seed)


def run_quiet(examples: int, seed: int) -> Record:
    """Try what is not interrupted."""
    return _tried(QUIET, examples, seed)


def _tried(kinds: Sequence[Kind], examples: int, seed: int) -> Record:
    """Whatever does not hold is a failure."""
    started = cpu_seconds()
    outcomes: Counter[str] = Counter()
    failures: list[str] = []
    with tempfile.TemporaryDirectory(prefix="spikeblocks-clocks-") as temporary:
        folder = Path(temporary)
        prepare(folder)
        for number in range(examples):
            kind = kinds[number % len(kinds)]
            try:
                outcomes[f"{kind.__name__}: {kind(folder, random.Random(f'{seed}.{number}'))}"] += 1
            except (AssertionError, OSError, subprocess.TimeoutExpired) as error:
                outcomes[f"{kind.__name__}: failed"] += 1
                failures.append(f"example {number}: {kind.__name__}: {error!s}")
    seconds = cpu_seconds() - started
    return Record("clocks_and_clusters", examples, seed, dict(outcomes), tuple(failures), seconds)
