"""Workers on systems that cannot fork, such as Windows: each is a new process that connects back.

In: a request for a worker. Out: a socket to a process that has shown the secret which only this
process and its child know. It starts in about a second, most of which is importing; a fork server
does that once.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import hmac
import json
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from typing import NoReturn

from runtime.experiments.processes.messages import serve_calls
from runtime.experiments.processes.starter import REPORT, SAME_PATH, Starter

PROGRAM = (
    SAME_PATH + "from runtime.experiments.processes.spawner import serve; serve(int(sys.argv[1]))"
)
HERE = "127.0.0.1"
SECRET = 32  # bytes that a new worker shows: any process of this computer can connect to a port
PATIENCE = 60.0  # s; until a new process has connected, on a busy machine
POLL = 0.1  # s
MOST = 400  # workers; a selector under Windows waits for up to 512 sockets


class Spawner(Starter):
    """Starts each worker as a process of its own."""

    def __init__(self) -> None:
        super().__init__()
        self._processes: dict[int, subprocess.Popen[bytes]] = {}
        atexit.register(self.close)

    def start(self) -> socket.socket:
        if len(self._processes) >= MOST:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        secret = secrets.token_bytes(SECRET)
        with socket.create_server((HERE, 0)) as listening:
            port = listening.getsockname()[1]
            process = subprocess.Popen(
                [sys.executable, "-c", PROGRAM, str(port), json.dumps(sys.path)],
                stdin=subprocess.PIPE,
                env=self._environment(),
                start_new_session=True,  # only this process handles Ctrl-C
                creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
            )
            with contextlib.suppress(OSError), process.stdin or contextlib.nullcontext():
                if process.stdin is not None:
                    process.stdin.write(secret)
            self._processes[process.pid] = process
            threading.Thread(target=self._report, args=(process,), daemon=True).start()
            try:
                return _accept(listening, secret, process)
            except OSError:
                process.kill()
                raise

    def kill(self, pid: int) -> None:
        process = self._processes.get(pid)
        if process is not None:
            with contextlib.suppress(OSError):
                process.kill()

    def close(self) -> None:
        atexit.unregister(self.close)
        self.is_alive = False
        for process in list(self._processes.values()):
            process.kill()
            process.wait()
        self.control.close()
        self._far.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _report(self, process: subprocess.Popen[bytes]) -> None:
        """Wait for the end of a process, and report it as a wait status of Unix."""
        code = process.wait()
        self._processes.pop(process.pid, None)
        with contextlib.suppress(OSError):
            self._far.sendall(REPORT.pack(process.pid, code << 8 if code >= 0 else -code))


def _accept(
    listening: socket.socket, secret: bytes, process: subprocess.Popen[bytes]
) -> socket.socket:
    """The connection of a process that knows the secret.

    Raises
    ------
    OSError : it ended before, or took too long.
    """
    listening.settimeout(POLL)
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and process.poll() is None:
        try:
            link, _ = listening.accept()
        except TimeoutError:
            continue
        link.settimeout(PATIENCE)
        shown = b""
        with contextlib.suppress(OSError):
            while len(shown) < SECRET and (data := link.recv(SECRET - len(shown))):
                shown += data
        if hmac.compare_digest(shown, secret):
            return link
        link.close()
    raise OSError(errno.ECONNREFUSED, "a worker process does not answer")


def serve(port: int) -> NoReturn:
    """Run a worker: connect to the process that started this one, and answer its calls."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    secret = sys.stdin.buffer.read()
    link = socket.create_connection((HERE, port), PATIENCE)
    link.settimeout(None)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    link.sendall(secret)
    serve_calls(link)
