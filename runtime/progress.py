"""A progress bar with the time left, on a terminal only."""

from __future__ import annotations

import sys
import time

WIDTH = 28


class Progress:
    """Draws a bar on stderr; call it with ticks done and ticks in all."""

    def __init__(self, label: str, wanted: bool = True) -> None:
        self.label = label
        self.active = wanted and sys.stderr.isatty()
        self.began = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        if not self.active:
            return
        spent = time.monotonic() - self.began
        left = spent * (total - done) / done
        filled = WIDTH * done // total
        bar = "█" * filled + "░" * (WIDTH - filled)
        text = f"{self.label} {bar} {100 * done // total:3d} %  {left:.0f} s left"
        sys.stderr.write(f"\r{text}\033[K")
        sys.stderr.flush()

    def close(self) -> None:
        """Wipe the bar."""
        if self.active:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()
