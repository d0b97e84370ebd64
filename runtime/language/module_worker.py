"""A process that imports one Python file of blocks, and answers questions about its classes.

In: questions, on the standard input of ``python -m runtime.language.module_worker FILE``. Out:
answers, on its standard output, each as a pickled tuple after its length: ("construct",
"Saturator", {"limit": 2.0}) is answered by ("done", (lengths, type variables)). The file is run
once; what it prints goes to standard error. The process ends with its input.
"""

from __future__ import annotations

import io
import os
import pickle
import struct
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from blocks.core import REQUIRED, Block, BlockSpec, ParameterError, SignalType
from blocks.library.registry import blocks_of_module, types_of_module
from runtime.errors import raised_at, text_of

_LENGTH = struct.Struct(">Q")
_MARK = "required"
OVERRIDES = ("__init__", "validate", "sizes", "variables")
# A length beyond this is no length: something else wrote to the pipe.
MAX_MESSAGE = 2**26


class _Pickler(pickle.Pickler):
    """Keeps the identity of the mark for required parameters."""

    def persistent_id(self, obj: Any) -> str | None:
        return _MARK if obj is REQUIRED else None


class _Unpickler(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Any:
        return REQUIRED


def pack(value: Any) -> bytes:
    """A value as bytes."""
    buffer = io.BytesIO()
    _Pickler(buffer).dump(value)
    return buffer.getvalue()


def unpack(data: bytes) -> Any:
    """The value that :func:`pack` packed."""
    return _Unpickler(io.BytesIO(data)).load()


def send(stream: IO[bytes], value: Any) -> None:
    """Write one message."""
    data = pack(value)
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read one message.

    Raises
    ------
    EOFError : there is none, or it is not one.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (size,) = _LENGTH.unpack(head)
    data = stream.read(size) if size <= MAX_MESSAGE else b""
    if size > MAX_MESSAGE or len(data) < size:
        raise EOFError
    return unpack(data)


def describe(file: Path) -> tuple[list[dict[str, Any]], list[SignalType]]:
    """What a file defines, as plain data: its block types and the signal types among its names."""
    classes: list[dict[str, Any]] = []
    for name, cls in blocks_of_module(file).items():
        spec: BlockSpec = cls.spec
        own = {key for key in OVERRIDES if getattr(cls, key) is not getattr(Block, key)}
        classes.append(
            {
                "key": name,
                "name": cls.__name__,
                "module": cls.__module__,
                "doc": cls.__doc__,
                "spec": spec,
                "overrides_construction": bool(own),
                "overrides_check": cls.validate_in is not Block.validate_in,
            }
        )
    return classes, types_of_module(file)


def construct(file: Path, name: str, values: dict[str, Any]) -> tuple[Any, Any]:
    """Lengths and type variables of a block with these parameters."""
    block = blocks_of_module(file)[name](**values)
    return dict(block.sizes()), dict(block.variables)


def check(file: Path, name: str, values: dict[str, Any], context: Any) -> None:
    """Let a block check its place in a graph."""
    blocks_of_module(file)[name](**values).validate_in(context)


def hello(file: Path) -> None:
    """Say that the process is ready; the file is not touched."""


QUESTIONS: dict[str, Callable[..., Any]] = {
    "hello": hello,
    "describe": describe,
    "construct": construct,
    "check": check,
}


def answer(file: Path, question: tuple[Any, ...]) -> tuple[str, Any]:
    """The answer to one question: ``done`` with a value, or what went wrong."""
    try:
        return "done", QUESTIONS[question[0]](file, *question[1:])
    except ParameterError as error:
        return "problems", list(error.problems)
    except FileNotFoundError:
        return "missing", ""
    except SyntaxError as error:
        return "syntax", (error.msg, error.lineno)
    except BaseException as error:  # noqa: BLE001 -- a user's file may raise anything
        return "failed", (type(error).__name__, text_of(error), raised_at(error))


# A file in an endless loop never reads its input again, and would outlive a server that was killed.
def _end_with(parent: int) -> None:
    """End this process when the one that started it has ended, even while the file runs."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(0)


def main() -> None:
    """Answer questions about the file that the command line names."""
    file = Path(sys.argv[1])
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the file prints must not look like an answer
    source = os.fdopen(os.dup(0), "rb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    while True:
        try:
            question = receive(source)
        except (EOFError, OSError):
            return
        send(output, answer(file, question))


if __name__ == "__main__":
    main()
