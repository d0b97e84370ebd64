"""Sends points to workers and hands back what became of them, a bounded number at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass

from runtime.errors import UsageError, one_line
from runtime.experiments.execution.backends import WorkerPool
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker import Task, TrialResult, run_task

ATTEMPTS = 3
POLL = 1.0  # s; how often the time left is drawn anew


@dataclass(frozen=True)
class _Sent:
    point: Trial
    attempt: int


def run_points(
    points: Iterator[Trial],
    pool: WorkerPool,
    task: Callable[[Trial], Task],
    idle: Callable[[], None] = lambda: None,
) -> Iterator[tuple[Trial, TrialResult]]:
    """Run points side by side; yields each as it ends.

    A point whose worker died is tried again, up to ``ATTEMPTS`` times in all. Whatever else goes
    wrong with a call is that point's failure, unless no worker could run any.

    Parameters
    ----------
    points : taken one by one, as workers become free.
    task : how a point is to be run; asked when it is sent.
    idle : called about every second.
    """
    running: dict[Future[TrialResult], _Sent] = {}

    def send(point: Trial, attempt: int) -> None:
        running[pool.executor.submit(run_task, task(point))] = _Sent(point, attempt)

    exhausted = False
    while running or not exhausted:
        while not exhausted and len(running) < pool.width():
            point = next(points, None)
            if point is None:
                exhausted = True
            else:
                send(point, 1)
        ended, _ = wait(running, timeout=POLL, return_when=FIRST_COMPLETED)
        for future in ended:
            sent = running.pop(future)
            try:
                yield sent.point, future.result()
            except TimeoutError as error:
                yield sent.point, TrialResult("timeout", str(error))
            except pool.deaths as error:
                pool.check()
                if sent.attempt < ATTEMPTS:
                    send(sent.point, sent.attempt + 1)
                else:
                    yield sent.point, TrialResult("lost", _lost(error))
            except UsageError:
                raise
            except ImportError as error:
                message = f"{type(error).__name__}: {error}"
                raise UsageError(f"the workers cannot run points: {message}") from error
            except Exception as error:  # noqa: BLE001 -- such as a result too large to be sent
                yield (
                    sent.point,
                    TrialResult("failed", one_line(f"{type(error).__name__}: {error}")),
                )
        pool.check()
        idle()


def _lost(error: BaseException) -> str:
    """Why a point was given up: how its last worker ended."""
    message = f"its worker died {ATTEMPTS} times, the last time: {error or type(error).__name__}"
    if "SIGKILL" in message:
        message += "; if memory ran out, take fewer workers with --jobs"
    return one_line(message)
