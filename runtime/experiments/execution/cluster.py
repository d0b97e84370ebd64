"""The workers of a Dask cluster, which run trials.

In: the address of a scheduler, and the program that computes here. Out: :class:`ClusterPool`.

A call reaches a worker as bytes, with a function that is sent by value. A worker that lacks this
package, or has an older one, could not even read a call otherwise: it would end itself, and the
call would wait for ever. So it answers instead::

    "results"   what the trials gave, as bytes
    "unfit"     something cannot be imported there: the call goes to another worker
    "mixed"     it has another version of this package: numbers could differ, and the sweep ends
"""

from __future__ import annotations

import logging
import pickle
import time
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from dataclasses import asdict, dataclass, field
from typing import Any

from runtime.engine import silent
from runtime.errors import MissingExtraError, UsageError
from runtime.experiments.execution.worker import Task, TrialResult
from runtime.experiments.execution.worker_pool import WorkerPool, WorkerUnfit
from runtime.runs import Program

Note = Callable[[str], None]

# A cluster's scheduler and client take 6 ms a call, as long as a short trial.
MOST_IN_CALL = 50
CONNECT_TIMEOUT = 10.0  # s; time limit for a cluster's scheduler to answer
SILENT_WAIT = 3.0  # s without a worker until a note
LONGEST_WAIT = 60.0  # s without a worker until the experiment ends


@dataclass
class _Worker:
    """What is known of one worker: when it was seen, and what it has answered."""

    address: str
    versions: dict[str, str] = field(default_factory=dict)
    trials: int = 0
    has_left: bool = False
    unfit: str = ""


def _remote_call() -> Callable[[bytes], dict[str, Any]]:
    """The function that workers run, made such that it is sent by value: it is in no module."""

    def call(message: bytes) -> dict[str, Any]:
        import platform

        from distributed import get_worker

        answer: dict[str, Any] = {"worker": get_worker().address}
        answer["versions"] = {"python": platform.python_version()}
        try:
            from importlib.metadata import version

            answer["versions"]["spikeblocks"] = version("spikeblocks")
            from runtime.experiments.execution.worker import run_sent
        except ImportError as error:
            return {**answer, "kind": "unfit", "value": f"{type(error).__name__}: {error}"}
        return {**answer, **run_sent(message)}

    return call


