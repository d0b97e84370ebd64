"""Sends trials to workers and yields their results, a bounded number at a time.

In: an iterator of trials, and a worker pool. Out: (trial, result) in the order in which they end::

    trials 0, 1, 2 on two workers; the worker of 1 dies  ->  0, 2, and 1 from another worker
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass

from runtime.errors import UsageError, one_line
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker import Task, TrialResult, run_task
from runtime.experiments.execution.worker_pool import WorkerPool
from runtime.terminal import Progress

# A worker that was killed by chance costs its trial another try. A trial that itself ends workers,
# mostly because memory runs out, must not be tried for ever.
ATTEMPTS = 3
POLL = 1.0  # s; how often the remaining time is redrawn


@dataclass(frozen=True)
class _Submission:
    trial: Trial
    attempt: int


def run_trials(
    trials: Iterator[Trial],
    pool: WorkerPool,
    task: Callable[[Trial], Task],
    idle: Callable[[], None] = lambda: None,
) -> Iterator[tuple[Trial, TrialResult]]:
    """Run trials in parallel; yields each as it ends.

    A trial whose worker died is repeated, up to ``ATTEMPTS`` times in total. Any other error of a
    call makes that trial fail, unless no worker could run any trial.

    Parameters
    ----------
    trials : taken one by one, as workers become free.
    task : how to run a trial; called when the trial is sent.
    idle : called about every second.
    """
    running: dict[Future[TrialResult], _Submission] = {}

    def send(trial: Trial, attempt: int) -> None:
        running[pool.executor.submit(run_task, task(trial))] = _Submission(trial, attempt)

    exhausted = False
    while running or not exhausted:
        while not exhausted and len(running) < pool.width():
            trial = next(trials, None)
            if trial is None:
                exhausted = True
            else:
                send(trial, 1)
        completed, _ = wait(running, timeout=POLL, return_when=FIRST_COMPLETED)
        for future in completed:
            sent = running.pop(future)
            try:
                yield sent.trial, future.result()
            except TimeoutError as error:
                yield sent.trial, TrialResult("timeout", str(error))
            except pool.deaths as error:
                pool.check()
                if sent.attempt < ATTEMPTS:
                    send(sent.trial, sent.attempt + 1)
                else:
                    yield sent.trial, TrialResult("lost", _lost(error))
            except UsageError:
                raise
            except ImportError as error:
                message = f"{type(error).__name__}: {error}"
                raise UsageError(f"the workers cannot run trials: {message}") from error
            except Exception as error:  # noqa: BLE001 -- such as a result too large to send
                reason = one_line(f"{type(error).__name__}: {error}")
                yield sent.trial, TrialResult("failed", reason)
        pool.check()
        idle()


def run_all(
    trials: Iterator[Trial],
    make_pool: Callable[[], WorkerPool],
    task: Callable[[Trial], Task],
    record: Callable[[Trial, TrialResult], None],
    progress: Progress,
    idle: Callable[[], None] = lambda: None,
) -> bool:
    """Run trials and record each as it ends; False if Ctrl-C interrupted them."""
    finished = False
    pool = make_pool()
    try:
        idle()
        for trial, result in run_trials(trials, pool, task, idle):
            record(trial, result)
        finished = True
    except KeyboardInterrupt:
        pass
    finally:
        pool.leave(finished)
        progress.close()
    return finished


def _lost(error: BaseException) -> str:
    """Why a trial was abandoned: how its last worker ended."""
    message = f"its worker died {ATTEMPTS} times, the last time: {error or type(error).__name__}"
    if "SIGKILL" in message:
        message += "; if memory ran out, use fewer workers with --jobs"
    return one_line(message)
