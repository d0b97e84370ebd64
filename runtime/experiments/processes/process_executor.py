"""Supervised worker processes behind the standard ``concurrent.futures.Executor``.

In: calls. Out: a future each, which fails with ``WorkerDied`` if its worker did::

    ProcessExecutor(2).submit(os.getpid).result()  ->  4711

One thread owns the workers. It never waits for a single worker: it waits for the first event of
any of them, an answer, part of one, or the end of a process. A worker may therefore die at any
moment, while it starts, idles, computes, or sends its answer, and the fork server may die as
well: at most one call fails, with ``WorkerDied``, and another worker replaces the dead one.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import importlib
import math
import os
import pickle
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
from runtime.experiments.processes import choice
from runtime.experiments.processes.messages import MessageChannel
from runtime.experiments.processes.starter import Starter, cannot_start

P = ParamSpec("P")
T = TypeVar("T")
# A trial ends itself at its time limit; only one that is stuck inside a block is killed.
GRACE = 3.0
LONGEST_END = 5.0  # s that the end of the process waits for the workers
LONGEST_WAIT = 3600.0  # s; a selector's timeout is limited, so longer waits are split
SPARE_FILES = 32  # left for other files that this process opens
MOST_STARTS = 10  # this many workers beyond ``jobs`` may die in a row while they start


class WorkerDied(BrokenExecutor):
    """A worker ended before it answered; the message says how."""


@dataclass(frozen=True)
class _Call:
    future: Future[Any]
    message: bytes


@dataclass(eq=False)
class _Worker:
    """A worker process as the executor sees it.

    It is ``starting`` until it has reported its ``pid``, then ``idle`` or ``busy``, and ``ending``
    after its channel was closed until it is known how its process ended.
    """

    channel: MessageChannel
    starter: Starter
    state: Literal["starting", "idle", "busy", "ending"] = "starting"
    pid: int = 0
    call: _Call | None = None
    deadline: float = math.inf
    is_overdue: bool = False


class ProcessExecutor(Executor):
    """Worker processes on this machine, started as calls are submitted.

    A call's future fails with :class:`WorkerDied` if its worker ended, and with ``TimeoutError``
    if the worker was killed at its time limit. If the system allows fewer processes than ``jobs``,
    there are fewer; if it allows none, futures fail with ``UsageError``.

    Parameters
    ----------
    jobs : largest number of workers.
    limit : seconds after which a worker is killed; None for never.

    Raises
    ------
    UsageError : no process can be started.
    """

    def __init__(self, jobs: int, limit: float | None = None) -> None:
        self.jobs, self.limit = jobs, limit
        self.starter = choice.take()
        self._inbox: deque[_Call] = deque()
        self._queue: deque[_Call] = deque()
        self._workers: set[_Worker] = set()
        self._failed_starts = 0
        self._start_failure = ""
        self._broken: UsageError | None = None
        self._closing: Literal["", "finish", "kill"] = ""
        self._selector = selectors.DefaultSelector()
        self._wake_receiver, self._wake_sender = socket.socketpair()
        for end in (self._wake_receiver, self._wake_sender):
            end.setblocking(False)
        self._selector.register(self._wake_receiver, selectors.EVENT_READ, self._drain_wakeups)
        self._watch_starter()
        self._thread = threading.Thread(target=self._supervise, daemon=True, name="pool")
        self._thread.start()
        atexit.register(self._end)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Queue a call for the next idle worker."""
        if self._closing:
            raise RuntimeError("the executor is closed")
        future: Future[T] = Future()
        message = pickle.dumps((fn, args, kwargs), pickle.HIGHEST_PROTOCOL)
        self._inbox.append(_Call(future, message))
        self._wake()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let the workers finish their calls, and end them."""
        self._close("kill" if cancel_futures else "finish", wait)

    def kill(self) -> None:
        """End all workers at once; their calls fail with :class:`WorkerDied`."""
        self._close("kill", wait=True)

    def _close(self, how: Literal["finish", "kill"], wait: bool) -> None:
        self._closing = how
        self._wake()
        if wait:
            self._thread.join()

    def _end(self) -> None:
        """Stop at the end of the process, before the starter is closed at exit as well.

        The thread would see its workers end, and start others at a socket that is registered.
        """
        with contextlib.suppress(KeyboardInterrupt):
            self._close("kill", wait=False)
            self._thread.join(LONGEST_END)

    def _wake(self) -> None:
        """Wake the thread; an error means that it is awake already, or has ended."""
        with contextlib.suppress(OSError):
            self._wake_sender.send(b"!")

    def _drain_wakeups(self) -> None:
        self._wake_receiver.recv(4096)

    def _supervise(self) -> None:
        """The main loop of the thread; only this thread handles workers."""
        try:
            while True:
                self._step()
                if self._closing and not (self._workers or self._queue or self._inbox):
                    return
                deadline = min((worker.deadline for worker in self._workers), default=math.inf)
                wait = min(deadline - time.monotonic(), LONGEST_WAIT)
                for key, _ in self._selector.select(max(0.0, wait)):
                    key.data()
        finally:
            atexit.unregister(self._end)
            self._release()

    def _step(self) -> None:
        """Do everything that can be done without waiting."""
        while self._inbox:
            self._queue.append(self._inbox.popleft())
        if self._closing == "kill":
            self._fail_queue(WorkerDied("the workers were stopped"))
        elif self._queue:
            self._assign()
        if self._closing and not self._queue:
            for worker in self._in("starting", "idle", *(["busy"] * (self._closing == "kill"))):
                self._disconnect(worker)
        now = time.monotonic()
        for worker in [worker for worker in self._workers if worker.deadline <= now]:
            worker.is_overdue, worker.deadline = True, math.inf
            worker.starter.kill(worker.pid)

    def _in(self, *states: str) -> list[_Worker]:
        return [worker for worker in self._workers if worker.state in states]

    def _assign(self) -> None:
        """Send calls to idle workers, and start more workers if these are not enough."""
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
            worker.deadline = time.monotonic() + self.limit + GRACE
        worker.channel.send(call.message)
        self._watch(worker)

    def _watch(self, worker: _Worker) -> None:
        """Wait for messages of a worker, and for room to send it the rest of its call."""
        events = selectors.EVENT_READ | (0 if worker.channel.is_flushed else selectors.EVENT_WRITE)
        self._selector.modify(worker.channel.link, events, partial(self._handle_worker, worker))

    def _start(self) -> None:
        """Start another worker."""
        try:
            if not self.starter.is_alive:
                self.starter = choice.make()
                self._watch_starter()
                atexit.unregister(self._end)
                atexit.register(self._end)  # what is registered last runs first
            channel = MessageChannel(self.starter.start())
        except OSError as error:
            self._limit_jobs(str(error.strerror))
            return
        except UsageError as error:
            self._broken = error
            return
        if self._workers and channel.link.fileno() >= _file_limit() - SPARE_FILES:
            channel.close()
            self._limit_jobs(os.strerror(errno.EMFILE))
            return
        worker = _Worker(channel, self.starter)
        self._workers.add(worker)
        self._selector.register(
            channel.link, selectors.EVENT_READ, partial(self._handle_worker, worker)
        )

    def _limit_jobs(self, reason: str) -> None:
        """The system allows no more processes: continue with the existing ones."""
        self._start_failure = reason
        self.jobs = max(1, len(self._workers))
        if not self._workers:
            self._break(reason)

    def _break(self, reason: str) -> None:
        self._broken = cannot_start(reason)

    def _handle_worker(self, worker: _Worker) -> None:
        """Process what a worker has sent."""
        if worker.state == "ending" or worker not in self._workers:
            return  # its end was handled just before
        worker.channel.flush()
        messages, is_closed = worker.channel.receive()
        for message in messages:
            if worker.state == "starting":
                worker.state, worker.pid = "idle", pickle.loads(message)
                self._failed_starts = 0
            else:
                self._answer(worker, message, is_closed)
        if is_closed:
            self._disconnect(worker)
        else:
            self._watch(worker)

    def _answer(self, worker: _Worker, message: bytes, is_closed: bool) -> None:
        call, worker.call = worker.call, None
        worker.state, worker.deadline = "idle", math.inf
        # Before the thread that waits for the answer runs: the worker would wait for both.
        if self._queue and not is_closed and not self._closing:
            self._send(worker, self._queue.popleft())
        if call is None:
            return
        try:
            value, error = pickle.loads(message)
        except Exception as failure:  # noqa: BLE001 -- an exception class defined by the user may do anything
            value, error = None, failure
        if error is None:
            call.future.set_result(value)
        else:
            call.future.set_exception(error)

    def _disconnect(self, worker: _Worker) -> None:
        """Close a worker's channel, and make sure that its process ends."""
        was, worker.state, worker.deadline = worker.state, "ending", math.inf
        self._selector.unregister(worker.channel.link)
        worker.channel.close()
        if was == "starting":
            self._count_failed_start()
            self._workers.discard(worker)
        elif worker.starter.is_alive:
            worker.starter.kill(worker.pid)  # its end is handled when it is reported
        else:
            if self._closing:
                worker.starter.kill(worker.pid)
            self._remove(worker, "its process ended")

    def _count_failed_start(self) -> None:
        self._failed_starts += 1
        if self._failed_starts > self.jobs + MOST_STARTS and not self._in("idle", "busy"):
            self._break(self._start_failure or "each one ends as it starts")

    def _remove(self, worker: _Worker, how: str) -> None:
        """Remove a worker whose process has ended; its call, if any, fails."""
        self._workers.discard(worker)
        if worker.call is None:
            return
        error: Exception = WorkerDied(how)
        if worker.is_overdue:
            error = TimeoutError(f"killed after {self.limit:g} s, stuck inside a block")
        worker.call.future.set_exception(error)

    def _watch_starter(self) -> None:
        listen = partial(self._handle_starter, self.starter)
        self._selector.register(self.starter.control, selectors.EVENT_READ, listen)

    def _handle_starter(self, starter: Starter) -> None:
        """Handle reports of ended workers; if it has died, only closed channels show them."""
        for pid, status in starter.reports():
            if not pid:
                self._limit_jobs(os.strerror(status))
                continue
            for worker in [w for w in self._workers if w.pid == pid and w.starter is starter]:
                # A child process of the worker may hold its channel open.
                self._handle_worker(worker)
                if worker.state != "ending":
                    self._disconnect(worker)
                self._remove(worker, _ending(status))
        if not starter.is_alive:
            self._selector.unregister(starter.control)
            for worker in self._in("ending"):
                if worker.starter is starter:
                    self._remove(worker, "its process ended")

    def _fail_queue(self, error: Exception) -> None:
        while self._queue:
            future = self._queue.popleft().future
            if future.set_running_or_notify_cancel():
                future.set_exception(error)

    def _release(self) -> None:
        """Release all resources; every call that has no answer yet fails."""
        self._closing = "kill"
        self._queue += self._inbox
        self._fail_queue(WorkerDied("the workers were stopped"))
        for worker in list(self._workers):
            worker.channel.close()
            self._remove(worker, "the workers were stopped")
        self._selector.close()
        self._wake_receiver.close()
        self._wake_sender.close()
        if self.starter.is_alive:
            choice.give_back(self.starter)


def _file_limit() -> float:
    """The largest number of files that this process may have open."""
    try:
        resource: Any = importlib.import_module("resource")
    except ImportError:
        return math.inf
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return math.inf if soft == resource.RLIM_INFINITY else float(soft)


def _ending(status: int) -> str:
    """How a process ended, from its wait status."""
    code = os.waitstatus_to_exitcode(status)
    if code >= 0:
        return f"its process ended with exit code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    return f"its process was killed by {name}"
