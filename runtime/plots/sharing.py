"""Work that this process shares with a fork of itself, so that two cores draw the figures of a run.

In: a function of an index, and how many there are. Out: what it returned for each::

    share_work(draw_and_write, 5)    # ["", "", "", "", ""]: draws two or three itself

Both take indices from one pipe, and the fork sends what it did through another. What it has not
done when it ends, in whatever way, this process does: a fork that cannot be started, that is killed
or whose memory does not suffice costs time alone.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import NoReturn

if sys.platform == "win32":
    raise ImportError("Windows cannot fork")

_INDEX = 4  # bytes of an index in the pipe
MOST = 1000  # indices that are shared, which a pipe holds


def can_share() -> bool:
    """Whether a fork is safe, and gains time: on Linux, with one thread and two cores."""
    if sys.platform != "linux":
        return False
    return threading.active_count() == 1 and len(os.sched_getaffinity(0)) > 1


def share_work(
    work: Callable[[int], str], count: int, progress: Callable[[int, int], None] | None = None
) -> list[str]:
    """What a function returns for 0, ..., count - 1, each computed here or in a fork.

    Parameters
    ----------
    work : catches its own errors. progress : called with an index that is begun here, and count.

    Raises
    ------
    KeyboardInterrupt : of this process; the fork is interrupted as well.
    """
    indices = _fill_pipe(min(count, MOST))
    reader, writer = os.pipe()
    # Ctrl-C must not reach the fork before it can unwind to its end and not into its caller.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    fork = _fork()
    if fork == 0:
        os.close(reader)
        _be_the_fork(work, indices, writer, mask)
    os.close(writer)
    done: dict[int, str] = {}
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for index in _take_indices(indices):
            if progress is not None:
                progress(index, count)
            done[index] = work(index)
        done |= _answers(reader)
    except BaseException:
        if fork is not None:
            os.kill(fork, signal.SIGINT)
        raise
    finally:
        os.close(indices)
        os.close(reader)
        if fork is not None:
            os.waitpid(fork, 0)
    return [done[i] if i in done else work(i) for i in range(count)]


def _answers(reader: int) -> dict[int, str]:
    """What the fork has done, by index, once it has ended."""
    done = {}
    with open(reader, encoding="utf-8", closefd=False) as answers:
        for line in answers:
            with contextlib.suppress(ValueError):  # a line that it could not finish
                index, answer = json.loads(line)
                done[index] = answer
    return done


def _fill_pipe(count: int) -> int:
    """The reading end of a pipe with all indices, which ends after the last one."""
    reader, writer = os.pipe()
    os.write(writer, b"".join(i.to_bytes(_INDEX, "little") for i in range(count)))
    os.close(writer)
    return reader


def _take_indices(indices: int) -> Iterator[int]:
    while index := os.read(indices, _INDEX):
        yield int.from_bytes(index, "little")


def _fork() -> int | None:
    """As ``os.fork``; None if the system refuses."""
    with warnings.catch_warnings():
        # NumPy's threads sleep between calls, and it prepares them for a fork.
        warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
        try:
            return os.fork()
        except OSError:
            return None


def _be_the_fork(
    work: Callable[[int], str], indices: int, writer: int, mask: Iterable[int]
) -> NoReturn:
    try:
        # A terminal's Ctrl-C reaches the first process alone, which passes it on once: then no file
        # is left half written, since the error unwinds whatever writes one.
        os.setsid()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        gc.freeze()  # a collection would write to all pages, and so copy them
        for index in _take_indices(indices):
            os.write(writer, (json.dumps([index, work(index)]) + "\n").encode())
    finally:
        os._exit(0)