class ClusterPool(WorkerPool):
    """The workers of a cluster, of which those that are unfit are left out; others may join later.

    Parameters
    ----------
    address : of the scheduler.
    program : what computes here. mixed : whether workers may have another one.
    note : receives that workers are waited for, or left out.

    Raises
    ------
    MissingExtraError : dask.distributed is not installed.
    UsageError : no scheduler answers there.
    """

    most = MOST_IN_CALL
    # The scheduler itself tries a call again whose worker died, three times by default.
    attempts = 1

    def __init__(
        self, address: str, program: Program, mixed: bool = False, note: Note = silent
    ) -> None:
        self.client, self.deaths = _connect(address)
        self.address, self.program = address, program
        self.mixed, self.note = mixed, note
        self.known: dict[str, _Worker] = {}
        self._call = _remote_call()
        self._began = time.monotonic()
        self._without: float | None = self._began  # since when there is no worker
        self._has_said = False

    def submit(self, tasks: Sequence[Task]) -> Future[list[TrialResult]]:
        fit = self.fit()
        # Loosely: a worker that joins later may take the call of one that has left.
        chosen = {"workers": fit, "allow_other_workers": True} if fit and self._unfit() else {}
        executor = self.client.get_executor(pure=False, **chosen)
        expected = None if self.mixed else self.program
        inner = executor.submit(self._call, pickle.dumps((tasks, expected)))
        outer: Future[list[TrialResult]] = Future()
        inner.add_done_callback(lambda done: self._pass_on(done, outer, len(tasks)))
        return outer

    def _pass_on(self, inner: Future[Any], outer: Future[Any], number: int) -> None:
        """Give what a worker has answered to the future that the caller has."""
        try:
            answer = inner.result()
        except BaseException as error:  # noqa: BLE001 -- of Dask, and of what foreign code raises
            outer.set_exception(error)
            return
        worker = self.known.setdefault(answer["worker"], _Worker(answer["worker"]))
        worker.versions = answer["versions"]
        kind, value = answer["kind"], answer["value"]
        if kind == "results":
            worker.trials += number
            outer.set_result(pickle.loads(value))
        elif kind == "mixed":
            outer.set_exception(
                UsageError(
                    f"worker {worker.address} has another program, '{value}'; this is "
                    f"'{self.program}', and the numbers may differ. Install the same one there; "
                    "--resume continues with it, --mixed computes with both"
                )
            )
        else:
            outer.set_exception(WorkerUnfit(worker.address, value))

    def leave_out(self, error: WorkerUnfit) -> None:
        """Send no more calls to a worker.

        Raises
        ------
        UsageError : no other one is left.
        """
        worker = self.known.setdefault(error.address, _Worker(error.address))
        if not worker.unfit:
            worker.unfit = error.reason
            self.note(f"worker {error.address} is left out: {error.reason}")
        if not self.fit():
            reasons = "; ".join(f"{each.address}: {each.unfit}" for each in self._unfit())
            raise UsageError(
                f"--scheduler {self.address}: no worker can run trials: {reasons}; install what "
                "is missing there, and --resume continues"
            )

    def fit(self) -> list[str]:
        """The addresses of the workers that are there and can run trials."""
        there = self._threads()
        for address in there:
            self.known.setdefault(address, _Worker(address)).has_left = False
        for address, worker in self.known.items():
            worker.has_left = address not in there
        return [address for address in there if not self.known[address].unfit]

    def width(self) -> int:
        """The number of calls that keep all workers busy."""
        threads, fit = self._threads(), self.fit()
        return max(2, 2 * sum(threads.get(address, 0) for address in fit))

    def check(self) -> None:
        """Say that no worker is there, and end after a while.

        Raises
        ------
        UsageError : the scheduler has left, or no worker has come.
        """
        if self.client.status != "running":
            raise self._no_scheduler()
        if self.fit():
            self._without, self._has_said = None, False
            return
        now = time.monotonic()
        self._without = now if self._without is None else self._without
        left = sum(worker.has_left for worker in self.known.values())
        since = f" ({left} left since the start)" if left else ""
        if now - self._without > LONGEST_WAIT:
            raise UsageError(
                f"--scheduler {self.address}: no worker for {LONGEST_WAIT:g} s{since}; start "
                "workers, and --resume continues"
            )
        if now - self._without > SILENT_WAIT and not self._has_said:
            self._has_said = True
            self.note(f"waiting: no worker at {self.address}{since}")

    def leave(self, finished: bool) -> None:
        self.client.close()

    def workers(self) -> int:
        return len(self.fit())

    def report(self) -> list[dict[str, Any]]:
        return [asdict(worker) for worker in self.known.values()]

    def _unfit(self) -> list[_Worker]:
        return [worker for worker in self.known.values() if worker.unfit]

    def _threads(self) -> dict[str, int]:
        try:
            return dict(self.client.nthreads())
        except (OSError, RuntimeError, ValueError):
            raise self._no_scheduler() from None

    def _no_scheduler(self) -> UsageError:
        return UsageError(
            f"--scheduler {self.address}: the scheduler no longer answers; once one does, --resume "
            "continues"
        )


def _connect(address: str) -> tuple[Any, tuple[type[BaseException], ...]]:
    """A client of a scheduler, and what it raises where a worker died."""
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise MissingExtraError("--scheduler", "cluster") from None
    for name in ("distributed", "distributed.client", "tornado.application", "asyncio"):
        # They log a lost connection with tracebacks, which check() reports in one sentence.
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise UsageError(f"--scheduler {address}: no scheduler answers there: {error}") from None
    return client, (KilledWorker, CancelledError)
