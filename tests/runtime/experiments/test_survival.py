"""A sweep that is killed at any moment and resumed has the results of an uninterrupted one."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.runtime.experiments.test_sweep import kept, rows

POINTS = 40
SWEEP = ("--vary", f"draw.level=0..1:{POINTS // 2}", "--seeds", "0..1", "--set", "draw.how=brief")
LATER = ("--no-plots", "-q", "-j", "2", "--resume")


def lines(index: Path) -> int:
    return index.read_bytes().count(b"\n") if index.exists() else 0


def kill_after(process: subprocess.Popen[bytes], index: Path, rows: int, jitter: float) -> bool:
    """Kill a sweep some seconds after its index has so many lines; False if it ended first."""
    while lines(index) < rows:
        try:
            process.wait(timeout=0.002)
            return False
        except subprocess.TimeoutExpired:
            continue
    try:
        process.wait(timeout=jitter)
        return False
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        process.wait()
        return True


@pytest.mark.parametrize("keep", [pytest.param("none", marks=pytest.mark.slow), "best:3"])
@pytest.mark.slow
def test_killed_and_resumed_is_never_killed(
    script: Path, here: Run, draw: Path, tmp_path: Path, keep: str
) -> None:
    moments = random.Random(keep)
    folder, log = tmp_path / "sweeps" / "draw", tmp_path / "log"
    command = ["sweep", "draw.yaml", *SWEEP, "--set", f"draw.mark={log}", "--keep", keep, *LATER]
    kills = 0
    for target in (0, 3, 11, 24):
        with subprocess.Popen([script, *command], cwd=tmp_path, start_new_session=True) as process:
            kills += kill_after(process, folder / "index.csv", target, moments.uniform(0.0, 0.02))
    assert kills >= 3
    done = here(*command)
    assert done.returncode == 0, done.stderr
    assert len(rows(folder)) == POINTS

    whole = here(*command, "--name", "whole")
    assert whole.returncode == 0, whole.stderr
    assert rows(folder) == rows(tmp_path / "sweeps" / "whole")
    assert kept(folder) == kept(tmp_path / "sweeps" / "whole")
    assert not list(folder.rglob(".*"))
    # Only trials that were running when the sweep was killed ran again.
    started = len(log.read_text().splitlines())
    assert 2 * POINTS <= started <= 2 * POINTS + 2 * kills

    again = here(*command)
    assert again.returncode == 0
    assert len(log.read_text().splitlines()) == started


@pytest.mark.slow
def test_workers_do_not_outlive_a_sweep_that_is_killed(
    script: Path, draw: Path, tmp_path: Path
) -> None:
    command = [script, "sweep", "draw.yaml", *SWEEP, *LATER]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE) as process:
        assert kill_after(process, tmp_path / "sweeps/draw/index.csv", 4, 0.0)
        # This pipe ends when the last process that holds it has ended, workers included.
        process.communicate(timeout=60)


@pytest.mark.slow
def test_ctrl_c_keeps_the_rows_and_says_how_to_go_on(
    script: Path, here: Run, draw: Path, tmp_path: Path
) -> None:
    command = [str(script), "sweep", "draw.yaml", *SWEEP, *LATER[:-1]]
    index = tmp_path / "sweeps" / "draw" / "index.csv"
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, start_new_session=True
    ) as process:
        while lines(index) < 5:
            assert process.poll() is None
        os.killpg(process.pid, signal.SIGINT)
        message = process.communicate()[1].decode()
    assert process.returncode == 130
    assert "interrupted after" in message and "--resume continues sweeps/draw" in message
    assert "Traceback" not in message
    assert 5 <= lines(index) <= POINTS
    assert here("sweep", "draw.yaml", *SWEEP, *LATER).returncode == 0
    assert len(rows(index.parent)) == POINTS


FULL = """
import resource, signal, sys
from runtime.cli import run

if __name__ == "__main__":
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
    sys.exit(run(sys.argv[2:]))
"""


@pytest.mark.slow
def test_a_full_disk_is_reported_and_what_was_written_stays(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    # A limit on file sizes simulates the full disk.
    (tmp_path / "full.py").write_text(FULL)
    plan = ("sweep", "draw.yaml", *SWEEP, "--seeds", "0..5", *LATER)
    folder, other = tmp_path / "sweeps" / "draw", tmp_path / "sweeps" / "whole"
    assert here(*plan, "--name", "whole").returncode == 0
    limit = max(path.stat().st_size for path in other.iterdir() if path.name != "index.csv") + 500
    assert limit < (other / "index.csv").stat().st_size
    command = [sys.executable, "full.py", str(limit), *plan]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert "cannot write 'sweeps/draw/index.csv': File too large" in done.stderr
    assert "what was written before is intact" in done.stderr
    assert "Traceback" not in done.stderr
    before = rows(folder)
    assert 0 < len(before) < 3 * POINTS
    assert here(*plan).returncode == 0
    assert rows(folder) == rows(other)
    assert all(row in rows(folder) for row in before)
