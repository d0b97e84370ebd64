"""Workers that die, hang and come back; points sent a bounded number at a time."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, wait
from typing import Any

import pytest

from runtime.errors import UsageError
from runtime.experiments import pool as pools
from runtime.experiments.nursery import THREADS
from runtime.experiments.points import Point, Recipe, Setting
from runtime.experiments.pool import Crew, LocalPool, local_crew
from runtime.experiments.runner import run_points
from runtime.experiments.worker import Done, Task


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def nap() -> int:
    threading.Event().wait(0.3)
    return os.getpid()


def hang() -> None:
    threading.Event().wait()


@pytest.fixture
def pool() -> Iterator[LocalPool]:
    made = LocalPool(2).check()
    yield made
    made.kill()


def test_a_death_costs_one_call_and_the_worker_is_replaced(pool: LocalPool) -> None:
    before = {slot.pid.result() for slot in pool._idle if slot is not None}
    lost = pool.submit(die)
    beside = pool.submit(os.getpid)
    with pytest.raises(BrokenExecutor):
        lost.result()
    assert beside.result() in before
    # Both workers are busy at once, the one that was there and the one that came.
    together = [pool.submit(nap) for _ in range(2)]
    after = {future.result() for future in together}
    assert len(after) == 2
    assert len(after & before) == 1


def test_a_worker_that_hangs_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pools, "GRACE", 0.0)
    made = LocalPool(1, limit=0.2).check()
    try:
        with pytest.raises(TimeoutError, match=r"killed after 0\.2 s, stuck inside a block"):
            made.submit(hang).result()
        assert made.submit(os.getpid).result() > 0
    finally:
        made.kill()


def test_workers_have_one_thread_each_and_leave_our_environment_alone(pool: LocalPool) -> None:
    before = {name: os.environ.get(name) for name in THREADS}
    seen = [pool.submit(os.getenv, name).result() for name in THREADS]
    assert seen == ["1"] * len(THREADS)
    assert {name: os.environ.get(name) for name in THREADS} == before


def test_a_pool_that_is_killed_ends_what_runs() -> None:
    made = LocalPool(1).check()
    future = made.submit(hang)
    made.kill()
    with pytest.raises(BrokenExecutor):
        future.result()
    with pytest.raises(RuntimeError, match="the pool is closed"):
        made.submit(os.getpid)


def point(number: int) -> Point:
    return Point(number, Setting(number, (str(number),), Recipe("g")), 0)


class Fake(Executor):
    """Answers calls when it is told to; counts how many wait."""

    def __init__(self, answer: Callable[[Task, int], Any]) -> None:
        self.answer = answer
        self.most = 0
        self.open: list[Future[Any]] = []
        self.tries: dict[int, int] = {}

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        task: Task = args[0]
        number = task.point.number
        self.tries[number] = self.tries.get(number, 0) + 1
        future: Future[Any] = Future()
        self.open = [other for other in self.open if not other.done()] + [future]
        self.most = max(self.most, len(self.open))
        answer = self.answer(task, self.tries[number])
        if isinstance(answer, BaseException):
            future.set_exception(answer)
        else:
            future.set_result(answer)
        return future


def crew(executor: Executor, width: int = 3) -> Crew:
    return Crew(executor, lambda: width, lambda finished: None, (BrokenExecutor,))


def test_points_are_taken_as_workers_become_free() -> None:
    taken = 0

    def points() -> Iterator[Point]:
        nonlocal taken
        for number in range(10**9):
            taken += 1
            yield point(number)

    ended = run_points(points(), crew(Fake(lambda task, tries: Done("ok"))), Task)
    for count in range(1, 2000):
        next(ended)
        assert taken - count <= 3


def test_a_point_is_tried_twice_and_no_more() -> None:
    def answer(task: Task, tries: int) -> Any:
        number = task.point.number
        if number == 2 or (number == 1 and tries == 1):
            return BrokenExecutor("gone")
        return Done("ok")

    fake = Fake(answer)
    ended = {p.number: done for p, done in run_points(map(point, range(4)), crew(fake), Task)}
    assert {number: done.status for number, done in ended.items()} == {
        **dict.fromkeys((0, 1, 3), "ok"),
        2: "lost",
    }
    assert fake.tries == {0: 1, 1: 2, 2: 2, 3: 1}
    assert ended[2].reason == "its worker died, 2 times (BrokenExecutor)"


def test_workers_that_cannot_run_points_end_the_sweep() -> None:
    fake = Fake(lambda task, tries: ModuleNotFoundError("No module named 'runtime'"))
    with pytest.raises(UsageError, match="the workers cannot run points: ModuleNotFoundError"):
        list(run_points(map(point, range(4)), crew(fake), Task))


def test_a_time_out_is_an_answer() -> None:
    fake = Fake(lambda task, tries: TimeoutError("killed after 1 s"))
    [(_, done)] = run_points(map(point, range(1)), crew(fake), Task)
    assert (done.status, done.reason) == ("timeout", "killed after 1 s")


def test_a_local_crew_finishes_and_leaves() -> None:
    made = local_crew(1, None)
    future = made.executor.submit(os.getpid)
    wait([future])
    made.leave(True)
    with pytest.raises(ProcessLookupError):
        os.kill(future.result(), 0)
