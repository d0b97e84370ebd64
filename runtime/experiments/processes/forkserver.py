"""The process that workers are forked from: started early, it imports while the graph is checked.

In: requests to fork or kill, over a socket. Out: workers, each with a socket of its own, and a
report when one ends::

    f + a socket, a folder  ->  a worker on it;  k 4711  ->  killed;  (4711, 9)  reported

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
from collections.abc import Iterator
from typing import NoReturn

from runtime.experiments.processes.messages import serve_calls
from runtime.experiments.processes.starter import REPORT, SAME_PATH, Starter, cannot_start

if sys.platform == "win32":
    raise ImportError("Windows cannot fork; spawner.py starts workers there")

# What the first trial of most graphs imports.
PRELOADED = ("runtime.experiments.execution.worker", "runtime.engine.compiled", "scipy.special")
PROGRAM = (
    SAME_PATH + "from runtime.experiments.processes.forkserver import serve; "
    "serve(int(sys.argv[1]), sys.argv[3])"
)
_REQUEST = struct.Struct("<cq")  # a command, and the process that it concerns
_FORK, _KILL = b"f", b"k"
LINGER = 5.0  # s; time limit for it to end


class ForkServer(Starter):
    """A process that forks workers, and reports how each ended.

    It ends when this process ends, in whatever way, and then kills its workers and removes their
    folder of temporary files. A worker outlives the fork server only if that is killed itself.

    Raises
    ------
    UsageError : it cannot be started.
    """

    def __init__(self) -> None:
        super().__init__()
        far = str(self._far.fileno())
        with self._far:
            try:
                self._process = subprocess.Popen(
                    [sys.executable, "-c", PROGRAM, far, json.dumps(sys.path), str(self.folder)],
                    stdin=subprocess.DEVNULL,
                    pass_fds=[int(far)],
                    env=self._environment(),
                    start_new_session=True,  # only this process handles Ctrl-C
                )
            except OSError as error:
                shutil.rmtree(self.folder, ignore_errors=True)
                raise cannot_start(error) from None
        atexit.register(self.close)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def start(self) -> socket.socket:
        near, far = socket.socketpair()
        # The fork server may be older than the caller's current folder: a worker begins there.
        folder = os.open(".", os.O_RDONLY)
        with far, contextlib.suppress(OSError):
            socket.send_fds(self.control, [_REQUEST.pack(_FORK, 0)], [far.fileno(), folder])
        os.close(folder)
        return near

    def kill(self, pid: int) -> None:
        # The fork server does it, because it knows whether the process is still its child. If it
        # has died, the caller knows that the worker lives, since its socket is open.
        if self.is_alive:
            with contextlib.suppress(OSError):
                self.control.sendall(_REQUEST.pack(_KILL, pid))
        else:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def close(self) -> None:
        atexit.unregister(self.close)
        self.is_alive = False
        self.control.close()
        try:
            self._process.wait(LINGER)
        except (subprocess.TimeoutExpired, KeyboardInterrupt):
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


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
                for pid, status in _reap():
                    workers.discard(pid)
                    control.sendall(REPORT.pack(pid, status))
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


def _reap() -> Iterator[tuple[int, int]]:
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
    request, files, _, _ = socket.recv_fds(control, _REQUEST.size, 2)
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
            control.sendall(REPORT.pack(0, error.errno or 0))
        else:
            if not pid:
                _become_worker(files[0], files[1], control)
            workers.add(pid)
        for file in files:
            os.close(file)
    return True


def _become_worker(channel: int, folder: int, control: socket.socket) -> NoReturn:
    try:
        os.fchdir(folder)
        os.close(folder)
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        control.close()
        serve_calls(socket.socket(fileno=channel))
    finally:
        os._exit(1)
