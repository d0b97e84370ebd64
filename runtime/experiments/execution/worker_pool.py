"""Workers that run trials: what the runner knows of them, and processes on this machine.

In: trials with how they are run. Out: a future of their results::

    LocalPool(4, 60.0).submit([task])  ->  run by one of four processes, limited to 60 s
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from typing import Any

from runtime.experiments.execution.worker import Task, TrialResult, run_tasks
from runtime.experiments.processes import ProcessExecutor, WorkerDied

# A worker that was killed by chance costs its trial another try. A trial that itself ends workers,
# mostly because memory runs out, must not be tried for ever.
ATTEMPTS = 3


class WorkerUnfit(Exception):  # noqa: N818 -- a state of a worker, as WorkerDied is
    """A worker cannot run trials, as something is missing there; another one may."""

    def __init__(self, address: str, reason: str) -> None:
        super().__init__(f"worker {address}: {reason}")
        self.address, self.reason = address, reason


class WorkerPool:
    """Workers, wherever they are.

    Parameters
    ----------
    deaths : exceptions of a call's future that mean that its worker died.
    most : trials in one call.
    attempts : how often a trial is sent whose worker died.
    """

    deaths: tuple[type[BaseException], ...] = (WorkerDied,)
    most = 1
    attempts = ATTEMPTS

    def submit(self, tasks: Sequence[Task]) -> Future[list[TrialResult]]:
        """Send trials to a worker, as one call."""
        raise NotImplementedError

    def width(self) -> int:
        """The number of calls that keep all workers busy."""
        raise NotImplementedError

    def leave(self, finished: bool) -> None:
        """End the workers once all calls are done, or kill them."""
        raise NotImplementedError

    def workers(self) -> int:
        """The number of workers."""
        return 1

    def check(self) -> None:
        """Raise ``UsageError`` if no more calls can be run."""

    def leave_out(self, error: WorkerUnfit) -> None:
        """Send no more calls to an unfit worker; raises ``UsageError`` if none is left."""
        raise error

    def report(self) -> list[dict[str, Any]]:
        """What each worker was and has done, for the record of a start."""
        return []


class LocalPool(WorkerPool):
    """Processes on this machine, each trial limited to ``timeout`` (s)."""

    def __init__(self, jobs: int, timeout: float | None) -> None:
        self.executor, self.jobs = ProcessExecutor(jobs, timeout), jobs

    def submit(self, tasks: Sequence[Task]) -> Future[list[TrialResult]]:
        return self.executor.submit(run_tasks, tasks)

    def width(self) -> int:
        # As many calls again wait, so that no worker waits for this process to record a result.
        return 2 * self.jobs

    def leave(self, finished: bool) -> None:
        if finished:
            self.executor.shutdown()
        else:
            self.executor.kill()

    def workers(self) -> int:
        return self.executor.jobs
