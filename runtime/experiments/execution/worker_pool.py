"""Worker pools that run trials: processes on this machine, or a Dask cluster.

In: a number of workers, or the address of a scheduler. Out: :class:`WorkerPool`, which hides which
of the two it is::

    pool_factory(4, None, 60.0)                ->  four processes, each trial limited to 60 s
    pool_factory(None, "tcp://host:8786", None)  ->  all workers of that cluster
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor
from dataclasses import dataclass

from runtime.errors import MissingExtraError, UsageError
from runtime.experiments.processes import ProcessExecutor, WorkerDied
from runtime.toolchain import processors

# A cluster's scheduler and client take 6 ms a call, as long as a short trial.
MOST_IN_CALL = 50
CONNECT_TIMEOUT = 10.0  # s; time limit for a cluster's scheduler to answer


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
    """

    executor: Executor
    width: Callable[[], int]
    leave: Callable[[bool], None]
    deaths: tuple[type[BaseException], ...]
    check: Callable[[], None] = lambda: None
    most: int = 1


def local_pool(jobs: int, timeout: float | None) -> WorkerPool:
    """Workers on this machine."""
    executor = ProcessExecutor(jobs, timeout)

    def leave(finished: bool) -> None:
        if finished:
            executor.shutdown()
        else:
            executor.kill()

    # As many calls again wait, so that no worker waits for this process to record a result.
    return WorkerPool(executor, lambda: 2 * jobs, leave, (WorkerDied,))


def pool_factory(
    jobs: int | None,
    scheduler: str | None,
    timeout: float | None,
    checkpoint: float | None = None,
) -> Callable[[], WorkerPool]:
    """A function that makes a pool: a cluster's, or of processes, one per processor by default.

    Raises
    ------
    UsageError : a cluster shall write checkpoints, which are in a folder of this machine.
    """
    if scheduler is not None and checkpoint is not None:
        raise UsageError(
            "checkpoints of trials are files of this machine, which the workers of a cluster need "
            "not see; leave out 'checkpoint' or 'scheduler'"
        )
    if scheduler is not None:
        return lambda: cluster_pool(scheduler)
    workers = jobs or processors()
    return lambda: local_pool(workers, timeout)


def cluster_pool(address: str) -> WorkerPool:
    """The workers of a Dask cluster; workers that join later are used as well.

    Raises
    ------
    MissingExtraError : dask.distributed is not installed.
    UsageError : no scheduler answers there.
    """
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
    executor: Executor = client.get_executor(pure=False)

    def leave(finished: bool) -> None:
        executor.shutdown(wait=finished)
        client.close()

    no_scheduler = UsageError(
        f"--scheduler {address}: the scheduler no longer answers; once one does, --resume continues"
    )

    def check() -> None:
        if client.status != "running":
            raise no_scheduler

    def width() -> int:
        try:
            return max(2, 2 * int(sum(client.nthreads().values())))
        except (OSError, RuntimeError):
            raise no_scheduler from None

    return WorkerPool(executor, width, leave, (KilledWorker, CancelledError), check, MOST_IN_CALL)
