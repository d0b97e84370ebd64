"""Compiled text on disk: Python modules named by what they hold, with numba's cache beside them.

A module's name is a hash of its text, of what it calls and of numba's version, so nothing in the
folder is ever out of date, and two processes that write the same file write the same text.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType

PACKAGE = "spikeblocks_kernels"
VARIABLE = "SPIKEBLOCKS_CACHE"


def folder() -> Path:
    """Where compiled text is kept: ``$SPIKEBLOCKS_CACHE``, or the user's cache folder."""
    chosen = os.environ.get(VARIABLE)
    base = os.environ.get("XDG_CACHE_HOME")
    wanted = Path(chosen) if chosen else Path(base or Path.home() / ".cache") / "spikeblocks"
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            pass
    except OSError:
        wanted = Path(tempfile.gettempdir()) / f"spikeblocks-{os.getuid()}"
        wanted.mkdir(parents=True, exist_ok=True)
    return wanted


@cache
def salt() -> str:
    """What compiled text depends on beside itself."""
    import numba

    from runtime.compiled import primitives

    text = Path(primitives.__file__).read_text(encoding="utf-8")
    return f"{numba.__version__} {sys.version} {text}"


def digest(*parts: str) -> str:
    """A short name for texts."""
    return hashlib.sha256("\0".join((salt(), *parts)).encode()).hexdigest()[:20]


def write(name: str, text: str) -> Path:
    """Put a file into the folder, whole or not at all; what is there already stays."""
    path = folder() / name
    if not path.exists():
        with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False, encoding="utf-8") as f:
            f.write(text)
        Path(f.name).replace(path)
    return path


def module(kind: str, text: str) -> ModuleType:
    """The module of a text, written if it is new."""
    name = f"{kind}_{digest(text)}"
    where = str(write(f"{name}.py", text).parent)
    if PACKAGE not in sys.modules:
        package = ModuleType(PACKAGE)
        package.__path__ = [where]
        sys.modules[PACKAGE] = package
    elif where not in sys.modules[PACKAGE].__path__:
        sys.modules[PACKAGE].__path__.append(where)
    importlib.invalidate_caches()
    return importlib.import_module(f"{PACKAGE}.{name}")
