"""Output to the terminal: printing, numbers, tables and progress. Every verb prints through it.

In: names, strings and exceptions, some from files that are not trusted. Out: lines on stdout and
stderr, in which control sequences that could move the cursor, change colours or reorder letters
are escapes::

    show("track\x1b[2J")      # prints track\x1b[2J
    number(1234.5678), number(None), number(1e-17)    # '1235', '-', '0'
"""

from __future__ import annotations

import errno
import math
import os
import re
import shutil
import sys
import time
from collections.abc import Collection, Mapping, Sequence
from itertools import zip_longest
from typing import Any, TextIO

from runtime.files import json_text

ROUNDING = 1e-12


def printable(text: str) -> str:
    r"""A string that holds only line feeds and printable characters.

    Control characters (C0, DEL, C1), bidirectional overrides, the line separators U+0085, U+2028
    and U+2029, and lone surrogates become escapes such as ``\x1b``.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)


def show(text: object = "", *, flush: bool = False) -> None:
    """Print a result on stdout."""
    _write(sys.stdout, f"{printable(str(text))}\n")
    if flush:
        sys.stdout.flush()


def tell(text: object) -> None:
    """Print a note or an error on stderr."""
    _write(sys.stderr, f"{printable(str(text))}\n")


def draw(text: str) -> None:
    """Write cursor movements and text on stderr; parts that are not trusted must be escaped."""
    _write(sys.stderr, text)
    sys.stderr.flush()


def in_colour(stream: TextIO) -> bool:
    """Whether colours may be written: a terminal that has them, and NO_COLOR is not set."""
    capable = stream.isatty() and os.environ.get("TERM") not in (None, "", "dumb")
    return capable and not os.environ.get("NO_COLOR")


def show_json(value: Any) -> None:
    """Print one JSON object in ASCII on stdout."""
    # json does not escape DEL.
    text = json_text(value).replace("\x7f", "\\u007f")
    _write(sys.stdout, f"{text}\n")


def _write(stream: TextIO, text: str) -> None:
    """Write a string; characters that the stream's encoding lacks become escapes."""
    # A result must not become a traceback because a terminal knows ASCII only.
    encoding = getattr(stream, "encoding", None) or "utf-8"
    if getattr(stream, "closed", False):  # by own code: as if it were closed from outside
        if stream is sys.stderr:
            return
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    stream.write(text.encode(encoding, "backslashreplace").decode(encoding))


def number(value: float | None, sign: str = "") -> str:
    """A number in four significant digits, or a dash where there is no value.

    What is smaller than :data:`ROUNDING` is the rounding error of a zero, and written as one.
    ``sign`` is that of a format specification: ``+`` shows the sign of positive numbers too.
    """
    if value is None or math.isnan(value):
        return "-"
    return f"{0.0 if abs(value) < ROUNDING else value:{sign}.4g}"


def short(cell: str) -> str:
    """A value as it is written in a table; a number with many digits to six of them."""
    return f"{float(cell):.6g}" if re.fullmatch(r"-?\d*\.\d{7,}(e[-+]?\d+)?", cell) else cell


def with_unit(name: str, units: Mapping[str, str]) -> str:
    """A name with its unit, if it has one: ``settled_at [s]``."""
    return f"{name} [{units[name]}]" if units.get(name) else name


def readable_bytes(size: float) -> str:
    """A number of bytes with its unit: ``512 MiB``."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if size < 1024:
            return f"{size:.4g} {unit}"
        size /= 1024
    return f"{size:.4g} TiB"


def table(rows: Sequence[Sequence[str]], right: Collection[int] = (), indent: str = "  ") -> str:
    """Rows as lines of aligned columns, with two spaces between columns.

    Parameters
    ----------
    rows : the header first, if there is one; a row may have fewer cells than others.
    right : the indices of the columns that are aligned to the right.
    indent : what each line begins with.
    """
    widths = [max(map(len, column)) for column in zip_longest(*rows, fillvalue="")]
    lines = []
    for row in rows:
        cells = [
            text.rjust(width) if column in right else text.ljust(width)
            for column, (text, width) in enumerate(zip(row, widths, strict=False))
        ]
        lines.append((indent + "  ".join(cells)).rstrip())
    return "\n".join(lines)


WIDTH = 28


class Progress:
    """A progress bar on stderr; call it with the number of steps that are done and the total.

    Parameters
    ----------
    label : the name of the work.
    wanted : False draws nothing.
    """

    def __init__(self, label: str, wanted: bool = True) -> None:
        self.label = printable(label)
        self.active = wanted and sys.stderr is not None and sys.stderr.isatty()
        self.began = time.monotonic()
        self.before = 0
        self.workers = 0  # that share the work, shown if there are any
        self._last: tuple[int, int, str] | None = None

    def resume(self, done: int) -> None:
        """Restart the clock; ``done`` steps were done before."""
        self.before, self.began = done, time.monotonic()

    def __call__(self, done: int, total: int, note: str = "") -> None:
        """Draw the bar, and a note in the line below it."""
        if not self.active:
            return
        self._last = done, total, note
        spent = time.monotonic() - self.began
        full = WIDTH * done // total
        bar = "█" * full + "░" * (WIDTH - full)
        text = f"{self.label} {bar} {100 * done // total:3d} %"
        # What was done before a resumption took no time of this process.
        if done > self.before:
            remaining = spent * (total - done) / (done - self.before)
            text += f"  {duration(remaining)} left"
        if self.workers:
            text += f"  {self.workers} worker{'s' * (self.workers > 1)}"
        columns = shutil.get_terminal_size().columns - 1
        # The note is written below and the cursor goes back up (\033[A), so that the next call
        # draws over both; \033[K erases what is left of a longer line.
        below = f"\n{printable(note)[:columns]}\033[K\033[A" if note else ""
        self._draw(f"\r{text[:columns]}\033[K{below}")

    def redraw(self) -> None:
        """Draw the bar again, with the time that is left now."""
        if self._last is not None:
            self(*self._last)

    def close(self) -> None:
        """Erase the bar and the note."""
        if self.active:
            self._draw("\r\033[J")

    def _draw(self, text: str) -> None:
        try:
            draw(text)
        except (OSError, ValueError):  # a closed terminal must not end the work
            self.active = False


def duration(seconds: float) -> str:
    """Seconds with their units: ``42 s``, ``3 min 10 s``, ``2 h 5 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
