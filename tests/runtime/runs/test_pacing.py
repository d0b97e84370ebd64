"""Runs in real time, by a clock that stands still unless someone waits or computes."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from runtime.document import TIME_UNITS
from runtime.engine import Engine
from runtime.reports import report
from runtime.runs import Pacing, pacing_text, simulate
from runtime.runs.pacing import OVERRUNS, SPIN_NS, UNITS
from tests.conftest import Run
from tests.runtime.sessions.test_session import ENGINES, SERVO, same

MS = 1_000_000


class Clock:
    """Whoever sleeps wakes up when it is due, or so much later (ns)."""

    def __init__(self, jitter: Sequence[int] = ()) -> None:
        self.time, self.jitter, self.looks = 0, list(jitter), 0

    def now(self) -> int:
        self.looks += 1
        self.time += 1000 * (self.looks > 1000)  # for a loop that waits without sleeping
        return self.time

    def sleep(self, seconds: float) -> None:
        self.looks = 0
        self.time += round(1e9 * seconds) + SPIN_NS + (self.jitter.pop(0) if self.jitter else 0)


def test_a_session_waits_for_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    made = partial(Pacing, now=clock.now, sleep=clock.sleep)
    monkeypatch.setattr("runtime.sessions.session.Pacing", made)
    session = runtime.load(SERVO).session()
    assert "real_time" not in session.result().manifest
    session.run(0.05).run(0.2, real_time=True, speed=2.0).step(10)  # beyond run.until
    figures = session.result().manifest["real_time"]
    # The first tick does not wait; periods are of 2 ticks, of 1 ms by the clock.
    assert (figures["speed"], figures["periods"], figures["overruns"]) == (2.0, 100, 0)
    assert clock.time == pytest.approx(0.1 * 1e9, rel=0.02)
    assert same(session.result(), runtime.load(SERVO).run(until=0.26)) == []
    with pytest.raises(runtime.UsageError, match="speed: .* add real_time=True"):
        session.run(0.1, speed=2.0)
    with pytest.raises(runtime.UsageError, match="expected a speed above 0, got -1"):
        session.run(0.1, real_time=True, speed=-1.0)


def paced(clock: Clock, costs: Sequence[int], dt: float = 1e-3, **options: Any) -> Pacing:
    """A run whose ticks after the first take so long (ns)."""
    network = SimpleNamespace(dt=dt, time_unit=options.pop("time_unit", "s"))
    engine = SimpleNamespace(network=network, state=SimpleNamespace(tick=0), is_stopped=False)

    def advance(last: int, progress: object) -> None:
        clock.time += sum(costs[k - 1] for k in range(engine.state.tick, last) if k)
        engine.state.tick = last

    engine.advance = advance
    pacing = Pacing(**options, now=clock.now, sleep=clock.sleep)
    pacing.advance(cast("Engine", engine), len(costs) + 1)
    assert engine.state.tick == len(costs) + 1
    return pacing


# Quarters of a period, so that a wait is none or longer than what is spent in a loop.
COSTS = st.lists(st.integers(0, 14).map(lambda n: n * MS // 4), min_size=1, max_size=40)


@given(COSTS)
def test_catching_up_is_a_queue_with_regular_arrivals(costs: list[int]) -> None:
    """Lindley's recursion: waiting times of a queue to which one customer comes each period."""
    waits = [0]
    for cost in costs:
        waits.append(max(0, waits[-1] + cost - MS))
    found = paced(Clock(), costs)
    assert found.late.tolist() == waits[:-1]
    assert found.overruns == sum(wait > 0 for wait in waits[1:])
    assert found.behind == waits[-1]
    assert found.skipped == 0


