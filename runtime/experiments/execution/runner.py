"""Sends trials to workers and yields their results, a bounded number at a time.

In: an iterator of trials, and a worker pool. Out: (trial, result) in the order in which they end::

    trials 0, 1, 2 on two workers; the worker of 1 dies  ->  0, 2, and 1 from another worker

Where a call costs more than a short trial, on a cluster, several trials are one call. If it fails,
each of them is a call of its own from then on, so that a trial which ends workers ends no other.
Trials whose worker died come last: if one of them ends every worker, all others have ended by then.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from itertools import islice

from runtime.errors import UsageError, one_line, raised_text
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker import LOST, Task, TrialResult
from runtime.experiments.execution.worker_pool import WorkerPool, WorkerUnfit

# A call of several trials takes about so long: it is what the death of a worker costs at most, and
# how much later than the others the last worker ends.
CALL_SECONDS = 0.5
POLL = 1.0  # s; how often the remaining time is redrawn


@dataclass(frozen=True)
class _Call:
    trials: tuple[Trial, ...]
    attempt: int


class _Sender:
    """Sends trials to a pool, as many in a call as take :data:`CALL_SECONDS`."""

    def __init__(
        self, trials: Iterator[Trial], pool: WorkerPool, task: Callable[[Trial], Task]
    ) -> None:
        self.trials, self.pool, self.task = trials, pool, task
        self.running: dict[Future[list[TrialResult]], _Call] = {}
        self.suspects: deque[_Call] = deque()
        self.seconds = CALL_SECONDS  # that a trial takes: one in a call until that is known

    def fill(self) -> None:
        """Send trials until all workers have enough to do."""
        while len(self.running) < self.pool.width():
            number = min(self.pool.most, max(1, int(CALL_SECONDS / max(self.seconds, 1e-6))))
            if some := tuple(islice(self.trials, number)):
                self.send(some, 1)
            elif self.suspects:
                suspect = self.suspects.popleft()
                self.send(suspect.trials, suspect.attempt)
            else:
                return

    def send(self, trials: tuple[Trial, ...], attempt: int) -> None:
        call = self.pool.submit([self.task(trial) for trial in trials])
        self.running[call] = _Call(trials, attempt)

    def outcome(self, future: Future[list[TrialResult]]) -> Iterable[tuple[Trial, TrialResult]]:
        """The trials of a call that has ended, with their results; those to repeat are sent.

        Raises
        ------
        UsageError : no worker can run trials.
        """
        call = self.running.pop(future)
        try:
            results = future.result()
        except self.pool.deaths as error:
            self.pool.check()
            # A call of several is no attempt of each: which of them ended the worker is not known.
            if len(call.trials) > 1 or call.attempt < self.pool.attempts:
                attempt = 1 if self.pool.attempts == 1 else call.attempt + 1
                self.suspects += [_Call((trial,), attempt) for trial in call.trials]
                return []
            failure = TrialResult(LOST, _lost(error, self.pool.attempts))
        except WorkerUnfit as error:
            self.pool.leave_out(error)
            self.send(call.trials, call.attempt)
            return []
        except TimeoutError as error:
            failure = TrialResult("timeout", str(error))
        except UsageError:
            raise
        except ImportError as error:
            message = f"{type(error).__name__}: {error}"
            raise UsageError(f"the workers cannot run trials: {message}") from error
        except Exception as error:  # noqa: BLE001 -- such as a result too large to send
            if len(call.trials) > 1:
                for trial in call.trials:
                    self.send((trial,), call.attempt)
                return []
            failure = TrialResult("failed", one_line(raised_text(error, with_place=False)))
        else:
            spent = sum(result.wall_s for result in results) / len(results)
            self.seconds += (spent - self.seconds) / 4
            return zip(call.trials, results, strict=True)
        return [(trial, failure) for trial in call.trials]


def run_trials(
    trials: Iterator[Trial],
    pool: WorkerPool,
    task: Callable[[Trial], Task],
    idle: Callable[[], None] = lambda: None,
) -> Iterator[tuple[Trial, TrialResult]]:
    """Run trials in parallel; yields each as its call ends.

    A trial whose worker died is sent ``pool.attempts`` times in total. Any other error of a call
    makes that trial fail, unless no worker could run any trial.

    Parameters
    ----------
    trials : taken one by one, as workers become free.
    task : how to run a trial; called when the trial is sent.
    idle : called about every second.
    """
    sender = _Sender(trials, pool, task)
    sender.fill()
    while sender.running:
        completed, _ = wait(sender.running, timeout=POLL, return_when=FIRST_COMPLETED)
        for future in completed:
            yield from sender.outcome(future)
        pool.check()
        idle()
        sender.fill()


def _lost(error: BaseException, attempts: int) -> str:
    """Why a trial was abandoned: how its last worker ended."""
    times = f" {attempts} times, the last time" if attempts > 1 else ""
    message = f"its worker died{times}: {error or type(error).__name__}"
    if "SIGKILL" in message:
        message += "; if memory ran out, use fewer workers with --jobs"
    return one_line(message)
