"""Worker pools that run trials: what the runner knows of them, and processes on this machine.

In: a number of workers. Out: :class:`WorkerPool`, which hides where its workers are::

    local_pool(4, 60.0)  ->  four processes, each trial limited to 60 s
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

from runtime.experiments.processes import ProcessExecutor, WorkerDied

# A worker that was killed by chance costs its trial another try. A trial that itself ends workers,
# mostly because memory runs out, must not be tried for ever.
ATTEMPTS = 3


class WorkerUnfit(Exception):  # noqa: N818 -- a state of a worker, as WorkerDied is
    """A worker cannot run trials, as something is missing there; another one may."""

    def __init__(self, address: str, reason: str) -> None:
        super().__init__(f"worker {address}: {reason}")
        self.address, self.reason = address, reason


def _leave_none_out(error: WorkerUnfit) -> None:
    raise error


@dataclass(frozen=True)
class WorkerPool:
    """An executor of trials, and how to use it.

    Parameters
    ----------
    width : number of calls that keep all workers busy.
    leave : ends the workers; called with True if all calls are done, else it kills them.
    deaths : exceptions of a call's future that mean that its worker died.
    check : raises ``UsageError`` if no more calls can be run.
    most : trials in one call.
    attempts : how often a trial is sent whose worker died.
    leave_out : sends no more calls to an unfit worker; raises ``UsageError`` if none is left.
    workers : the number of workers.
    report : what each worker was and has done, for the record of a start.
    """

    executor: Executor
    width: Callable[[], int]
    leave: Callable[[bool], None]
    deaths: tuple[type[BaseException], ...]
    check: Callable[[], None] = lambda: None
    most: int = 1
    attempts: int = ATTEMPTS
    leave_out: Callable[[WorkerUnfit], None] = _leave_none_out
    workers: Callable[[], int] = lambda: 1
    report: Callable[[], list[dict[str, Any]]] = list


def local_pool(jobs: int, timeout: float | None) -> WorkerPool:
    """Workers on this machine."""
    executor = ProcessExecutor(jobs, timeout)

    def leave(finished: bool) -> None:
        if finished:
            executor.shutdown()
        else:
            executor.kill()

    # As many calls again wait, so that no worker waits for this process to record a result.
    return WorkerPool(
        executor,
        width=lambda: 2 * jobs,
        leave=leave,
        deaths=(WorkerDied,),
        workers=lambda: executor.jobs,
    )
