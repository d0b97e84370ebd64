"""Messages between a pool and its workers, and what a worker does with them."""

from __future__ import annotations

import os
import pickle
import queue
import socket
import struct
import threading
from typing import Any, NoReturn

_LENGTH = struct.Struct("<Q")
_CHUNK = 1 << 20
_CHUNKS = 64  # at once, each no longer than the system's buffer; then it is another line's turn


class Line:
    """Whole messages over a socket, without ever waiting for the other end.

    A message that was cut off by the death of its sender is none: :meth:`receive` gives those
    that are complete, and says when there will be no more.
    """

    def __init__(self, link: socket.socket) -> None:
        link.setblocking(False)
        self.link = link
        self._come = bytearray()
        self._to_go = bytearray()

    @property
    def is_clear(self) -> bool:
        """Whether all that was sent has gone out."""
        return not self._to_go

    def send(self, message: bytes) -> None:
        """Send what fits, and keep the rest for :meth:`flush`."""
        self._to_go += _LENGTH.pack(len(message))
        self._to_go += message
        self.flush()

    def flush(self) -> None:
        """Send more of what is left; that the other end is gone is for :meth:`receive` to say."""
        try:
            while self._to_go:
                del self._to_go[: self.link.send(self._to_go[:_CHUNK])]
        except BlockingIOError:
            return
        except OSError:
            self._to_go.clear()

    def receive(self) -> tuple[list[bytes], bool]:
        """The messages that are complete by now, and whether the other end is gone."""
        is_over = self._read()
        messages = []
        while len(self._come) >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._come)
            end = _LENGTH.size + length
            if len(self._come) < end:
                break
            messages.append(bytes(self._come[_LENGTH.size : end]))
            del self._come[:end]
        return messages, is_over

    def _read(self) -> bool:
        """Take in what has come: of a dead sender all of it, which a few chunks hold."""
        try:
            for _ in range(_CHUNKS):
                data = self.link.recv(_CHUNK)
                if not data:
                    return True
                self._come += data
        except BlockingIOError:
            return False
        except OSError:
            return True
        return False

    def close(self) -> None:
        """Let the other end know that this one is gone."""
        self.link.close()


def attend(link: socket.socket) -> NoReturn:
    """Be a worker: answer calls, one after the other, until the other end is gone.

    A thread listens, so that the worker also ends where the pool's process is killed while a call
    runs.
    """
    calls: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(link, calls), daemon=True).start()
    _send(link, pickle.dumps(os.getpid()))
    while True:
        answer = _answer(calls.get())
        _send(link, answer)


def _listen(link: socket.socket, calls: queue.SimpleQueue[bytes]) -> None:
    try:
        while True:
            (length,) = _LENGTH.unpack(_exactly(link, _LENGTH.size))
            calls.put(_exactly(link, length))
    finally:
        os._exit(0)


def _exactly(link: socket.socket, length: int) -> bytes:
    found = bytearray()
    while len(found) < length:
        data = link.recv(min(_CHUNK, length - len(found)))
        if not data:
            raise EOFError
        found += data
    return bytes(found)


def _send(link: socket.socket, message: bytes) -> None:
    link.sendall(_LENGTH.pack(len(message)))
    link.sendall(message)


def _answer(message: bytes) -> bytes:
    """What a call returned or raised, as (value, None) or (None, error)."""
    try:
        call, arguments, named = pickle.loads(message)
        return pickle.dumps((call(*arguments, **named), None), pickle.HIGHEST_PROTOCOL)
    except BaseException as error:  # noqa: BLE001 -- it is for the caller to know
        return _raised(error)


def _raised(error: BaseException) -> bytes:
    plain: Any = RuntimeError(f"{type(error).__name__}: {error}")
    if isinstance(error, Exception):  # anything else would end the process that asks
        try:
            data = pickle.dumps((None, error))
            pickle.loads(data)
            return data
        except Exception:  # noqa: BLE001 -- a class of the caller's own may do anything
            pass
    return pickle.dumps((None, plain))
