"""Sends points to workers and hands back what became of them, a bounded number at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass

from runtime.errors import UsageError
from runtime.experiments.points import Point
from runtime.experiments.pool import Crew
from runtime.experiments.worker import Done, Task, run_task

ATTEMPTS = 2
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

    A point whose worker died is tried once more.

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
                if sent.attempt < ATTEMPTS:
                    send(sent.point, sent.attempt + 1)
                else:
                    said = f"its worker died, {ATTEMPTS} times ({type(error).__name__})"
                    yield sent.point, Done("lost", said)
            except Exception as error:
                said = f"{type(error).__name__}: {error}"
                raise UsageError(f"the workers cannot run points: {said}") from error
        idle()
