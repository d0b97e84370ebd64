"""No recording is lost: changed sources, signals, full disks, odd paths, killed processes."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.engine.interrupts import Interrupts, stoppable
from runtime.errors import UsageError
from runtime.files import NAME_BYTES, json_text, slug, write_whole
from runtime.runs.draft import PARTIAL, Draft, leftovers
from tests.compilers import needs_compiler
from tests.conftest import Run

OWN = '''
import os, pathlib, shutil, signal, blocks

class Acting(blocks.Block):
    """Counts, and executes an action at half a second."""
    out = blocks.Output(blocks.Scalar)
    def output(self, state, t):
        if abs(t - 0.5) < 1e-9:
            {act}
        return 100.0 * t
'''
GRAPH = """
graph: acting
extends: base.yaml
blocks:
  part: {graph: part.yaml}
probes: {seen: act.out}
metrics: {end: {kind: final, of: seen}}
"""
BASE = "run: {dt: 0.01, until: 1.0}\nblocks:\n  act: {type: Acting, module: own.py}\n"
PART = "outputs: {out: half.value}\nblocks: {half: {type: Constant, value: 0.5}}\n"


@pytest.fixture
def acting(tmp_path: Path) -> Any:
    """Writes a graph whose block executes an action at half a second; returns its folder."""

    def write(act: str) -> Path:
        placed = act.replace("{folder!r}", repr(str(tmp_path)))
        (tmp_path / "own.py").write_text(OWN.replace("{act}", placed))
        for name, text in (("g", GRAPH), ("base", BASE), ("part", PART)):
            (tmp_path / f"{name}.yaml").write_text(text)
        return tmp_path

    return write


def only_run(folder: Path) -> Path:
    """The one run below a folder; there must be no hidden folder beside it."""
    (found,) = (path.parent for path in folder.rglob("manifest.json"))
    assert not list(found.parent.glob(f".*{PARTIAL}"))
    return found


# With absolute paths: runs are repeated in the process of the tests, in another folder.
FILES = "(pathlib.Path({folder!r}, n) for n in ('g.yaml', 'base.yaml', 'part.yaml', 'own.py'))"
EDIT = f"[p.write_text('changed: [') for p in {FILES}]"
REMOVE = f"[p.unlink(missing_ok=True) for p in {FILES}]"


@pytest.mark.parametrize("act", [EDIT, REMOVE], ids=["edited", "removed"])
@pytest.mark.parametrize("engine", ["python", pytest.param("compiled", marks=needs_compiler)])
def test_the_folder_holds_the_texts_that_ran(cli: Run, acting: Any, act: str, engine: str) -> None:
    folder = acting(act)
    own, graph = (folder / "own.py").read_text(), (folder / "g.yaml").read_text()
    done = cli("run", "g.yaml", "--no-plots", "--engine", engine)
    assert done.returncode == 0, done.stderr
    run = only_run(folder / "runs")
    assert (run / "own.py").read_text() == own
    assert (run / "graph.yaml").read_text() == graph
    read = json.loads((run / "manifest.json").read_text())["read"]
    assert {Path(name).name for name in read} == {"g.yaml", "base.yaml", "part.yaml", "own.py"}
    again = runtime.load(run / "graph.resolved.yaml").run(engine="python")
    np.testing.assert_allclose(again["seen"], np.arange(100.0), rtol=0, atol=1e-12)


def test_a_module_is_read_once(acting: Any) -> None:
    folder = acting("pass")
    first = runtime.load(folder / "g.yaml").check()
    text = (folder / "own.py").read_text()
    (folder / "own.py").write_text(text.replace("100.0", "200.0"))
    second = runtime.load(folder / "g.yaml").check()
    runs = [first.run(), second.run()]
    assert [run.metrics["end"] for run in runs] == pytest.approx([99.0, 198.0])
    assert [b"200.0" in run.files["own.py"] for run in runs] == [False, True]


KILL = "os.kill(os.getpid(), signal.{name})"


@pytest.fixture
def hangup() -> Iterator[None]:
    """SIGHUP ends a process, also where the tests were started to ignore it (with nohup)."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
@pytest.mark.parametrize("memory", ["1G", "64"])
def test_a_run_that_ends_early_keeps_its_recording(
    cli: Run, acting: Any, hangup: None, name: str, code: int, memory: str
) -> None:
    folder = acting(KILL.replace("{name}", name))
    done = cli("run", "--no-plots", "g.yaml", "--json", "--set", f"run.memory={memory}")
    assert done.returncode == code, done.stderr
    result = runtime.open(only_run(folder / "runs"))
    assert result.status == "interrupted"
    np.testing.assert_allclose(result["seen"], np.arange(len(result["seen"])), atol=1e-12)
    assert len(result["seen"]) >= 50


