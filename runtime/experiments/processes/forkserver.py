"""The process that workers are forked from: started early, it imports while the graph is checked.

We do not use the fork server of ``multiprocessing``: that one needs a socket
in the temporary directory (whose path may be too long), semaphores in shared memory (which may be
read-only), and does not report how a worker ended if anything goes wrong.
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
from runtime.experiments.processes.messages import serve_calls

THREADS = tuple(
    f"{library}_NUM_THREADS"
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR", "NUMBA")
)
# What the first trial of most graphs imports.
PRELOADED = ("runtime.experiments.execution.worker", "runtime.engine.compiled", "scipy.special")
# It imports only what this process could import, and nothing from the current folder.
PROGRAM = (
    "import sys; del sys.path[0]; import json; sys.path[:] = json.loads(sys.argv[2]); "
    "from runtime.experiments.processes.forkserver import serve; "
    "serve(int(sys.argv[1]), sys.argv[3])"
)
_REQUEST = struct.Struct("<cq")  # a command, and the process that it concerns
_FORK, _KILL = b"f", b"k"
_REPORT = struct.Struct("<qq")  # a process and its wait status; or 0 and the errno of a failed fork
LINGER = 5.0  # s; time limit for it to end


class ForkServer:
    """A process that forks workers, and reports how each ended.

    It ends when this process ends, in whatever way, and then kills its workers and removes their
    folder of temporary files. A worker outlives the fork server only if that is killed itself.

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
        # Workers run in parallel; with several threads each they would only compete.
        single = dict.fromkeys(THREADS, "1")
        with far:
            try:
                self._process = subprocess.Popen(
                    [*command, str(self.folder)],
                    stdin=subprocess.DEVNULL,
                    pass_fds=[far.fileno()],
                    env={**os.environ, **single, "TMPDIR": str(self.folder)},
                    start_new_session=True,  # only this process handles Ctrl-C
                )
            except OSError as error:
                shutil.rmtree(self.folder, ignore_errors=True)
                raise UsageError(f"cannot start worker processes: {error}") from None
        self.is_alive = True
        self._received = b""
        atexit.register(self.close)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def fork(self) -> socket.socket:
        """Request a worker; returns a socket to it, which closes at once if the fork failed.

        Raises
        ------
        OSError : no more sockets can be opened.
        """
        near, far = socket.socketpair()
        with far, contextlib.suppress(OSError):
            socket.send_fds(self.control, [_REQUEST.pack(_FORK, 0)], [far.fileno()])
        return near

    def kill(self, pid: int) -> None:
        """Kill a worker.

        The fork server does it, because it knows whether the process is still its child. If the
        fork server has died, the caller knows that the worker lives, since its socket is open.
        """
        if self.is_alive:
            with contextlib.suppress(OSError):
                self.control.sendall(_REQUEST.pack(_KILL, pid))
        else:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def reports(self) -> list[tuple[int, int]]:
        """(process, wait status) of the workers that ended since the last call."""
        try:
            while data := self.control.recv(1 << 16, socket.MSG_DONTWAIT):
                self._received += data
            self.is_alive = False
        except BlockingIOError:
            pass
        except OSError:
            self.is_alive = False
        whole = len(self._received) - len(self._received) % _REPORT.size
        found, self._received = self._received[:whole], self._received[whole:]
        return [(pid, status) for pid, status in _REPORT.iter_unpack(found)]

    def close(self) -> None:
        """End it with its workers, and remove their files."""
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
    """Start a fork server before it is needed, so that it imports meanwhile."""
    if not _spare:
        _spare.append(ForkServer())


def take() -> ForkServer:
    """A fork server for one executor: the spare one if it is still alive, else a new one."""
    while _spare:
        found = _spare.pop()
        found.reports()
        if found.is_alive:
            return found
        found.close()
    return ForkServer()


def give_back(fork_server: ForkServer) -> None:
    """Keep a fork server for the next executor."""
    _spare.append(fork_server)


def serve(control_file: int, folder: str) -> NoReturn:
    """Run the fork server: fork a worker for each socket received, until the other end closes."""
    control = socket.socket(fileno=control_file)
    control.set_inheritable(False)
    wake_reader, wake_writer = os.pipe()
    os.set_blocking(wake_reader, False)
    os.set_blocking(wake_writer, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake_writer, warn_on_full_buffer=False)
    workers: set[int] = set()
    try:
        for name in PRELOADED:
            importlib.import_module(name)
        while True:
            ready, _, _ = select.select([control.fileno(), wake_reader], [], [])
            if wake_reader in ready:
                os.read(wake_reader, 4096)
                for pid, status in _ended():
                    workers.discard(pid)
                    control.sendall(_REPORT.pack(pid, status))
            if control.fileno() in ready and not _handle_request(control, workers):
                break
    except OSError:
        pass  # the other end has closed
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


def _handle_request(control: socket.socket, workers: set[int]) -> bool:
    """Carry out one request; False if the other end has closed."""
    request, files, _, _ = socket.recv_fds(control, _REQUEST.size, 1)
    if len(request) < _REQUEST.size:
        return False
    command, pid = _REQUEST.unpack(request)
    if command == _KILL:
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


def _become_worker(channel: int, control: socket.socket) -> NoReturn:
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        control.close()
        serve_calls(socket.socket(fileno=channel))
    finally:
        os._exit(1)
