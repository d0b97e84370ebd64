"""What runs points: worker processes here, or those of a Dask cluster."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor
from dataclasses import dataclass, field

from runtime.errors import MissingExtraError, UsageError
from runtime.experiments.execution.pool import LocalPool, WorkerDied

PATIENCE = 10.0  # s; until a cluster's scheduler must have answered


def _nothing() -> None:
    """Find no fault."""


@dataclass(frozen=True)
class WorkerPool:
    """An executor with what is to be known of it.

    Parameters
    ----------
    width : how many calls keep all of it busy.
    leave : ends it, at once unless all is done.
    deaths : what a call's future fails with when its worker has died.
    check : raises ``UsageError`` once no more calls can be run.
    """

    executor: Executor
    width: Callable[[], int]
    leave: Callable[[bool], None]
    deaths: tuple[type[BaseException], ...]
    check: Callable[[], None] = field(default=_nothing)


def local_pool(jobs: int, timeout: float | None) -> WorkerPool:
    """Workers on this machine."""
    pool = LocalPool(jobs, timeout)

    def leave(finished: bool) -> None:
        if finished:
            pool.shutdown()
        else:
            pool.kill()

    return WorkerPool(pool, lambda: jobs, leave, (WorkerDied,))


def cluster_pool(address: str) -> WorkerPool:
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
    for name in ("distributed", "distributed.client"):
        # What it logs of a lost connection, with tracebacks, is said in one sentence by check().
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise UsageError(f"--scheduler {address}: no scheduler answers there: {error}") from None
    executor: Executor = client.get_executor(pure=False)

    def leave(finished: bool) -> None:
        executor.shutdown(wait=finished)
        client.close()

    gone = UsageError(
        f"--scheduler {address}: the scheduler is gone; once there is one again, --resume goes on"
    )

    def check() -> None:
        if client.status != "running":
            raise gone

    def width() -> int:
        try:
            return max(2, 2 * int(sum(client.nthreads().values())))
        except (OSError, RuntimeError):
            raise gone from None

    return WorkerPool(executor, width, leave, (KilledWorker, CancelledError), check)
