"""Recordings on disk equal recordings in memory, however the run ends."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from blocks import Constant, Gain, Sum, UnitDelay
from runtime.engine.recorder import Stream, buffer_rows
from tests.examples import examples


def ramp(every: tuple[int, ...], until: float) -> runtime.Graph:
    """x(k+1) = x(k) / 2 from 3, probed at several rates."""
    graph = runtime.Graph("ramp", dt=0.01, until=until)
    graph = graph.add("x", UnitDelay(initial=3.0)).add("half", Gain(gain=0.5))
    graph = graph.add("total", Sum()).add("zero", Constant(value=0.0))
    graph = graph.connect("x.out", "half.input").connect("total.out", "x.input")
    graph = graph.connect("half.out", "total.terms").connect("zero.value", "total.terms")
    for i, n in enumerate(every):
        graph = graph.probe(f"p{i}", "x.out", every=n)
    return graph


@given(
    every=st.lists(st.integers(1, 7), min_size=1, max_size=3).map(tuple),
    ticks=st.integers(1, 60),
    memory=st.integers(1, 400),
)
@examples(60)
def test_rows_on_disk_are_those_in_memory(every: tuple[int, ...], ticks: int, memory: int) -> None:
    graph = ramp(every, ticks * 0.01)
    whole, streamed = graph.run(), graph.set("run.memory", memory).run()
    for name, recorded in whole.probes.items():
        other = streamed.probes[name]
        assert np.array_equal(other.values, recorded.values)
        assert np.array_equal(other.t, recorded.t)
        np.testing.assert_array_equal(
            recorded.values, 3.0 * 0.5 ** np.arange(0, ticks, every[int(name[1:])])
        )


def test_buffers_fit_into_memory() -> None:
    graph = ramp((1, 4), 100.0)
    network, probes = graph.network, graph.observation.probes
    sizes = {name: probe.size(network.ticks) for name, probe in probes.items()}
    assert sizes == {"p0": 80_000, "p1": 20_000}
    assert buffer_rows(probes, network.ticks, 100_000) == {}
    gathered = buffer_rows(probes, network.ticks, 8_000)
    assert 8 * sum(gathered.values()) <= 8_000


def test_a_file_can_be_read_after_every_append(tmp_path: Path) -> None:
    stream = Stream(tmp_path / "x.npy", (2,))
    rows = np.arange(400.0).reshape(200, 2)
    for n in range(0, 200, 7):
        stream.append(rows[n : n + 7])
        assert np.array_equal(np.load(stream.path), rows[: n + 7])
    assert np.array_equal(stream.close(), rows)


def test_a_full_disk_ends_the_run_and_keeps_what_was_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    append = Stream.append

    def until_full(self: Stream, rows: np.ndarray) -> None:
        if self.rows + len(rows) > 50:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        append(self, rows)

    monkeypatch.setattr(Stream, "append", until_full)
    with pytest.raises(runtime.SimulationError, match="No space left on device; 48 rows of it are"):
        ramp((1,), 1.0).set("run.memory", 64).run()


def test_a_run_that_is_killed_leaves_files_that_can_be_read(script: Path, tmp_path: Path) -> None:
    (tmp_path / "g.yaml").write_text(ramp((1,), 1e6).to_yaml())
    command = [str(script), "run", "g.yaml", "--engine", "python", "--set", "run.memory=16K", "-q"]
    process = subprocess.Popen(command, cwd=tmp_path)
    try:
        found: list[Path] = []
        while not found or found[0].stat().st_size < 100_000:
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(timeout=0.05)
            found = list(tmp_path.glob("runs/ramp/.*.partial/recording/p0.npy"))
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    rows = np.load(found[0])
    assert len(rows) > 10_000
    expected = 3.0 * 0.5 ** np.arange(1000)
    np.testing.assert_array_equal(rows[:1000], expected)


def test_a_failure_keeps_the_rows_before_it() -> None:
    graph = ramp((1, 3), 1.0).set("run.memory", 100).set("blocks.half.gain", 1e30)
    with pytest.raises(runtime.SimulationError) as caught:
        graph.run()
    result: Any = caught.value.result
    assert result.ticks == 10
    np.testing.assert_allclose(result["p0"], 3.0 * 1e30 ** np.arange(10.0), rtol=1e-12)
    assert len(result["p1"]) == 4


def test_too_little_disk_is_reported_before_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    usage = type("Usage", (), {"free": 1000})
    monkeypatch.setattr("shutil.disk_usage", lambda folder: usage)
    with pytest.raises(runtime.UsageError, match=r"needs 31.25 KiB while it runs.*has 1000 B"):
        ramp((1,), 10.0).set("run.memory", 100).run()


@pytest.mark.parametrize("memory", ["lots", "0", "1.5G", "-3", "true", "12T"])
def test_an_invalid_memory_size_is_reported(cli, tmp_path: Path, memory: str) -> None:
    (tmp_path / "g.yaml").write_text(ramp((1,), 1.0).to_yaml())
    done = cli("validate", "g.yaml", "--set", f"run.memory={memory}")
    assert done.returncode == 2
    assert "run.memory: expected a size in bytes for recordings, such as 512M" in done.stderr
