"""Interrupts within a tick, and calls from several threads: said in a sentence, never half done."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from runtime.errors import SimulationError, UsageError
from tests.compilers import needs_compiler

ENGINES = ["python", pytest.param("compiled", marks=needs_compiler)]
HALF = "interrupted within it, so that a part of it is done; restore a snapshot to go on"
# What blocks do at some tick, by the name that a block has of it.
DOES: dict[str, Callable[[], None]] = {}


class Calls(blocks.Block):
    """Calls a function at t = 0.36 s, in the middle of a tick."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Scalar)
    total = blocks.State()
    method: str = blocks.param("update", doc="where")

    def output(self, state: Any, t: float, x: float) -> float:
        if self.method == "output" and round(t, 6) == 0.36:
            DOES["call"]()
        return float(state.total)

    def update(self, state: Any, t: float, x: float) -> None:
        state.total += x
        if self.method == "update" and round(t, 6) == 0.36:
            DOES["call"]()


def graph(method: str = "update") -> runtime.Graph:
    """Its integral of 2 over 1 s is 2, to rounding; 'after' integrates later in a tick."""
    made = runtime.Graph("torn", dt=0.01, until=1.0).add("one", blocks.Constant(value=2.0))
    made = made.add("b", Calls(method=method)).connect("one.value", "b.x")
    for name in ("after", "before"):
        made = made.add(name, blocks.Integrator()).connect("one.value", f"{name}.input")
    return made.probe("after.out").probe("before.out").probe("b.out")


def interrupt() -> None:
    DOES["call"] = lambda: None
    raise KeyboardInterrupt


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", ["output", "update"])
def test_an_interrupt_within_a_tick_leaves_a_failed_session(method: str, engine: str) -> None:
    DOES["call"] = lambda: None
    whole = graph(method).run(engine=engine)
    session = graph(method).session(engine=engine).step(20)
    saved = session.snapshot()
    DOES["call"] = interrupt
    with pytest.raises(KeyboardInterrupt):
        session.run(0.8)
    assert session.tick == 36
    calls: list[Callable[[], Any]] = [
        *(session.step, session.snapshot, session.branch, lambda: session.read("after.out")),
        *(lambda: session.set("one.value", 3.0), lambda: session.without("b")),
    ]
    for call in calls:
        with pytest.raises(SimulationError) as caught:
            call()
        assert str(caught.value) == f"block 'b' at tick 36 (t = 0.36 s): {HALF}"
    result = session.result()
    assert result.manifest["status"] == "failed"
    np.testing.assert_array_equal(result["after.out"], whole["after.out"][:36])
    session.restore(saved)
    session.run(0.8)
    for name in ("after.out", "before.out", "b.out"):
        np.testing.assert_array_equal(session.result()[name], whole[name])


def test_a_change_that_is_interrupted_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    DOES["call"] = lambda: None
    session = graph().session().step(5)
    saved = session.snapshot()
    with monkeypatch.context() as patch:
        patch.setattr("runtime.sessions.session.adopt_changed", lambda *given: interrupt())
        with pytest.raises(KeyboardInterrupt):
            session.without("after")
    with pytest.raises(SimulationError, match="interrupted"):
        session.step()
    session.restore(saved)
    assert session.step().tick == 6


@pytest.mark.parametrize("engine", ENGINES)
def test_calls_from_another_thread_are_refused_while_one_is_inside(engine: str) -> None:
    DOES["call"] = lambda: None
    whole = graph().run(engine=engine)
    session = graph().session(engine=engine)
    is_inside, may_go_on = threading.Event(), threading.Event()

    def wait() -> None:
        is_inside.set()
        assert may_go_on.wait(30.0)

    DOES["call"] = wait
    runs = threading.Thread(target=session.step, args=(100,))
    runs.start()
    try:
        assert is_inside.wait(30.0)
        calls: list[Callable[[], Any]] = [
            *(session.step, session.snapshot, session.branch, session.result),
            *(lambda: session.read("after.out"), lambda: session.set("one.value", 3.0)),
        ]
        for call in calls:
            with pytest.raises(UsageError, match="another call of this session has not returned"):
                call()
    finally:
        DOES["call"] = lambda: None
        may_go_on.set()
        runs.join()
    assert session.tick == 100
    np.testing.assert_array_equal(session.result()["after.out"], whole["after.out"])


def test_a_block_that_calls_back_is_refused() -> None:
    session = graph().session()

    def back() -> None:
        with pytest.raises(UsageError, match="read: another call of this session has not returned"):
            session.read("after.out")
        session.step()

    DOES["call"] = back
    with pytest.raises(SimulationError, match="block 'b' at tick 36 .*step: another call of this"):
        session.step(100)
