"""Runs a check on many random examples, counts what came out, and shrinks what failed."""

from __future__ import annotations

import contextlib
import os
import signal
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import FrameType
from typing import Any

from hypothesis import HealthCheck, Phase, Verbosity, given, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st

# CPU seconds that one example may take. It is far more than any needs: it tells work that ends
# from work that does not, and fast from slow it tells nobody.
LIMIT = 60.0
MANY_FAULTS = 20


@dataclass(frozen=True)
class Record:
    """What a campaign found.

    outcomes : how many examples ended in which way, by a word or two for each.
    failures : the smallest example found for each different failure, with what went wrong.
    seconds : CPU time of this process and its children.
    """

    subject: str
    examples: int
    seed: int
    outcomes: dict[str, int] = field(default_factory=dict)
    failures: tuple[str, ...] = ()
    seconds: float = 0.0

    def line(self) -> str:
        """The campaign in one line."""
        counts = ", ".join(f"{count} {name}" for name, count in sorted(self.outcomes.items()))
        return (
            f"{self.subject}: {self.examples} examples from seed {self.seed} ({counts}), "
            f"{len(self.failures)} failures, {self.seconds:.0f} s of CPU"
        )


class UnboundedError(BaseException):
    """An example used up its CPU time; nothing that catches Exception may catch it."""


@contextlib.contextmanager
def bounded(limit: float = LIMIT) -> Iterator[None]:
    """Raise UnboundedError in what uses more CPU seconds of this process than ``limit``."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise UnboundedError(f"not finished after {limit:g} s of CPU time")

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def campaign(
    subject: str,
    examples: st.SearchStrategy[Any],
    check: Callable[[Any], str],
    number: int,
    seed: int,
    *,
    shrink: bool = True,
) -> Record:
    """Check random examples, and go on after a failure with what is left of their number.

    Parameters
    ----------
    check : raises whatever is wrong with an example; returns a word for how it ended.
    number, seed : of examples, and what they are drawn from.
    shrink : look for the smallest example that fails in the same way, which takes many checks.
    """
    started = cpu_seconds()
    outcomes: Counter[str] = Counter()
    failures: dict[str, str] = {}
    attempt = 0
    while sum(outcomes.values()) < number and len(failures) < MANY_FAULTS:
        left = number - sum(outcomes.values())
        trial = _Trial(check, outcomes, failures)
        phases = (Phase.generate, Phase.shrink) if shrink else (Phase.generate,)
        limits = settings(
            max_examples=left,
            database=None,
            deadline=None,
            phases=phases,
            suppress_health_check=list(HealthCheck),
            verbosity=Verbosity.quiet,
            report_multiple_bugs=False,
        )
        before = sum(outcomes.values())
        # Numbers derived from one seed: the same campaign tries the same examples again.
        run = seeded(seed + 1_000_003 * attempt)(limits(given(examples)(trial.once)))
        try:
            run()
        except BaseException as error:
            if trial.failing is None:
                raise
            failures[trial.signature] = f"{trial.failing!r}\n{_described(error)}"
            outcomes["failed"] += 1
        attempt += 1
        if sum(outcomes.values()) == before:
            break  # there are no other examples
    seconds = cpu_seconds() - started
    tried = sum(outcomes.values())
    return Record(subject, tried, seed, dict(outcomes), tuple(failures.values()), seconds)


class _Trial:
    """The function that hypothesis calls: counts until it meets a failure of a new kind."""

    def __init__(
        self, check: Callable[[Any], str], outcomes: Counter[str], failures: dict[str, str]
    ) -> None:
        self.check, self.outcomes, self.failures = check, outcomes, failures
        self.failing: Any = None
        self.signature = ""

    def once(self, example: Any) -> None:
        """Check one example; raise a failure of a kind that is not known yet."""
        try:
            with bounded():
                outcome = self.check(example)
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:
            signature = _signature(error)
            if signature in self.failures:
                self.outcomes["failed again"] += 1
                return
            self.failing, self.signature = example, signature
            if isinstance(error, Exception):
                raise
            raise AssertionError(str(error)) from error
        if self.failing is None:
            self.outcomes[outcome] += 1


def _signature(error: BaseException) -> str:
    """What makes two failures the same: the kind of exception and the line that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    last = frames[-1] if frames else None
    return f"{type(error).__name__} {last.filename}:{last.lineno}" if last else type(error).__name__


def _described(error: BaseException) -> str:
    return "".join(traceback.format_exception(error, limit=-6)).strip()


def cpu_seconds() -> float:
    """CPU time of this process and of its children that have ended (s)."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system
