"""A package's door whose names are imported when they are first used, so that programs start fast.

In: the text of the package, which imports its names for type checkers alone. Out: its
``__getattr__``, which imports a name from there::

    if TYPE_CHECKING:
        from blocks.generic.arithmetic import Gain
    else:
        __getattr__ = door(__name__)

Packages for users have an ``__all__`` besides; the doors of other rooms show what they import.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from blocks.library.index import OTHERS, TYPES


def door(package: str) -> Callable[[str], Any]:
    """The ``__getattr__`` of a package."""
    indexed = {**OTHERS, **TYPES}.items() if f"{package}.".startswith("blocks.") else ()
    homes = {name: f"blocks.{module}:{name}" for name, module in indexed}

    def attribute(name: str) -> Any:
        if name not in homes and not name.startswith("__"):  # of runtime, or newer than the index
            homes.update(exports(package))
        if name not in homes or name not in getattr(sys.modules[package], "__all__", homes):
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        module, _, original = homes[name].partition(":")
        found = getattr(importlib.import_module(module), original)
        setattr(sys.modules[package], name, found)
        return found

    return attribute


def exports(package: str) -> dict[str, str]:
    """What a package's text imports, each name with where it is, as ``module:name``."""
    import ast

    tree = ast.parse(Path(str(sys.modules[package].__file__)).read_text(encoding="utf-8"))
    return {
        alias.asname or alias.name: f"{node.module}:{alias.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
