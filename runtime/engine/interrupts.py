"""Signals that end a run: raised only where a run can stop, stored everywhere else.

In: Ctrl-C, SIGTERM or SIGHUP. Out: an end of the simulation between two lines of Python. While its
result is evaluated and written they are only stored, so that a second Ctrl-C loses nothing.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

try:  # signal.signal makes an enum of each handler, and takes as long as many ticks do
    from _signal import signal as _set  # type: ignore[import-not-found]
except ImportError:  # another Python than CPython
    from signal import signal as _set

ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)


class Interrupts:
    """A context that handles the signals that end a process.

    ``caught`` is the first signal received, None before. Signals that the process was started to
    ignore (as under ``nohup``) stay ignored. Does nothing in threads other than the main one.
    """

    def __init__(self) -> None:
        self.caught: int | None = None
        self.count = 0
        self.armed = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interrupts:
        global _current
        if threading.current_thread() is threading.main_thread():
            _current = self
            for number in ENDING:
                if signal.getsignal(number) is not signal.SIG_IGN:
                    self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(self, *error: object) -> None:
        global _current
        for number, before in self._before.items():
            signal.signal(number, before)
        if _current is self:
            _current = None

    @property
    def exit_code(self) -> int:
        """The exit code that a shell reports for the signal: 130, 143 or 129."""
        return 128 + (self.caught or signal.SIGINT)

    @property
    def leaves_time(self) -> bool:
        """Whether pictures may still be drawn: not after a second Ctrl-C, nor after the others."""
        return not self.count or (self.count == 1 and self.caught == signal.SIGINT)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.caught = self.caught or number
        self.count += 1
        if self.armed:
            raise KeyboardInterrupt


_current: Interrupts | None = None
_SIGINT = int(signal.SIGINT)


@contextmanager
def stoppable() -> Iterator[None]:
    """A context in which a signal raises KeyboardInterrupt at once.

    Does nothing without an active :class:`Interrupts`: Python then handles Ctrl-C as usual.
    """
    interrupts = _current
    if interrupts is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    try:
        interrupts.armed = True
        if interrupts.caught is not None:
            raise KeyboardInterrupt
        yield
    finally:
        interrupts.armed = False


class BetweenTicks:
    """A context in which Ctrl-C waits for the next call of ``check``.

    A tick is then done or not, so that a session can go on. A second Ctrl-C does not wait, since a
    block may never return. Does nothing where Python does not handle Ctrl-C itself.
    """

    def __enter__(self) -> BetweenTicks:
        self.caught = False
        self.is_between = False  # whether it was raised between two ticks
        self.is_ours = False
        # One call, and no question before it: a session that is stepped does this every tick.
        try:
            before = _set(_SIGINT, self._handle)
        except ValueError:  # in a thread, which Ctrl-C does not interrupt
            return self
        self.is_ours = before is signal.default_int_handler
        if not self.is_ours:
            _set(_SIGINT, before)
        return self

    def __exit__(self, *error: object) -> None:
        if self.is_ours:
            _set(_SIGINT, signal.default_int_handler)
        if self.caught and error[0] is None:
            self.check()

    def check(self, tick: int = 0, total: int = 0) -> None:
        """Raise KeyboardInterrupt if Ctrl-C was pressed."""
        if self.caught:
            self.is_between = True
            raise KeyboardInterrupt

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.caught:
            raise KeyboardInterrupt
        self.caught = True


def is_within(error: BaseException, function: Callable[..., Any]) -> bool:
    """Whether an exception came out of a function."""
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code is function.__code__:
            return True
        trace = trace.tb_next
    return False
