"""Supervised worker processes behind the standard ``concurrent.futures.Executor``.

One thread owns the workers. It never waits for a single one of them: it waits for whatever comes
first, an answer, part of one, or the end of a process. A worker may therefore die at any moment,
while it starts, idles, computes, or is half-way through sending what it found, and the process
that forks the workers may die as well: at most one call fails, with ``WorkerDied``, and another
worker takes the place.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import pickle
import resource
import selectors
import signal
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, ParamSpec, TypeVar

from runtime.errors import UsageError
from runtime.experiments.execution import forkserver as nurseries
from runtime.experiments.execution.forkserver import ForkServer
from runtime.experiments.execution.messages import Line

P = ParamSpec("P")
T = TypeVar("T")
# A point ends itself when its time is up; only one that is stuck inside a block is killed.
GRACE = 3.0
LONGEST_WAIT = 3600.0  # s; more than a selector may wait for at once is waited for in parts
SPARE_FILES = 32  # left to all else that this process opens
MOST_STARTS = 10  # so many workers beyond ``jobs`` may die while they start, one after another


class WorkerDied(BrokenExecutor):
    """A worker ended before it had answered; the message says how."""


@dataclass(frozen=True)
class _Call:
    future: Future[Any]
    message: bytes


@dataclass(eq=False)
class _Worker:
    """A process as the pool knows it.

    It is ``starting`` until it has reported with its ``pid``, then ``idle`` or ``busy``, and
    ``ending`` from when its line is closed until it is known how its process ended.
    """

    line: Line
    fork_server: ForkServer
    state: Literal["starting", "idle", "busy", "ending"] = "starting"
    pid: int = 0
    call: _Call | None = None
    due: float = math.inf
    is_overdue: bool = False


class LocalPool(Executor):
    """Worker processes on this machine, started as calls come in.

    A call's future fails with :class:`WorkerDied` if its worker ended, and with ``TimeoutError``
    if the worker was killed for the time that it took. Where the system allows fewer processes
    than ``jobs``, there are fewer; where it allows none, futures fail with ``UsageError``.

    Parameters
    ----------
    jobs : at most so many workers.
    limit : seconds after which a worker is killed; None for never.

    Raises
    ------
    UsageError : no process can be started.
    """

    def __init__(self, jobs: int, limit: float | None = None) -> None:
        self.jobs, self.limit = jobs, limit
        self.fork_server = nurseries.take()
        self._inbox: deque[_Call] = deque()
        self._queue: deque[_Call] = deque()
        self._workers: set[_Worker] = set()
        self._failed_starts = 0
        self._no_room = ""
        self._broken: UsageError | None = None
        self._closing: Literal["", "finish", "kill"] = ""
        self._selector = selectors.DefaultSelector()
        self._bell, self._rope = socket.socketpair()
        for end in (self._bell, self._rope):
            end.setblocking(False)
        self._selector.register(self._bell, selectors.EVENT_READ, self._rung)
        self._watch_nursery()
        self._thread = threading.Thread(target=self._supervise, daemon=True, name="pool")
        self._thread.start()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Send a call to the next worker that is idle."""
        if self._closing:
            raise RuntimeError("the pool is closed")
        future: Future[T] = Future()
        message = pickle.dumps((fn, args, kwargs), pickle.HIGHEST_PROTOCOL)
        self._inbox.append(_Call(future, message))
        self._ring()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let the workers finish what they are at, and go."""
        self._close("kill" if cancel_futures else "finish", wait)

    def kill(self) -> None:
        """End all workers at once; what they were at fails with :class:`WorkerDied`."""
        self._close("kill", wait=True)

    def _close(self, how: Literal["finish", "kill"], wait: bool) -> None:
        self._closing = how
        self._ring()
        if wait:
            self._thread.join()

    def _ring(self) -> None:
        """Wake the thread; a bell that rings already, or is gone, need not be rung."""
        with contextlib.suppress(OSError):
            self._rope.send(b"!")

    def _rung(self) -> None:
        self._bell.recv(4096)

    def _supervise(self) -> None:
        """What the thread does. All that concerns workers happens here."""
        try:
            while True:
                self._step()
                if self._closing and not (self._workers or self._queue or self._inbox):
                    return
                due = min((worker.due for worker in self._workers), default=math.inf)
                wait = min(due - time.monotonic(), LONGEST_WAIT)
                for key, _ in self._selector.select(max(0.0, wait)):
                    key.data()
        finally:
            self._leave()

    def _step(self) -> None:
        """Do what can be done without waiting."""
        while self._inbox:
            self._queue.append(self._inbox.popleft())
        if self._closing == "kill":
            self._fail_queue(WorkerDied("the pool was ended"))
        elif self._queue:
            self._assign()
        if self._closing and not self._queue:
            for worker in self._in("starting", "idle", *(["busy"] * (self._closing == "kill"))):
                self._hang_up(worker)
        now = time.monotonic()
        for worker in [worker for worker in self._workers if worker.due <= now]:
            worker.is_overdue, worker.due = True, math.inf
            worker.fork_server.kill(worker.pid)

    def _in(self, *states: str) -> list[_Worker]:
        return [worker for worker in self._workers if worker.state in states]

    def _assign(self) -> None:
        """Send calls to idle workers, and start more workers where these are not enough."""
        for worker in self._in("idle"):
            if self._queue:
                self._send(worker, self._queue.popleft())
        for _ in range(len(self._queue) - len(self._in("starting"))):
            if self._broken is None and len(self._workers) < self.jobs:
                self._start()
        if self._broken is not None:
            self._fail_queue(self._broken)

    def _send(self, worker: _Worker, call: _Call) -> None:
        if not call.future.set_running_or_notify_cancel():
            return
        worker.state, worker.call = "busy", call
        if self.limit is not None:
            worker.due = time.monotonic() + self.limit + GRACE
        worker.line.send(call.message)
        self._watch(worker)

    def _watch(self, worker: _Worker) -> None:
        """Wait for what a worker sends, and for room to send it the rest of its call."""
        events = selectors.EVENT_READ | (0 if worker.line.is_clear else selectors.EVENT_WRITE)
        self._selector.modify(worker.line.link, events, partial(self._hear, worker))

    def _start(self) -> None:
        """Ask for another worker."""
        try:
            if not self.fork_server.is_alive:
                self.fork_server = ForkServer()
                self._watch_nursery()
            line = Line(self.fork_server.fork())
        except OSError as error:
            self._has_no_room(str(error.strerror))
            return
        except UsageError as error:
            self._broken = error
            return
        if self._workers and line.link.fileno() >= _file_limit() - SPARE_FILES:
            line.close()
            self._has_no_room(os.strerror(errno.EMFILE))
            return
        worker = _Worker(line, self.fork_server)
        self._workers.add(worker)
        self._selector.register(line.link, selectors.EVENT_READ, partial(self._hear, worker))

    def _has_no_room(self, reason: str) -> None:
        """The system allows no more processes: go on with those that are there."""
        self._no_room = reason
        self.jobs = max(1, len(self._workers))
        if not self._workers:
            self._break(reason)

    def _break(self, reason: str) -> None:
        self._broken = UsageError(f"cannot start worker processes: {reason}")

    def _hear(self, worker: _Worker) -> None:
        """Take in what a worker has sent."""
        if worker.state == "ending" or worker not in self._workers:
            return  # its end was seen just before
        worker.line.flush()
        messages, is_over = worker.line.receive()
        for message in messages:
            if worker.state == "starting":
                worker.state, worker.pid = "idle", pickle.loads(message)
                self._failed_starts = 0
            else:
                self._answer(worker, message)
        if is_over:
            self._hang_up(worker)
        else:
            self._watch(worker)

    def _answer(self, worker: _Worker, message: bytes) -> None:
        call, worker.call = worker.call, None
        worker.state, worker.due = "idle", math.inf
        if call is None:
            return
        try:
            value, error = pickle.loads(message)
        except Exception as failure:  # noqa: BLE001 -- a class of the caller's own may do anything
            value, error = None, failure
        if error is None:
            call.future.set_result(value)
        else:
            call.future.set_exception(error)

    def _hang_up(self, worker: _Worker) -> None:
        """Close a worker's line, and see to it that the process ends."""
        was, worker.state, worker.due = worker.state, "ending", math.inf
        self._selector.unregister(worker.line.link)
        worker.line.close()
        if was == "starting":
            self._count_failed_start()
            self._workers.discard(worker)
        elif worker.fork_server.is_alive:
            worker.fork_server.kill(worker.pid)  # and wait for the report
        else:
            if self._closing:
                worker.fork_server.kill(worker.pid)
            self._bury(worker, "its process ended")

    def _count_failed_start(self) -> None:
        self._failed_starts += 1
        if self._failed_starts > self.jobs + MOST_STARTS and not self._in("idle", "busy"):
            self._break(self._no_room or "each one ends as it starts")

    def _bury(self, worker: _Worker, how: str) -> None:
        """Let a worker go whose process has ended, and fail what it was at."""
        self._workers.discard(worker)
        if worker.call is None:
            return
        error: Exception = WorkerDied(how)
        if worker.is_overdue:
            error = TimeoutError(f"killed after {self.limit:g} s, stuck inside a block")
        worker.call.future.set_exception(error)

    def _watch_nursery(self) -> None:
        listen = partial(self._hear_nursery, self.fork_server)
        self._selector.register(self.fork_server.control, selectors.EVENT_READ, listen)

    def _hear_nursery(self, fork_server: ForkServer) -> None:
        """Take in which workers have ended; without a nursery, their lines alone can tell."""
        for pid, status in fork_server.reports():
            if not pid:
                self._has_no_room(os.strerror(status))
                continue
            for worker in [
                w for w in self._workers if w.pid == pid and w.fork_server is fork_server
            ]:
                # A child of the worker's own may hold its line open.
                self._hear(worker)
                if worker.state != "ending":
                    self._hang_up(worker)
                self._bury(worker, _ending(status))
        if not fork_server.is_alive:
            self._selector.unregister(fork_server.control)
            for worker in self._in("ending"):
                if worker.fork_server is fork_server:
                    self._bury(worker, "its process ended")

    def _fail_queue(self, error: Exception) -> None:
        while self._queue:
            future = self._queue.popleft().future
            if future.set_running_or_notify_cancel():
                future.set_exception(error)

    def _leave(self) -> None:
        """Let go of everything; nobody is left waiting for an answer."""
        self._closing = "kill"
        self._queue += self._inbox
        self._fail_queue(WorkerDied("the pool was ended"))
        for worker in list(self._workers):
            worker.line.close()
            self._bury(worker, "the pool was ended")
        self._selector.close()
        self._bell.close()
        self._rope.close()
        if self.fork_server.is_alive:
            nurseries.give_back(self.fork_server)


def _file_limit() -> float:
    """How many files this process may have open."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return math.inf if soft == resource.RLIM_INFINITY else soft


def _ending(status: int) -> str:
    """How a process ended, from its wait status."""
    code = os.waitstatus_to_exitcode(status)
    if code >= 0:
        return f"its process ended with exit code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    return f"its process was killed by {name}"