def test_an_ignored_signal_stays_ignored(hangup: None) -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with Interrupts() as interrupts, stoppable():
        signal.raise_signal(signal.SIGHUP)
    assert (interrupts.caught, interrupts.count) == (None, 0)


def test_signals_while_a_run_is_written_are_stored(hangup: None) -> None:
    with Interrupts() as interrupts:
        with pytest.raises(KeyboardInterrupt), stoppable():
            signal.raise_signal(signal.SIGTERM)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.raise_signal(number)
        assert (interrupts.caught, interrupts.count) == (signal.SIGTERM, 4)
        with pytest.raises(KeyboardInterrupt), stoppable():
            pytest.fail("what came before must end what begins now")
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


SIGNALS = """
import os, signal, sys
from runtime import cli
from runtime.runs import draft
def signalled(result, folder, commit, write=draft.write):
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
        os.kill(os.getpid(), number)
    write(result, folder, commit)
    os.kill(os.getpid(), signal.SIGINT)
draft.write = signalled
cli.main(["run", "g.yaml"])
"""


def test_many_signals_while_saving_lose_nothing(acting: Any) -> None:
    folder = acting(KILL.replace("{name}", "SIGINT"))
    done = subprocess.run([sys.executable, "-c", SIGNALS], cwd=folder, capture_output=True)
    assert done.returncode == 130
    assert len(runtime.open(only_run(folder / "runs"))["seen"]) >= 50


@pytest.mark.parametrize("what", ["file", "long", "nul"])
def test_an_impossible_folder_is_refused_before_the_first_tick(
    cli: Run, acting: Any, tmp_path: Path, what: str
) -> None:
    acting("pathlib.Path({folder!r}, 'ran').touch()")
    (tmp_path / "taken").write_text("")
    out = {"file": "taken", "long": "n" * 300, "nul": "../" * 2000}[what]
    done = cli("run", "g.yaml", "--out", out)
    assert done.returncode == 2
    assert "cannot write" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "ran").exists()


def test_a_title_of_any_length_is_a_folder(cli: Run, acting: Any, tmp_path: Path) -> None:
    acting("pass")
    done = cli("run", "g.yaml", "--no-plots", "--set", f"graph={'x' * 120}")
    assert done.returncode == 0, done.stderr
    assert len(only_run(tmp_path / "runs").parent.name) <= NAME_BYTES


def test_too_little_room_is_refused_before_the_first_tick(
    acting: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = acting("pathlib.Path({folder!r}, 'ran').touch()")
    usage = type("Usage", (), {"free": 1000})
    monkeypatch.setattr("runtime.engine.recorder.shutil.disk_usage", lambda folder: usage)
    monkeypatch.chdir(folder)
    from runtime.cli import run

    assert run(["run", "g.yaml", "-q"]) == 2
    assert not (folder / "ran").exists()
    assert not list(folder.glob("runs/*/.*"))


def test_a_run_whose_folder_cannot_be_written_is_saved_elsewhere(
    cli: Run, acting: Any, tmp_path: Path
) -> None:
    # The folder of all runs becomes a file during the simulation.
    runs = str(tmp_path / "runs")
    acting(f"(shutil.rmtree({runs!r}), pathlib.Path({runs!r}).write_text(''))")
    spare = tmp_path / "spare"
    spare.mkdir()
    environment = {**os.environ, "TMPDIR": str(spare)}
    done = cli("run", "g.yaml", "--set", "run.memory=64", env=environment)
    assert done.returncode == 2
    assert f"the run is kept in '{spare}" in done.stderr
    assert "Traceback" not in done.stderr
    result = runtime.open(only_run(spare))
    np.testing.assert_allclose(result["seen"], np.arange(100.0), atol=1e-12)


def test_a_killed_run_is_listed_recovered_and_removed(
    cli: Run, acting: Any, tmp_path: Path
) -> None:
    acting(KILL.replace("{name}", "SIGKILL"))
    done = cli("run", "g.yaml", "--set", "run.memory=64", "--engine", "python")
    assert done.returncode == -signal.SIGKILL
    (hidden,) = tmp_path.glob(f"runs/acting/.*{PARTIAL}")
    done = cli("run", "g.yaml", "--until", "0.1", "--no-plots")
    assert "killed runs left 1 hidden folder" in done.stderr
    listed = cli("clean")
    assert listed.returncode == 0 and str(hidden.name) in listed.stdout
    assert "--yes' removes these" in listed.stderr and hidden.exists()
    (row,) = json.loads(cli("clean", "--recover", "--yes", "--json").stdout)["leftovers"]
    assert row["removed"] and not hidden.exists()
    result = runtime.open(tmp_path / row["run"])
    assert result.status == "interrupted" and result.metrics == {"end": None}
    rows = result["seen"]
    assert 40 <= len(rows) <= 50
    np.testing.assert_allclose(rows, np.arange(len(rows)), atol=1e-12)
    assert (tmp_path / row["run"] / "own.py").read_text() == (tmp_path / "own.py").read_text()
    assert "nothing left behind" in cli("clean").stdout


def test_drafts_in_use_and_links_are_not_removed(tmp_path: Path) -> None:
    draft = Draft(tmp_path / "runs" / "g" / "one")
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "kept").touch()
    (tmp_path / "runs" / "g" / f".two{PARTIAL}").symlink_to(outside)
    assert leftovers(tmp_path / "runs") == []
    os.close(draft._lock)  # as the end of its process does
    (found,) = leftovers(tmp_path / "runs")
    assert found.path == draft.partial
    (found.path / "link").symlink_to(outside)
    from runtime.runs.draft import remove

    assert remove(found) and (outside / "kept").exists()


