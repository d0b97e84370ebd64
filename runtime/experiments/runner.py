"""Sends points to workers and hands back what became of them, a bounded number at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass

from runtime.errors import UsageError, one_line
from runtime.experiments.crew import Crew
from runtime.experiments.points import Point
from runtime.experiments.worker import Done, Task, run_task

ATTEMPTS = 3
POLL = 1.0  # s; how often the time left is drawn anew


@dataclass(frozen=True)
class _Sent:
    point: Point
    attempt: int


def run_points(
    points: Iterator[Point],
    crew: Crew,
    task: Callable[[Point], Task],
    idle: Callable[[], None] = lambda: None,
) -> Iterator[tuple[Point, Done]]:
    """Run points side by side; yields each as it ends.

    A point whose worker died is tried again, up to ``ATTEMPTS`` times in all. Whatever else goes
    wrong with a call is that point's failure, unless no worker could run any.

    Parameters
    ----------
    points : taken one by one, as workers become free.
    task : how a point is to be run; asked when it is sent.
    idle : called about every second.
    """
    running: dict[Future[Done], _Sent] = {}

    def send(point: Point, attempt: int) -> None:
        running[crew.executor.submit(run_task, task(point))] = _Sent(point, attempt)

    exhausted = False
    while running or not exhausted:
        while not exhausted and len(running) < crew.width():
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
                yield sent.point, Done("timeout", str(error))
            except crew.deaths as error:
                crew.check()
                if sent.attempt < ATTEMPTS:
                    send(sent.point, sent.attempt + 1)
                else:
                    yield sent.point, Done("lost", _lost(error))
            except UsageError:
                raise
            except ImportError as error:
                said = f"{type(error).__name__}: {error}"
                raise UsageError(f"the workers cannot run points: {said}") from error
            except Exception as error:  # noqa: BLE001 -- such as a result too large to be sent
                yield sent.point, Done("failed", one_line(f"{type(error).__name__}: {error}"))
        crew.check()
        idle()


def _lost(error: BaseException) -> str:
    """Why a point was given up: how its last worker ended."""
    said = f"its worker died {ATTEMPTS} times, the last time: {error or type(error).__name__}"
    if "SIGKILL" in said:
        said += "; if memory ran out, take fewer workers with --jobs"
    return one_line(said)
