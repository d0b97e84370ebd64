"""The cache of compiled text on disk: files named by a hash of their content.

A module's name is a hash of its text, of what it calls and of numba's version, so no file in the
folder is ever out of date, and two processes that write the same file write the same text. The
files that numba adds for a module are listed with their hashes (:func:`seal`); files that differ
are deleted before numba reads them (:func:`module`) and compiled again. Only the user may write to
the folder, since its content is executed.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
import tempfile
import threading
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from runtime.toolchain import VARIABLE, folder

__all__ = ["PACKAGE", "VARIABLE", "digest", "folder", "module", "seal", "write"]

PACKAGE = "spikeblocks_kernels"
_LOADING = threading.RLock()


@cache
def salt() -> str:
    """What compiled text depends on, apart from itself."""
    import numba

    from runtime.engine.compiled import primitives

    text = Path(primitives.__file__).read_text(encoding="utf-8")
    return f"{numba.__version__} {sys.version} {text}"


def digest(*parts: str) -> str:
    """A short name for texts."""
    return hashlib.sha256("\0".join((salt(), *parts)).encode()).hexdigest()[:20]


def write(name: str, text: str) -> Path:
    """Write a file to the folder atomically; one with the same text is kept."""
    path = folder() / name
    if _bytes(path) != text.encode():
        if path.is_dir():
            _discard(path)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False, encoding="utf-8") as f:
            f.write(text)
        Path(f.name).replace(path)
    return path


def write_record(name: str, record: Any) -> None:
    """Write plain data to the folder, with its hash."""
    text = json.dumps(record, sort_keys=True)
    write(name, f"{_hash(text.encode())}\n{text}\n")


def read_record(name: str) -> Any:
    """Plain data from the folder; None if the file is missing or was changed."""
    found, _, rest = (_bytes(folder() / name) or b"").partition(b"\n")
    text = rest.removesuffix(b"\n")
    return json.loads(text) if found.decode("ascii", "replace") == _hash(text) else None


def module(kind: str, text: str) -> ModuleType:
    """The module of a text; numba's files for it are deleted if they were changed."""
    name = f"{kind}_{digest(text)}"
    full = f"{PACKAGE}.{name}"
    with _LOADING:
        path = write(f"{name}.py", text)
        known = sys.modules.get(full)
        if known is not None and known.__file__ == str(path):
            return known
        listed = read_record(f"{name}.sealed")
        if listed != _hashes(name):
            for file in _kept(name):
                _discard(file)
        sys.modules.setdefault(PACKAGE, ModuleType(PACKAGE))
        made = ModuleType(full)
        made.__file__ = str(path)
        # Not imported: bytecode on disk would be another file that may be damaged.
        exec(compile(text, str(path), "exec"), made.__dict__)
        sys.modules[full] = made
        return made


def seal(names: Iterable[str]) -> None:
    """Store the hashes of numba's files for these modules (full names) after compilation."""
    for name in {name.removeprefix(f"{PACKAGE}.") for name in names}:
        with suppress(OSError):  # an unlisted module is compiled again next time
            write_record(f"{name}.sealed", _hashes(name))


def _kept(name: str) -> list[Path]:
    """numba's files for a module: an index for each function, and its machine code."""
    found = (folder() / "__pycache__").glob(f"{name}.*")
    return sorted(file for file in found if file.suffix in (".nbi", ".nbc"))


def _discard(path: Path) -> None:
    """Remove a file, or a folder of that name."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _hashes(name: str) -> dict[str, str]:
    return {file.name: _hash(_bytes(file) or b"") for file in _kept(name)}


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _bytes(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except OSError:
        return None
