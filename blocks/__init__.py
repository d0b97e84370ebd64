"""Typed blocks: what a block is, and every block of the library.

    from blocks import Block, Gain, Input, Output, Scalar, param

The names are those of :mod:`blocks.library`, which is imported with the first of them, so that
``runtime --help`` does not wait for NumPy and a hundred blocks.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from blocks.library import *


def __getattr__(name: str) -> Any:
    # Python asks for names of its own, such as __path__, of a package that is being imported.
    if name != "__all__" and name.startswith("__"):
        raise AttributeError(f"module 'blocks' has no attribute '{name}'")
    library = importlib.import_module("blocks.library")
    exported = [each for each in getattr(library, "__all__", ()) if hasattr(library, each)]
    globals().update((each, getattr(library, each)) for each in exported)
    globals()["__all__"] = exported
    if name in globals():  # rooms as well, which the library has imported, as blocks.core
        return globals()[name]
    raise AttributeError(f"module 'blocks' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(importlib.import_module("blocks.library").__all__)
