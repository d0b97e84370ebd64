"""Messages between an executor and its workers, and the loop in which a worker answers them.

In: bytes. Out: whole messages, each after its length in eight bytes; half a message of a worker
that was killed is dropped::

    send(b"abc")  ->  03 00 00 00 00 00 00 00 61 62 63
"""

from __future__ import annotations

import os
import pickle
import queue
import socket
import struct
import threading
from typing import Any, NoReturn

from runtime.errors import text_of

_LENGTH = struct.Struct("<Q")
_CHUNK = 1 << 20
_CHUNKS = 64  # read at once, each at most a system buffer; then other channels are served


class MessageChannel:
    """Complete messages over a socket, without ever blocking.

    A message that its sender did not complete because it died is dropped: :meth:`receive` returns
    the complete ones, and whether there will be no more.
    """

    def __init__(self, link: socket.socket) -> None:
        link.setblocking(False)
        self.link = link
        self._incoming = bytearray()
        self._outgoing = bytearray()

    @property
    def is_flushed(self) -> bool:
        """Whether everything passed to :meth:`send` has been sent."""
        return not self._outgoing

    def send(self, message: bytes) -> None:
        """Send what fits into the buffer, and keep the rest for :meth:`flush`."""
        self._outgoing += _LENGTH.pack(len(message))
        self._outgoing += message
        self.flush()

    def flush(self) -> None:
        """Send more of the rest; a closed connection is reported by :meth:`receive`."""
        try:
            while self._outgoing:
                del self._outgoing[: self.link.send(self._outgoing[:_CHUNK])]
        except BlockingIOError:
            return
        except OSError:
            self._outgoing.clear()

    def receive(self) -> tuple[list[bytes], bool]:
        """The messages that are complete by now, and whether the other end has closed."""
        is_closed = self._read()
        messages = []
        while len(self._incoming) >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._incoming)
            end = _LENGTH.size + length
            if len(self._incoming) < end:
                break
            messages.append(bytes(self._incoming[_LENGTH.size : end]))
            del self._incoming[:end]
        return messages, is_closed

    def _read(self) -> bool:
        """Read what has arrived: all of it from a dead sender, since a few chunks hold it."""
        try:
            for _ in range(_CHUNKS):
                data = self.link.recv(_CHUNK)
                if not data:
                    return True
                self._incoming += data
        except BlockingIOError:
            return False
        except OSError:
            return True
        return False

    def close(self) -> None:
        """Close this end, which the other end notices."""
        self.link.close()


def serve_calls(link: socket.socket) -> NoReturn:
    """The main loop of a worker: answer calls one by one, until the other end closes.

    A thread listens, so that the worker also ends if the executor's process is killed while a call
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
            (length,) = _LENGTH.unpack(_receive_exactly(link, _LENGTH.size))
            calls.put(_receive_exactly(link, length))
    finally:
        os._exit(0)


def _receive_exactly(link: socket.socket, length: int) -> bytes:
    received = bytearray()
    while len(received) < length:
        data = link.recv(min(_CHUNK, length - len(received)))
        if not data:
            raise EOFError
        received += data
    return bytes(received)


def _send(link: socket.socket, message: bytes) -> None:
    link.sendall(_LENGTH.pack(len(message)))
    link.sendall(message)


def _answer(message: bytes) -> bytes:
    """What a call returned or raised, as (value, None) or (None, error)."""
    try:
        call, arguments, named = pickle.loads(message)
        return pickle.dumps((call(*arguments, **named), None), pickle.HIGHEST_PROTOCOL)
    except BaseException as error:  # noqa: BLE001 -- the caller handles it
        return _error_answer(error)


def _error_answer(error: BaseException) -> bytes:
    plain: Any = RuntimeError(f"{type(error).__name__}: {text_of(error)}")
    if isinstance(error, Exception):  # anything else would end the calling process
        try:
            data = pickle.dumps((None, error))
            pickle.loads(data)
            return data
        except Exception:  # noqa: BLE001 -- an exception class defined by the user may do anything
            pass
    return pickle.dumps((None, plain))
