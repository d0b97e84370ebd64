"""Sessions that follow an edited graph, rows that stream, snapshots without rows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from runtime.engine.recorder import PART, Rows
from runtime.errors import GraphError, SimulationError, UsageError
from runtime.graph import open_session
from tests.runtime.sessions.test_session import ENGINES, SERVO, same, servo


def edited(**changes: Any) -> runtime.Graph:
    return runtime.load(json.loads(json.dumps({**SERVO, **changes})))


def with_block(name: str, **changes: Any) -> runtime.Graph:
    blocks = {key: dict(entry) for key, entry in SERVO["blocks"].items()}
    blocks[name] = {**blocks.get(name, {}), **changes}
    return edited(blocks=blocks)


@pytest.mark.parametrize("engine", ENGINES)
def test_rows_stream_without_gaps_or_repetitions(engine: str) -> None:
    session = servo(engine)
    streamed: dict[str, list[Any]] = {}
    for ticks in (1, 7, 30, 1, 2000):
        since = session.tick
        session.step(ticks)
        for name, (times, rows) in session.rows(since).items():
            assert len(times) == len(rows)
            streamed.setdefault(name, []).append((times, rows))
    result = session.result()
    for name, parts in streamed.items():
        assert np.array_equal(np.concatenate([t for t, _ in parts]), result.time(name))
        assert np.array_equal(np.concatenate([r for _, r in parts]), result[name])


def test_rows_that_are_kept_only() -> None:
    session = runtime.load(SERVO).session(keep=0.1).step(5000)
    times, rows = session.rows(0)["x"]
    assert len(times) == len(rows) == 100
    assert times[-1] == session.result().time("x")[-1]


@given(st.lists(st.integers(1, 9000), min_size=1, max_size=12), st.integers(0, 40_000))
def test_parts_of_rows_have_an_end(sizes: list[int], row: int) -> None:
    kept = Rows(())
    for size in sizes:
        kept.append(np.arange(kept.rows, kept.rows + size, dtype=float))
    everything = np.arange(sum(sizes), dtype=float)
    assert np.array_equal(kept.close(), everything)
    assert np.array_equal(kept.since(row)[1], everything[min(row, len(everything)) :])
    assert np.array_equal(np.concatenate([np.empty(0), *kept.before(row)[0]]), everything[:row])
    assert all(part.nbytes <= max(PART, 8 * max(sizes)) for part in kept.parts)
    # Few of them: as many as are full, and some that double.
    assert len(kept.parts) <= 2 * sum(sizes) * 8 / PART + 20


@pytest.mark.parametrize("engine", ENGINES)
def test_a_number_changes_in_the_running_engine(engine: str) -> None:
    session, other = servo(engine).step(20), servo(engine).step(20)
    before = session._engine
    became = session.become(with_block("gain", gain=3.0).set("run.engine", engine))
    other.set("blocks.gain.gain", 3.0)
    assert became.numbers == ("blocks.gain.gain",)
    assert set(became.kept) >= {"gain", "x"} and not became.begun
    assert session._engine is before and str(session.log[0]) == str(other.log[0])
    assert not same(session.step(40).result(), other.step(40).result())


@pytest.mark.parametrize("engine", ENGINES)
def test_another_structure_is_one_change_that_is_replayed(engine: str, tmp_path: Path) -> None:
    session = servo(engine).step(20)
    x = session.read("x.out")
    graph = with_block("twice", type="Gain", gain=2.0)
    wires = {**graph.to_dict()["wires"], "twice": {"input": "x.out"}}
    graph = runtime.load({**graph.to_dict(), "wires": wires})
    graph = graph.set("probes.twice", "twice.out").set("noise.density", 0.02)
    became = session.become(graph)
    assert became.begun == ("twice",) and "x" in became.kept and not became.gone
    assert session.read("x.out") == x
    assert [change.call for change in session.log] == ["overlay"]
    assert session.become(runtime.load(SERVO)).gone == ("twice",)
    session.step(20).save(tmp_path / "s")
    assert not same(open_session(tmp_path / "s").result(), session.result())


def test_a_wrong_graph_changes_nothing() -> None:
    session = servo().step(5)
    with pytest.raises(GraphError):
        session.become(with_block("gain", gain="x"))
    with pytest.raises(UsageError, match=r"run\.dt"):
        session.become(edited(run={**SERVO["run"], "dt": 0.002}))
    assert not session.log and session.tick == 5
    assert session.become(session.graph).begun == ()


FAILING = {
    "graph": "root",
    "run": {"dt": 0.1, "until": 5, "engine": "python"},
    "blocks": {
        "t": {"type": "Ramp", "slope": -1.0, "initial": 1.0},
        "sum": {"type": "DiscreteIntegrator"},
        "root": {"type": "Function", "expression": "sqrt(u)"},
    },
    "wires": {"root": {"u": "t.out"}, "sum": {"input": "t.out"}},
    "probes": {"t": "t.out", "sum": "sum.out"},
}


def test_a_failed_session_is_repaired_by_an_edit() -> None:
    first = runtime.load(FAILING)
    session = first.session()
    with pytest.raises(SimulationError):
        session.run(5)
    failed_at = session.tick
    plain = first.to_dict()
    plain["blocks"]["root"]["expression"] = "sqrt(abs(u))"
    session.become(runtime.load(plain))
    assert session.tick == failed_at
    session.run(5 - session.t)
    assert not same(session.result(), runtime.load(plain).run())


@pytest.mark.parametrize("engine", ENGINES)
def test_a_snapshot_without_rows_has_the_bits_of_one_with_them(engine: str) -> None:
    session = servo(engine).step(50)
    small, whole = session.snapshot(rows=False), session.snapshot()
    session.step(70)
    end = session.result()
    for saved in (small, whole, small):
        session.restore(saved)
        assert session.tick == 50
        assert not same(session.step(70).result(), end)


def test_a_snapshot_without_rows_of_another_course_begins_its_recordings() -> None:
    session = servo().step(50)
    early = session.snapshot(rows=False)
    session.step(30)
    late = session.snapshot(rows=False)
    session.restore(early)
    session.set("gain.gain", 9.0)
    session.step(60)
    session.restore(late)  # what is recorded at 50 to 80 has another gain
    assert session.tick == 80 and len(session.rows(0)["x"][0]) == 0
    times, _ = session.step(10).rows(0)["x"]
    assert times[0] == pytest.approx(0.08) and len(times) == 10
    session.restore(early)
    branch = session.branch()
    branch.step(20)
    later = branch.snapshot(rows=False)
    session.step(90)
    session.restore(later)
    assert len(session.rows(0)["x"][0]) == 0


def test_snapshots_without_rows_are_small() -> None:
    session = servo().step(10)
    saved = [session.step(50).snapshot(rows=False) for _ in range(20)]
    assert all(not parts for each in saved for parts, *_ in each.carried.recording.values())


def test_what_was_prepared_is_what_the_session_becomes() -> None:
    session, other = servo("compiled").step(30), servo("compiled").step(30)
    graph = with_block("gain", gain=3.0, dt=0.002)
    session.prepare(graph)
    assert not session.log and session.tick == 30
    session.become(graph)
    other.become(graph)
    assert not same(session.step(60).result(), other.step(60).result())
