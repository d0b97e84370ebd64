"""The process from which workers are forked: started early, it imports while we check the graph.

It is a process of our own rather than ``multiprocessing``'s fork server: that one needs a socket
in the temporary directory (whose path may be too long), semaphores in shared memory (which may be
read-only), and does not say how a worker ended once anything goes wrong.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import json
import os
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

from runtime.errors import UsageError
from runtime.experiments.execution.messages import attend

THREADS = tuple(
    f"{library}_NUM_THREADS"
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR", "NUMBA")
)
# The second is first needed by the first run.
PRELOADED = ("runtime.experiments.execution.worker", "networkx")
# Only what this process could import itself is imported there, nothing of the current folder.
PROGRAM = (
    "import sys; del sys.path[0]; import json; sys.path[:] = json.loads(sys.argv[2]); "
    "from runtime.experiments.execution.forkserver import serve; "
    "serve(int(sys.argv[1]), sys.argv[3])"
)
_REQUEST = struct.Struct("<cq")  # what to do, and with which process
_FORK, _KILL = b"f", b"k"
_REPORT = struct.Struct("<qq")  # a process and its wait status; or 0 and why none could be forked
LINGER = 5.0  # s; how long it may take to end


class ForkServer:
    """A process that forks workers, and reports how each ended.

    It ends when this process does, however that ends, and takes along its workers and the folder
    in which they have their temporary files. A worker outlives it only if it is killed itself.

    Raises
    ------
    UsageError : it cannot be started.
    """

    def __init__(self) -> None:
        try:
            self.folder = Path(tempfile.mkdtemp(prefix="spikeblocks-"))
            self.control, far = socket.socketpair()
        except OSError as error:
            raise UsageError(f"cannot start worker processes: {error}") from None
        command = [sys.executable, "-c", PROGRAM, str(far.fileno()), json.dumps(sys.path)]
        # Workers run side by side; with several threads each they would only be in the way of
        # each other.
        single = dict.fromkeys(THREADS, "1")
        with far:
            try:
                self._process = subprocess.Popen(
                    [*command, str(self.folder)],
                    stdin=subprocess.DEVNULL,
                    pass_fds=[far.fileno()],
                    env={**os.environ, **single, "TMPDIR": str(self.folder)},
                    start_new_session=True,  # Ctrl-C is for this process to answer
                )
            except OSError as error:
                shutil.rmtree(self.folder, ignore_errors=True)
                raise UsageError(f"cannot start worker processes: {error}") from None
        self.is_alive = True
        self._heard = b""
        atexit.register(self.close)

    @property
    def pid(self) -> int:
        """Its process."""
        return self._process.pid

    def fork(self) -> socket.socket:
        """Ask for a worker; returns a socket to it, which ends at once where it cannot be had.

        Raises
        ------
        OSError : there is no room for another socket.
        """
        near, far = socket.socketpair()
        with far, contextlib.suppress(OSError):
            socket.send_fds(self.control, [_REQUEST.pack(_FORK, 0)], [far.fileno()])
        return near

    def kill(self, pid: int) -> None:
        """Kill a worker.

        The nursery does it, because it knows whether the process is still its child; without it,
        the caller knows that the worker lives, since its socket is open.
        """
        if self.is_alive:
            with contextlib.suppress(OSError):
                self.control.sendall(_REQUEST.pack(_KILL, pid))
        else:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def reports(self) -> list[tuple[int, int]]:
        """What has come in since the last call: (process, wait status) of those that ended."""
        try:
            while data := self.control.recv(1 << 16, socket.MSG_DONTWAIT):
                self._heard += data
            self.is_alive = False
        except BlockingIOError:
            pass
        except OSError:
            self.is_alive = False
        whole = len(self._heard) - len(self._heard) % _REPORT.size
        found, self._heard = self._heard[:whole], self._heard[whole:]
        return [(pid, status) for pid, status in _REPORT.iter_unpack(found)]

    def close(self) -> None:
        """End it, with its workers and their files."""
        atexit.unregister(self.close)
        self.is_alive = False
        self.control.close()
        try:
            self._process.wait(LINGER)
        except (subprocess.TimeoutExpired, KeyboardInterrupt):
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


_spare: list[ForkServer] = []


def start_early() -> None:
    """Start a nursery for the pool to come, which imports meanwhile."""
    if not _spare:
        _spare.append(ForkServer())


def take() -> ForkServer:
    """A nursery of one's own: the one started early if it still lives."""
    while _spare:
        found = _spare.pop()
        found.reports()
        if found.is_alive:
            return found
        found.close()
    return ForkServer()


def give_back(fork_server: ForkServer) -> None:
    """Leave a nursery to the next pool."""
    _spare.append(fork_server)


def serve(control_file: int, folder: str) -> NoReturn:
    """Be the nursery: fork a worker for each socket that comes in, until there come no more."""
    control = socket.socket(fileno=control_file)
    control.set_inheritable(False)
    woken, wake = os.pipe()
    os.set_blocking(woken, False)
    os.set_blocking(wake, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    workers: set[int] = set()
    try:
        for name in PRELOADED:
            importlib.import_module(name)
        while True:
            ready, _, _ = select.select([control.fileno(), woken], [], [])
            if woken in ready:
                os.read(woken, 4096)
                for pid, status in _ended():
                    workers.discard(pid)
                    control.sendall(_REPORT.pack(pid, status))
            if control.fileno() in ready and not _answered(control, workers):
                break
    except OSError:
        pass  # the other end is gone
    finally:
        for pid in workers:
            os.kill(pid, signal.SIGKILL)
        for pid in workers:
            os.waitpid(pid, 0)
        shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


def _ended() -> Iterator[tuple[int, int]]:
    """The children that have ended, with their wait status."""
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if not pid:
            return
        yield pid, status


def _answered(control: socket.socket, workers: set[int]) -> bool:
    """Do what is asked; False where nobody asks any more."""
    request, files, _, _ = socket.recv_fds(control, _REQUEST.size, 1)
    if len(request) < _REQUEST.size:
        return False
    what, pid = _REQUEST.unpack(request)
    if what == _KILL:
        if pid in workers:
            os.kill(pid, signal.SIGKILL)
    elif files:
        try:
            pid = os.fork()
        except OSError as error:
            control.sendall(_REPORT.pack(0, error.errno or 0))
        else:
            if not pid:
                _become_worker(files[0], control)
            workers.add(pid)
        os.close(files[0])
    return True


def _become_worker(line: int, control: socket.socket) -> NoReturn:
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        control.close()
        attend(socket.socket(fileno=line))
    finally:
        os._exit(1)
