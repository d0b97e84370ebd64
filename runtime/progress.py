"""A progress bar with the time left, on a terminal only."""

from __future__ import annotations

import shutil
import sys
import time

from runtime.terminal import draw, printable

WIDTH = 28


class Progress:
    """Draws a bar on stderr; call it with what is done and how much there is in all.

    Parameters
    ----------
    label : what is going on.
    wanted : False draws nothing.
    """

    def __init__(self, label: str, wanted: bool = True) -> None:
        self.label = printable(label)
        self.active = wanted and sys.stderr is not None and sys.stderr.isatty()
        self.began = time.monotonic()
        self.before = 0

    def resume(self, done: int) -> None:
        """Start the clock anew where so much was done before."""
        self.before, self.began = done, time.monotonic()

    def __call__(self, done: int, total: int, note: str = "") -> None:
        """Draw the bar, and below it a line that says how it goes."""
        if not self.active:
            return
        spent = time.monotonic() - self.began
        filled = WIDTH * done // total
        bar = "█" * filled + "░" * (WIDTH - filled)
        text = f"{self.label} {bar} {100 * done // total:3d} %"
        if done > self.before:
            left = spent * (total - done) / (done - self.before)
            text += f"  {duration(left)} left"
        columns = shutil.get_terminal_size().columns - 1
        below = f"\n{printable(note)[:columns]}\033[K\033[A" if note else ""
        self._draw(f"\r{text[:columns]}\033[K{below}")

    def close(self) -> None:
        """Wipe the bar, and what is below."""
        if self.active:
            self._draw("\r\033[J")

    def _draw(self, text: str) -> None:
        try:
            draw(text)
        except (OSError, ValueError):  # the terminal is gone, which must not end what goes on
            self.active = False


def duration(seconds: float) -> str:
    """Seconds as people say them: ``42 s``, ``3 min 10 s``, ``2 h 5 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
