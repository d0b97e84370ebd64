"""What is kept of a compiled graph: damaged files are made again, intact ones are used."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import blocks
import runtime
from runtime.engine import Engine
from runtime.engine.compiled import make_kernels
from runtime.toolchain import VARIABLE, read_record
from runtime.toolchain.store import WALKED
from tests.compilers import needs_compiler

pytestmark = needs_compiler

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


def run() -> np.ndarray:
    graph = runtime.Graph("small", dt=0.01, until=0.2).probe("out", "lag.actual")
    graph = graph.add("motion", blocks.Constant(value=[0.5, 0.25], signal="Twist"))
    graph = graph.add("lag", blocks.ActuatorLag(tau=0.1)).connect("motion.value", "lag.command")
    found: np.ndarray = graph.run(engine="compiled")["out"]
    return found


def expected() -> np.ndarray:
    reached = 1.0 - np.exp(-0.01 * np.arange(20) / 0.1)
    return reached[:, None] * np.array([0.5, 0.25])


def replaced(file: Path, content: bytes) -> None:
    """Another file of the same name: this process has loaded the old one."""
    file.unlink()
    file.write_bytes(content)


DAMAGES: dict[str, Callable[[Path, bytes], object]] = {
    "truncated": lambda file, text: replaced(file, text[: len(text) // 2]),
    "garbled": lambda file, text: replaced(file, bytes(255 - b for b in text)),
    "flipped": lambda file, text: replaced(file, text[:-9] + bytes([text[-9] ^ 1]) + text[-8:]),
    "emptied": lambda file, text: replaced(file, b""),
    "removed": lambda file, text: file.unlink(),
}


@pytest.mark.parametrize("kind", DAMAGES)
def test_a_damaged_file_is_compiled_again(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    np.testing.assert_allclose(run(), expected(), rtol=1e-12)
    files = (file for file in tmp_path.rglob("*") if file.is_file() and file.name != WALKED)
    whole = {file: file.read_bytes() for file in files}
    kinds = {file.suffix for file in whole}
    assert kinds == {".json", ".o", ".so", ".sha256"}
    for suffix in kinds:
        for file in whole:
            if file.suffix == suffix:
                DAMAGES[kind](file, whole[file])
        np.testing.assert_allclose(run(), expected(), rtol=1e-12)


def test_intact_files_are_not_compiled_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    run()
    before = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.is_file()}
    run()
    after = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.is_file()}
    assert before == after


@pytest.mark.slow
def test_two_processes_at_once_on_an_empty_cache(script: Path, tmp_path: Path) -> None:
    graph = tmp_path / "small.yaml"
    graph.write_text(GRAPH)
    environment = {**os.environ, VARIABLE: str(tmp_path / "cache")}
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


def test_a_start_from_the_cache_translates_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "cache"))
    run()

    def refuse(*given: object) -> None:
        raise RuntimeError("translated again")

    monkeypatch.setattr("runtime.compiler.translate.translate", refuse)
    np.testing.assert_allclose(run(), expected(), rtol=1e-12, atol=1e-15)
    # Another value of a flag is another text.
    graph = runtime.Graph("small", dt=0.01, until=0.2).probe("out", "drive.pose")
    graph = graph.add("motion", blocks.Constant(value=[0.5, 0.25], signal="Twist"))
    graph = graph.add("drive", blocks.DifferentialDrive(integrator="rk4"))
    graph = graph.connect("motion.value", "drive.command")
    engine = Engine(graph.program(), 0)
    engine.prepare()
    # What the translator raises is a reason to call the block from Python.
    refused = make_kernels(graph.network, engine.state.blocks).refused
    assert refused["drive"] == "cannot be translated: RuntimeError: translated again"


def test_blocks_of_one_type_share_one_record_and_one_translation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    graph = runtime.Graph("chain", dt=0.01, until=0.2).add("b0", blocks.Sine())
    for i in range(1, 40):
        block = blocks.Gain(gain=1.0 + i) if i % 2 else blocks.Lowpass(tau=0.1 * i)
        graph = graph.add(f"b{i}", block).connect(f"b{i - 1}.out", f"b{i}.input")
    engine = Engine(graph.program(), 0)
    engine.prepare()
    read: list[str] = []

    def counted(name: str) -> object:
        read.append(name)
        return read_record(name)

    monkeypatch.setattr("runtime.compiler.cache.read_record", counted)
    found = make_kernels(graph.network, engine.state.blocks)
    # A translation and a text of each of three types.
    assert len(read) == len(set(read)) == 6
    assert len(found.compiled) == 40
    assert len({id(kernel.text) for kernel in found.compiled.values()}) == 3
