"""Workers behind the standard ``concurrent.futures.Executor``: processes here, or a cluster."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor
from dataclasses import dataclass, field
from typing import Any, ParamSpec, TypeVar

from runtime.errors import MissingExtraError, UsageError
from runtime.experiments.nursery import single_threaded, worker_context
from runtime.experiments.worker import prepare

P = ParamSpec("P")
T = TypeVar("T")
# A point ends itself when its time is up; only one that is stuck inside a block is killed.
GRACE = 3.0
PATIENCE = 10.0  # s; until a cluster's scheduler must have answered


@dataclass
class _Slot:
    """One worker process, in a pool of its own; made anew when it has died."""

    pool: ProcessPoolExecutor
    pid: Future[int]
    overdue: bool = False

    def kill(self) -> None:
        """End the process at once; whatever it was doing breaks off."""
        with contextlib.suppress(BrokenExecutor, ProcessLookupError):
            os.kill(self.pid.result(), signal.SIGKILL)


@dataclass
class LocalPool(Executor):
    """Worker processes on this machine.

    Each has a pool of its own, so that a worker that dies costs the one call that it was at:
    that call's future fails with ``BrokenExecutor``, or with ``TimeoutError`` where the worker
    was killed for the time it took, and another worker takes the place.

    Parameters
    ----------
    jobs : how many.
    limit : seconds after which a worker is killed; None for never.
    """

    jobs: int
    limit: float | None = None
    _idle: list[_Slot | None] = field(init=False, default_factory=list)
    _freed: threading.Condition = field(init=False, default_factory=threading.Condition)
    _closed: bool = field(init=False, default=False)
    _busy: dict[Future[Any], _Slot] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._context = worker_context()
        self._idle = [self._slot() for _ in range(self.jobs)]

    def _slot(self) -> _Slot:
        pool = ProcessPoolExecutor(1, self._context, initializer=prepare)
        with single_threaded():
            return _Slot(pool, pool.submit(os.getpid))

    def check(self) -> LocalPool:
        """Wait until all workers are there.

        Raises
        ------
        UsageError : they cannot start.
        """
        try:
            for slot in filter(None, self._idle):
                slot.pid.result()
        except BrokenExecutor:
            self.kill()
            raise UsageError(
                "the worker processes cannot start, for the reason above; in a script of your own, "
                "put the call under 'if __name__ == \"__main__\":'"
            ) from None
        return self

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Send a call to the next idle worker, waiting for one if need be."""
        with self._freed:
            self._freed.wait_for(lambda: self._idle or self._closed)
            if self._closed:
                raise RuntimeError("the pool is closed")
            slot = self._idle.pop() or self._slot()
        outer: Future[T] = Future()
        outer.set_running_or_notify_cancel()
        self._busy[outer] = slot
        timer: threading.Timer | None = None
        if self.limit is not None:
            timer = threading.Timer(self.limit + GRACE, self._end, (slot,))
            timer.daemon = True
            timer.start()
        inner = slot.pool.submit(fn, *args, **kwargs)
        inner.add_done_callback(lambda future: self._finished(slot, future, outer, timer))
        return outer

    def _end(self, slot: _Slot) -> None:
        slot.overdue = True
        slot.kill()

    def _finished(
        self, slot: _Slot, inner: Future[T], outer: Future[T], timer: threading.Timer | None
    ) -> None:
        if timer is not None:
            timer.cancel()
        error = inner.exception() if not inner.cancelled() else BrokenExecutor("cancelled")
        died = isinstance(error, BrokenExecutor)
        with self._freed:
            self._busy.pop(outer, None)
            if not self._closed:
                self._idle.append(None if died else slot)
            self._freed.notify()
        if died and slot.overdue:
            error = TimeoutError(f"killed after {self.limit:g} s, stuck inside a block")
        if error is None:
            outer.set_result(inner.result())
        else:
            outer.set_exception(error)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let the workers finish what they are at, and go."""
        slots = self._close()
        for slot in slots:
            slot.pool.shutdown(wait=wait, cancel_futures=cancel_futures)

    def kill(self) -> None:
        """End all workers at once."""
        slots = self._close()
        for slot in slots:
            slot.kill()
        for slot in slots:
            slot.pool.shutdown(wait=True, cancel_futures=True)

    def _close(self) -> list[_Slot]:
        with self._freed:
            self._closed = True
            slots = [*filter(None, self._idle), *self._busy.values()]
            self._idle = []
            self._freed.notify_all()
        return slots


@dataclass(frozen=True)
class Crew:
    """An executor with what is to be known of it.

    Parameters
    ----------
    width : how many calls keep all of it busy.
    leave : ends it, at once unless all is done.
    deaths : what a call's future fails with when its worker has died.
    """

    executor: Executor
    width: Callable[[], int]
    leave: Callable[[bool], None]
    deaths: tuple[type[BaseException], ...]


def local_crew(jobs: int, timeout: float | None) -> Crew:
    """Workers on this machine."""
    pool = LocalPool(jobs, timeout)

    def leave(finished: bool) -> None:
        if finished:
            pool.shutdown()
        else:
            pool.kill()

    pool.check()
    return Crew(pool, lambda: jobs, leave, (BrokenExecutor,))


def cluster_crew(address: str) -> Crew:
    """The workers of a Dask cluster; those that come later are used as well.

    Raises
    ------
    MissingExtraError : dask.distributed is not installed.
    UsageError : no scheduler answers there.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise MissingExtraError("--scheduler", "cluster") from None
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise UsageError(f"--scheduler {address}: no scheduler answers there: {error}") from None
    executor: Executor = client.get_executor(pure=False)

    def leave(finished: bool) -> None:
        executor.shutdown(wait=finished)
        client.close()

    def width() -> int:
        return max(2, 2 * int(sum(client.nthreads().values())))

    return Crew(executor, width, leave, (KilledWorker, CancelledError))
