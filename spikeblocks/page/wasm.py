"""C text as a WebAssembly module, by the compiler of the package ziglang.

In goes one C source, out come the bytes of a module that needs nothing of its host: a reactor of
wasm32-wasi, whose C library has math.h; wasm32-freestanding has none.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from runtime.errors import MissingExtraError, UsageError
from runtime.toolchain import digest, read, write

FLAGS = (
    *("-target", "wasm32-wasi", "-mexec-model=reactor", "-std=gnu99", "-O2"),
    *("-ffp-contract=off", "-s", "-Wl,-z,stack-size=262144", "-lm"),
)


def module(source: str) -> bytes:
    """The module of a C source; the same source is compiled once.

    Raises
    ------
    MissingExtraError : ziglang is not installed.
    UsageError : the compiler does not accept the source.
    """
    if find_spec("ziglang") is None:
        raise MissingExtraError("a page that simulates", "compiler")
    name = f"page_{digest(source, *FLAGS)}.wasm"
    kept = read(name)
    if kept is not None:
        return kept
    with tempfile.TemporaryDirectory() as place:
        path = Path(place, "page.c")
        path.write_text(source, encoding="utf-8")
        made = path.with_suffix(".wasm")
        command = [sys.executable, "-m", "ziglang", "cc", *FLAGS, str(path), "-o", str(made)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or ["no message"]
            raise UsageError(f"the compiler of ziglang refuses the C of the page: {lines[0]}")
        found = made.read_bytes()
    with suppress(OSError):
        write(name, found)
    return found