def test_json_has_no_infinity_and_no_surrogates() -> None:
    odd = {"a": float("inf"), "b": [float("nan"), 1.5], "c": "half \udcff"}
    assert json.loads(json_text(odd)) == {"a": None, "b": [None, 1.5], "c": "half \\udcff"}


MISSING = """
graph: missing
run: {dt: 0.01, until: 0.1}
world: {circles: [[300.0, 0.0, 0.5]]}
blocks: {plant: {type: DifferentialDrive}, lidar: {type: Lidar, beams: 4}, \
go: {type: Constant, value: [0, 0], signal: Twist}}
wires: {plant: {command: go.value}, lidar: {pose: plant.pose}}
metrics:
  nearest: {kind: min, of: lidar.scan.0, above: 1.0}
"""


def test_a_metric_that_is_infinite_is_null_with_a_note(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(MISSING)
    done = cli("run", "--no-plots", "m.yaml", "--json")

    def refuse(name: str) -> None:
        pytest.fail(f"{name} is no JSON")

    summary = json.loads(done.stdout, parse_constant=refuse)
    # Expectations are compared with the infinite value.
    assert done.returncode == 0 and summary["metrics"] == {"nearest": None}
    assert summary["notes"][-1] == "metric 'nearest' is infinite (inf): it counts as no value"
    for path in (tmp_path / summary["run"]).glob("*.json"):
        json.loads(path.read_text(), parse_constant=refuse)


def test_files_are_written_atomically(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.write_text("as it was")
    link = tmp_path / "link"
    link.symlink_to(outside)
    write_whole(link, "new")
    assert (outside.read_text(), link.read_text()) == ("as it was", "new")
    with pytest.raises(OSError):
        write_whole(tmp_path, "a folder is there")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "outside"]


@pytest.mark.parametrize("text", ["", "..", "a/b", "é" * 300, "x" * 300, "nul\0", "-"])
def test_slugs_are_valid_file_names(tmp_path: Path, text: str) -> None:
    name = slug(text)
    (tmp_path / name).touch()
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert slug("x" * 300) != slug("x" * 301)


EVIL = "#!/bin/sh\ntouch {mark}\nexec cat\n"


def git(folder: Path, *arguments: str) -> str:
    identity = ("-c", "user.name=a", "-c", "user.email=a@b.c")
    done = subprocess.run(
        ["git", *identity, *arguments], cwd=folder, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_the_commit_is_found_without_executing_programs_of_the_repository(tmp_path: Path) -> None:
    from runtime.runs.commit import git_commit

    work = tmp_path / "work"
    work.mkdir()
    assert git_commit(work) is None
    git(work, "init", "-q")
    assert git_commit(work) is None
    (work / "file").write_text("one\n")
    git(work, "add", "file")
    git(work, "commit", "-qm", "one")
    commit = git(work, "rev-parse", "HEAD")
    inner = work / "inner"
    inner.mkdir()
    assert git_commit(inner) == commit
    mark, tool = tmp_path / "mark", tmp_path / "tool"
    tool.write_text(EVIL.replace("{mark}", str(mark)))
    tool.chmod(0o755)
    for key in ("core.fsmonitor", "filter.f.clean", "core.hooksPath", "core.pager"):
        git(work, "config", key, str(tool))
    (work / ".git" / "info" / "attributes").write_text("* filter=f\n")
    (work / "file").write_text("two\n")
    assert git_commit(work) == f"{commit}+changes"
    assert not mark.exists()
    git(work, "pack-refs", "--all")
    git(work, "-c", "core.fsmonitor=", "worktree", "add", "-q", "../other")
    assert git_commit(tmp_path / "other") in (commit, f"{commit}+changes")


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_a_git_that_hangs_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from runtime.runs import commit

    git(tmp_path, "init", "-q")
    git(tmp_path, "commit", "-qm", "one", "--allow-empty")
    found = git(tmp_path, "rev-parse", "HEAD")
    fake = tmp_path / "bin"
    fake.mkdir()
    (fake / "git").write_text("#!/bin/sh\nsleep 1000 &\nwait\n")
    (fake / "git").chmod(0o755)
    monkeypatch.setenv("PATH", f"{fake}:{os.environ['PATH']}")
    monkeypatch.setattr(commit, "TIMEOUT", 0.2)
    assert commit.git_commit(tmp_path) == found


BIG = """
graph: big
run: {dt: 0.001, until: 15, memory: 4M, engine: python}
blocks: {w: {type: Wave, module: wave.py}}
probes: {wide: w.out}
metrics: {settled: {kind: settling_time, of: wide, band: 5.0, after: 14.9}}
"""
WAVE = """
import numpy as np, blocks
class Wave(blocks.Block):
    \"\"\"A vector.\"\"\"
    out = blocks.Output(blocks.Vector(600))
    def output(self, state, t):
        return np.full(600, t)
"""


def peak(script: Path, folder: Path, *arguments: str) -> int:
    """The peak memory (bytes) of the console script."""
    code = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=-3); "
    code += "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    command = [sys.executable, "-c", code, str(script), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return int(done.stdout) * (1024 if sys.platform != "darwin" else 1)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(resource, "RUSAGE_CHILDREN"), reason="needs getrusage")
def test_a_recording_larger_than_memory_is_never_loaded(script: Path, tmp_path: Path) -> None:
    (tmp_path / "big.yaml").write_text(BIG)
    (tmp_path / "wave.py").write_text(WAVE)
    size = 15_000 * 601 * 8
    small = peak(script, tmp_path, "run", "big.yaml", "-q", "--no-plots", "--until", "0.01")
    for _ in range(2):
        large = peak(script, tmp_path, "run", "big.yaml", "-q", "--no-plots")
        assert large - small < size / 4
    runs = [str(path.parent) for path in tmp_path.glob("runs/big/*-*/probes.npz")]
    runs = [run for run in runs if Path(run, "probes.npz").stat().st_size > size]
    assert len(runs) == 2
    assert peak(script, tmp_path, "compare", *runs, "--no-plots") - small < size / 2


def test_a_figure_that_fails_is_a_note(
    acting: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from runtime.plots import save_plots
    from runtime.plots.painters import OURS, Drawing

    def painter(figure: Any, recordings: Any, end: float) -> Any:
        axes = figure.subplots()
        axes.set_xlim(0.0, float("nan"))
        return axes

    monkeypatch.setitem(OURS, "heatmap", Drawing(painter))
    acting("pass")
    graph = runtime.load(tmp_path / "g.yaml")
    graph = graph.plot("bad", "heatmap", "seen").plot(
        "good", "timeseries", "seen", title="$\\frac$ costs 5 $"
    )
    notes: list[str] = []
    paths = save_plots(graph.run(), tmp_path / "plots", notes.append)
    assert [path.name for path in paths] == ["good.png"]
    assert list((tmp_path / "plots").iterdir()) == paths
    (note,) = notes
    assert note.startswith("plot 'bad' is not drawn: Axis limits cannot be NaN or Inf")


def test_save_never_writes_over_another(tmp_path: Path, acting: Any) -> None:
    acting("pass")
    result = runtime.load(tmp_path / "g.yaml").run()
    result.save(tmp_path / "kept")
    with pytest.raises(UsageError, match="exists already"):
        result.save(tmp_path / "kept")
    assert not list(tmp_path.glob(f".*{PARTIAL}"))
