"""What a starter of worker processes does, and what all of them share.

In: a request for a worker. Out: a socket to it, and a report when it has ended::

    start()  ->  socket;  worker 4711 killed by SIGKILL  ->  reports() == [(4711, 9)]
"""

from __future__ import annotations

import os
import socket
import struct
import tempfile
from pathlib import Path

from runtime.errors import UsageError

THREADS = tuple(
    f"{library}_NUM_THREADS"
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR", "NUMBA")
)
REPORT = struct.Struct("<qq")  # a process and its wait status; or 0 and the errno of a failed start
# What a process runs first: it imports what this one could, and nothing from the current folder.
SAME_PATH = "import sys; del sys.path[0]; import json; sys.path[:] = json.loads(sys.argv[2]); "


class Starter:
    """Starts workers on request, and reports how each ended.

    The workers end when this process ends, in whatever way.

    Raises
    ------
    UsageError : it cannot be started.
    """

    def __init__(self) -> None:
        try:
            self.folder = Path(tempfile.mkdtemp(prefix="spikeblocks-"))
            self.control, self._far = socket.socketpair()
        except OSError as error:
            raise cannot_start(error) from None
        self.is_alive = True
        self._received = b""

    def start(self) -> socket.socket:
        """Request a worker; returns a socket to it, which closes at once if that failed.

        Raises
        ------
        OSError : no more can be started.
        """
        raise NotImplementedError

    def kill(self, pid: int) -> None:
        """Kill a worker."""
        raise NotImplementedError

    def close(self) -> None:
        """End it with its workers, and remove their files."""
        raise NotImplementedError

    def reports(self) -> list[tuple[int, int]]:
        """(process, wait status) of the workers that ended since the last call."""
        self.control.setblocking(False)
        try:
            while data := self.control.recv(1 << 16):
                self._received += data
            self.is_alive = False
        except BlockingIOError:
            self.control.setblocking(True)
        except OSError:
            self.is_alive = False
        whole = len(self._received) - len(self._received) % REPORT.size
        reports, self._received = self._received[:whole], self._received[whole:]
        return [(pid, status) for pid, status in REPORT.iter_unpack(reports)]

    def _environment(self) -> dict[str, str]:
        """The environment of workers: they run in parallel, where more threads would compete."""
        places = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self.folder))
        return {**os.environ, **dict.fromkeys(THREADS, "1"), **places}


def cannot_start(reason: object) -> UsageError:
    """The error where no worker can be started."""
    return UsageError(f"cannot start worker processes: {reason}")
