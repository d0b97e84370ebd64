"""Memory that own blocks keep undeclared: compared, replayed, branched and stored as a State is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runtime
from blocks import Block, Sine
from runtime.engine import adopt
from runtime.errors import UsageError
from runtime.runs.checkpoint import content, read_checkpoint
from tests.compilers import needs_compiler
from tests.runtime.engine import own_memory
from tests.runtime.engine.own_memory import COPIED, NOT_COPIED, SHARED, Compiled, Counts, Fails

TICKS = 60
pytestmark = [needs_compiler, pytest.mark.filterwarnings("ignore")]


def graph(kind: str, beside: Block | None) -> runtime.Graph:
    made = runtime.Graph("counts", dt=0.01, until=TICKS * 0.01).add("s", Sine())
    made = made.add("b", Counts(kind=kind)).connect("s.out", "b.x").probe("b.out")
    if beside is not None:
        made = made.add("z", beside).connect("s.out", "z.x").probe("z.out")
    return made


def assert_counts(rows: np.ndarray, first: int = 0) -> None:
    np.testing.assert_allclose(rows, first + np.arange(len(rows)), rtol=0, atol=1e-6)


@pytest.mark.parametrize("kind", COPIED + SHARED)
def test_nothing_is_counted_twice_beside_compiled_blocks(kind: str) -> None:
    for beside in (Compiled(), Fails()):
        made = graph(kind, beside)
        expected = made.run(engine="python")["b.out"]
        assert_counts(expected)
        result = made.run(engine="compiled")
        np.testing.assert_array_equal(result["b.out"], expected)
        ends = [note for note in result.notes if "under the Python engine" in note]
        assert len(ends) == isinstance(beside, Fails) and all("'z'" in note for note in ends)


@pytest.mark.parametrize("kind", NOT_COPIED)
def test_what_cannot_be_copied_is_not_compared_and_named(kind: str) -> None:
    result = graph(kind, Compiled()).run(engine="compiled")
    assert_counts(result["b.out"])
    (note,) = [text for text in result.notes if "compared" in text]
    assert "block 'b' keeps in state.kept what cannot be copied (" in note
    with pytest.raises(runtime.SimulationError, match="block 'b' keeps in state.kept"):
        graph(kind, Fails()).run(engine="compiled")
    session = graph(kind, None).session().step(3)
    for call in (session.branch, session.snapshot):
        with pytest.raises(UsageError, match="block 'b' keeps in state.kept what cannot be"):
            call()
    assert session.step().read("b.out") == 4.0


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("kind", COPIED)
def test_stepping_a_branch_changes_nothing_in_the_original(kind: str, engine: str) -> None:
    session = graph(kind, Compiled()).session(engine=engine).step(5)
    saved = session.snapshot()
    other = session.branch().step(20)
    assert_counts(session.step(10).result()["b.out"])
    assert_counts(other.step(5).result()["b.out"])
    for _ in range(2):
        session.restore(saved)
        assert_counts(session.step(7).result()["b.out"])
    session.set("s.amplitude", 2.0)  # in a new engine
    session.without("z")
    assert_counts(session.step(5).result()["b.out"])


@pytest.mark.parametrize("kind", SHARED)
def test_memory_that_all_runs_share_is_not_branched(kind: str) -> None:
    session = graph(kind, Compiled()).session()
    saved = session.snapshot()
    session.step(5)
    with pytest.raises(UsageError, match=r"block 'b' keeps memory in .*, which all runs share"):
        session.branch()
    if kind == "self":  # of the block, which a changed graph has anew
        with pytest.raises(UsageError, match="block 'b' keeps memory in its attribute 'self.own'"):
            session.without("z")
    else:
        session.without("z")
        session.run(2.0)  # beyond the end that was planned
    assert_counts(session.result()["b.out"])
    session.restore(saved)
    assert_counts(session.step(7).result()["b.out"])


@pytest.mark.parametrize("kind", SHARED)
def test_a_branch_that_changes_what_is_shared_is_noticed(kind: str) -> None:
    session = graph(kind, None).session()
    session.branch().step(3)
    with pytest.raises(UsageError, match="block 'b' keeps memory in .*which another run has chang"):
        session.step()


def test_constants_that_runs_share_stop_nothing() -> None:
    session = graph("declared", Compiled()).session().step(3)
    other = session.branch().step(3)
    assert_counts(session.step(4).result()["b.out"])
    assert_counts(other.step(2).result()["b.out"])


@pytest.mark.parametrize("kind", ["list", "helper", "closure", "class list", "generator"])
def test_a_checkpoint_holds_views_and_names_what_it_cannot(kind: str, tmp_path: Path) -> None:
    session = graph(kind, None).session().step(5)
    if kind == "list":  # `start` makes the same views again
        (tmp_path / "c.npz").write_bytes(content(session._engine))
        given, _ = read_checkpoint(tmp_path / "c.npz", session._engine.finish().arrays)
        other = graph(kind, None).session()
        adopt(other._engine, given)
        assert_counts(other.step(10).result()["b.out"])
        return
    with pytest.raises(UsageError, match="block 'b' keeps "):
        content(session._engine)


@pytest.mark.parametrize("kind", COPIED)
def test_reading_a_signal_changes_nothing(kind: str) -> None:
    session = graph(kind, None).session()
    for tick in range(3):
        assert round(session.read("b.out")) == round(session.read("b.out")) == tick
        session.step()


def test_globals_begin_as_they_were() -> None:
    own_memory.LOG[0] = 0.0
    graph("global list", Compiled()).run(engine="compiled")
    assert own_memory.LOG[0] == TICKS
