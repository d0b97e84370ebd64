"""The cache folder: damaged files are compiled again, and only the user may write to it."""

from __future__ import annotations

import json
import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import blocks
import runtime
from runtime.engine.compiled import cache

GRAPH = """
graph: small
run: {dt: 0.01, until: 0.2, seed: 1, engine: compiled}
blocks:
  motion: {type: Constant, signal: Twist, value: [0.5, 0.25]}
  lag: {type: ActuatorLag, tau: 0.1}
wires:
  lag: {command: motion.value}
probes:
  out: lag.actual
"""


def forget() -> None:
    """Read compiled text from disk, as a new process would."""
    for name in [name for name in sys.modules if name.startswith(f"{cache.PACKAGE}.")]:
        del sys.modules[name]


def run() -> np.ndarray:
    forget()
    graph = runtime.Graph("small", dt=0.01, until=0.2).probe("out", "lag.actual")
    graph = graph.add("motion", blocks.Constant(value=[0.5, 0.25], signal="Twist"))
    graph = graph.add("lag", blocks.ActuatorLag(tau=0.1)).connect("motion.value", "lag.command")
    found: np.ndarray = graph.run(engine="compiled")["out"]
    return found


def expected() -> np.ndarray:
    reached = 1.0 - np.exp(-0.01 * np.arange(20) / 0.1)
    return reached[:, None] * np.array([0.5, 0.25])


DAMAGES: dict[str, Callable[[Path], object]] = {
    "truncated": lambda file: file.write_bytes(file.read_bytes()[: file.stat().st_size // 2]),
    "garbled": lambda file: file.write_bytes(bytes(255 - b for b in file.read_bytes())),
    "flipped": lambda file: file.write_bytes(
        (text := file.read_bytes())[:-9] + bytes([text[-9] ^ 1]) + text[-8:]
    ),
    "emptied": lambda file: file.write_bytes(b""),
    "removed": Path.unlink,
}


@pytest.mark.parametrize("kind", DAMAGES)
def test_a_damaged_file_is_compiled_again(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    np.testing.assert_allclose(run(), expected(), rtol=1e-12)
    whole = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    kinds = {file.suffix for file in whole}
    assert kinds == {".py", ".sealed", ".nbi", ".nbc", ""}
    for suffix in kinds:
        for file in whole:
            if file.suffix == suffix:
                DAMAGES[kind](file)
        np.testing.assert_allclose(run(), expected(), rtol=1e-12)
        for name in {file for file in whole if file.suffix in (".py", "")}:
            assert name.read_bytes() == whole[name]


def test_intact_files_are_not_compiled_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    run()
    before = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.is_file()}
    run()
    after = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.is_file()}
    assert before == after


def test_two_processes_at_once_on_an_empty_cache(script: Path, tmp_path: Path) -> None:
    graph = tmp_path / "small.yaml"
    graph.write_text(GRAPH)
    environment = {**os.environ, cache.VARIABLE: str(tmp_path / "cache")}
    command = [str(script), "run", str(graph), "--no-plots", "--json", "-q"]
    running = [
        subprocess.Popen(
            [*command, "--out", f"out{i}"],
            cwd=tmp_path,
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        for i in range(2)
    ]
    for process in running:
        message, _ = process.communicate()
        assert process.returncode == 0
        folder = tmp_path / json.loads(message)["run"]
        found = np.load(folder / "probes.npz")["out"]
        np.testing.assert_allclose(found, expected(), rtol=1e-12)


def test_the_folder_is_the_users_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = tmp_path / "new"
    monkeypatch.setenv(cache.VARIABLE, str(wanted))
    assert cache.folder() == wanted
    assert stat.S_IMODE(wanted.stat().st_mode) == 0o700


def shared(folder: Path) -> Path:
    folder.mkdir()
    folder.chmod(0o777)
    return folder


def linked(folder: Path) -> Path:
    (folder.parent / "elsewhere").mkdir()
    folder.symlink_to(folder.parent / "elsewhere")
    return folder


def a_file(folder: Path) -> Path:
    folder.write_text("")
    return folder


@pytest.mark.parametrize("make", [shared, linked, a_file])
def test_a_folder_that_others_may_have_written_is_not_used(
    make: Callable[[Path], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = make(tmp_path / "cache")
    monkeypatch.setenv(cache.VARIABLE, str(wanted))
    check_own(wanted)


def test_a_folder_of_another_user_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    monkeypatch.setattr(os, "getuid", lambda: tmp_path.stat().st_uid + 1)
    check_own(tmp_path)


def check_own(wanted: Path) -> None:
    found = cache.folder()
    assert not found.is_relative_to(wanted)
    assert stat.S_IMODE(found.stat().st_mode) == 0o700
    assert found.stat().st_uid == os.geteuid()
    np.testing.assert_allclose(run(), expected(), rtol=1e-12)
    assert not wanted.is_dir() or not list(wanted.iterdir())
