"""The process of a session, seen from the server: started, spoken to, ended, and begun again.

In: messages for the worker. Out: its messages and frames, handed to a callback in the server's
loop. What a new process needs to compute the same state is kept here: the text, the seed, the
changes with their ticks, and the tick that was reached.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import re
import threading
import time
from collections.abc import Callable
from multiprocessing.process import BaseProcess
from typing import Any

from spikeblocks.studio.worker import main

Listener = Callable[[str, Any], None]
_TICK = re.compile(rb'"tick": (\d+)')


class SessionProcess:
    """The worker's process, which may be ended at any time.

    Parameters
    ----------
    listen : gets each message's name and values, and each frame as ``("frame", bytes)``.
    """

    def __init__(self, listen: Listener) -> None:
        self.listen = listen
        self.process: BaseProcess | None = None
        self.pipe: Any = None  # a Connection, of another class on Windows
        self.begun: dict[str, Any] | None = None
        self.log: list[tuple[int, str, tuple[Any, ...]]] = []
        self.tick = 0
        self.asked_at = self.heard_at = time.monotonic()

    def start(self) -> None:
        """Start the process."""
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=main, args=(other,), daemon=True)
        self.process.start()
        other.close()
        loop = asyncio.get_running_loop()
        threading.Thread(target=self._read, args=(self.pipe, loop), daemon=True).start()

    def _read(self, pipe: Any, loop: asyncio.AbstractEventLoop) -> None:
        """Hand on what comes, until the process has ended."""
        try:
            while True:
                name, values = pipe.recv()
                loop.call_soon_threadsafe(self._receive, pipe, name, values)
        except (EOFError, OSError):
            pass
        try:
            loop.call_soon_threadsafe(self._ended, pipe)
        except RuntimeError:
            return  # the loop is closed: so is the server

    def _receive(self, pipe: Any, name: str, values: Any) -> None:
        if pipe is not self.pipe:
            return  # of a process that was ended
        self.heard_at = time.monotonic()
        if name == "log":
            self.log[values["first"] :] = values["changes"]
            return
        if name == "frame":
            found = _TICK.search(values)
            self.tick = int(found[1]) if found else self.tick
        self.listen(name, values)

    def _ended(self, pipe: Any) -> None:
        if pipe is self.pipe:
            self.listen("ended", {})

    def send(self, name: str, **values: Any) -> None:
        """Send a message; what begins a session is remembered."""
        if name == "begin":
            self.begun, self.log, self.tick = values, [], 0
        elif name == "text" and self.begun is None:
            self.begun = {key: values[key] for key in ("text", "path", "modules")}
        self.asked_at = time.monotonic()
        if self.pipe is not None:
            try:
                self.pipe.send((name, values))
            except (OSError, ValueError):
                return  # its end is told by the thread that reads

    @property
    def silent_for(self) -> float:
        """How long it has not answered what it was asked, s."""
        return time.monotonic() - self.asked_at if self.heard_at < self.asked_at else 0.0

    def revive(self) -> None:
        """End the process, and begin a new one that comes to the same state."""
        begun, log, tick = self.begun, self.log, self.tick
        self.stop()
        self.start()
        if begun is not None:
            self.send("begin", **{**begun, "log": tuple(log), "tick": tick})
            self.begun, self.log, self.tick = begun, log, tick

    def stop(self) -> None:
        """End the process."""
        process, self.process, pipe, self.pipe = self.process, None, self.pipe, None
        if pipe is not None:
            pipe.close()
        if process is not None:
            process.kill()
            process.join()