@given(COSTS)
def test_skipping_begins_every_tick_on_a_multiple_of_the_period(costs: list[int]) -> None:
    clock = Clock()
    found = paced(clock, costs, overrun="skip")
    assert not found.late.any()
    lengths = [max(1, -(-cost // MS)) for cost in costs]
    assert found.skipped == sum(lengths) - len(costs)
    assert found.overruns == sum(length > 1 for length in lengths)
    assert clock.time == MS * (1 + sum(lengths[:-1])) + costs[-1]


def test_late_ticks_are_counted_by_rank() -> None:
    jitter = np.random.default_rng(1).permutation(np.arange(1, 1001)) * 1000
    figures = paced(Clock(jitter.tolist()), [0] * 1000, dt=0.01).figures()
    expected = {"p50": 500e-6, "p99": 990e-6, "p99_9": 999e-6, "worst": 1e-3}
    assert figures["late_s"] == pytest.approx(expected, rel=1e-12)
    assert figures["periods"] == 1000
    assert figures["overruns"] == 0
    text = pacing_text(figures)
    assert "1000 periods of 10 ms" in text
    assert "500 µs (50 %), 990 µs (99 %), 999 µs (99.9 %), 1 ms (worst)" in text


@pytest.mark.parametrize(
    ("dt", "unit", "speed", "ticks"),
    [
        *((0.02, "s", 1.0, 1), (0.02, "s", 2.0, 1), (1e-3, "s", 0.5, 1), (1e-3, "s", 4.0, 4)),
        *((1e-4, "s", 1.0, 10), (7e-4, "s", 1.0, 1), (2.0, "ms", 1.0, 1), (0.5, "h", 3.6e6, 2)),
    ],
)
def test_ticks_of_less_than_a_millisecond_run_together(
    dt: float, unit: str, speed: float, ticks: int
) -> None:
    clock, number = Clock(), 203
    found = paced(clock, [0] * number, dt, speed=speed, time_unit=unit)
    assert found.ticks == ticks
    assert found.periods_done == -(-number // ticks)
    assert not found.late.any()
    last = 1 + ticks * (found.periods_done - 1)  # the first tick of the last period
    assert clock.time == pytest.approx(1e9 * UNITS[unit] * last * dt / speed, abs=2)


def test_units_are_those_of_graphs() -> None:
    assert UNITS.keys() == TIME_UNITS.keys()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("overrun", OVERRUNS)
@pytest.mark.parametrize(("dt", "skipped"), [(1e-3, 2), (1e-4, 4 + 1)])
def test_recordings_are_those_of_a_run_that_does_not_wait(
    engine: str, overrun: str, dt: float, skipped: int
) -> None:
    graph = runtime.load(SERVO).set("run.engine", engine).set("run.dt", dt)
    clock = Clock([5 * MS, 0, 0, 2 * MS])
    pacing = Pacing(0.5, overrun, now=clock.now, sleep=clock.sleep)
    found = simulate(graph.prepared(), pacing=pacing)
    assert same(found, graph.run()) == []
    assert found.manifest["real_time"]["overruns"] > 0
    assert found.manifest["real_time"]["skipped"] == (skipped if overrun == "skip" else 0)


def test_a_stop_and_an_interrupt_end_it() -> None:
    def interrupt(seconds: float) -> None:
        clock.sleep(seconds)
        if clock.time > 30 * MS:
            raise KeyboardInterrupt

    for engine in ENGINES:
        clock = Clock()
        graph = runtime.load(SERVO).set("run.engine", engine)
        pacing = Pacing(now=clock.now, sleep=interrupt)
        found = simulate(graph.prepared(), pacing=pacing)
        assert (found.status, found.ticks, pacing.periods_done) == ("interrupted", 31, 30)
        assert len(found["x"]) == 31
        graph = graph.set("run.stop", {"when": "x.out", "above": 1.01})
        clock = Clock()
        pacing = Pacing(now=clock.now, sleep=clock.sleep)
        stopped = simulate(graph.prepared(), pacing=pacing)
        assert stopped.status == "stopped"
        assert stopped.ticks - 1 == pacing.periods_done < 100
        assert same(stopped, graph.run()) == []


def test_a_run_of_one_tick_has_no_figures() -> None:
    figures = paced(Clock(), []).figures()
    assert set(figures["late_s"].values()) == {None}
    assert "ended before its second tick" in pacing_text(figures)


@pytest.mark.skipif(sys.platform != "linux", reason="SCHED_FIFO is a policy of Linux")
def test_priority_is_taken_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[int, int]] = []

    def take(process: int, policy: int, given: os.sched_param) -> None:
        calls.append((policy, given.sched_priority))

    monkeypatch.setattr(os, "sched_setscheduler", take)
    found = paced(Clock(), [0], priority=True)
    assert calls == [(os.SCHED_FIFO, 50), (os.SCHED_OTHER, 0)]
    assert (found.policy, found.notes) == ("SCHED_FIFO 50", [])


def refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse, raising=False)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (refused, "SCHED_FIFO was refused (Operation not permitted); allow it by 'rtprio 50'"),
        (lambda patch: patch.setattr(sys, "platform", "darwin"), "this system has no SCHED_FIFO"),
    ],
)
def test_a_run_without_priority_says_so(
    make: Callable[[pytest.MonkeyPatch], None], text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if make is refused and sys.platform != "linux":
        pytest.skip("SCHED_FIFO is a policy of Linux")
    with monkeypatch.context() as patch:
        make(patch)
        found = paced(Clock(), [0], priority=True)
    assert found.policy == "normal"
    (note,) = found.notes
    assert note.startswith("ran with normal priority: ")
    assert text in note


@pytest.mark.parametrize("options", [{"speed": 0.0}, {"speed": float("nan")}, {"overrun": "drop"}])
def test_a_wrong_option_is_refused(options: dict[str, Any]) -> None:
    with pytest.raises(runtime.UsageError, match=r"expected (a speed above 0|catch-up or skip)"):
        Pacing(**options)


def test_the_command_has_the_figures(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "servo.yaml").write_text(json.dumps(SERVO), encoding="utf-8")
    run = partial(cli, "run", "servo.yaml", "--no-plots", cwd=tmp_path)
    found = json.loads(run("--real-time", "--speed", "20", "--overrun", "skip", "--json").stdout)
    figures = found["real_time"]
    assert (figures["speed"], figures["overrun"], figures["ticks_per_period"]) == (20, "skip", 20)
    assert runtime.open(tmp_path / found["run"]).manifest["real_time"] == figures
    assert same(runtime.open(tmp_path / found["run"]), runtime.load(SERVO).run()) == []
    text = run("--real-time", "--speed", "20").stdout
    assert "real time, speed 20, normal priority: 5 periods of 1 ms began late by" in text
    wrong = run("--speed", "2")
    assert wrong.returncode == 2
    assert "--speed: is for runs that wait for the clock; add --real-time" in wrong.stderr


@pytest.mark.slow
def test_the_report_has_the_figures(tmp_path: Path) -> None:
    pacing = Pacing(speed=100.0)
    simulate(runtime.load(SERVO).prepared(), pacing=pacing).save(tmp_path / "run")
    assert pacing_text(pacing.figures()) in report(tmp_path / "run").html
