"""Names that a package imports when they are first used, so that its other modules load faster.

In: the name of a package, and in which module each of its names is. Out: its ``__getattr__``::

    __getattr__ = importer(__name__, {"Unit": "runtime.codegen.unit"})
    __getattr__ = door(__name__)                     # of a room of blocks; its names in index.py
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from blocks.index import OTHERS, TYPES


def importer(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """The ``__getattr__`` of a package.

    Parameters
    ----------
    homes : the module of each name; or, where it has another name there, module:name.
    """

    def attribute(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        module, _, original = homes[name].partition(":")
        return getattr(importlib.import_module(module), original or name)

    return attribute


def door(room: str) -> Callable[[str], Any]:
    """The ``__getattr__`` of a room of blocks, or of ``blocks``, which has all their names."""
    inside = {**OTHERS, **TYPES}.items()
    homes = {name: module for name, module in inside if f"blocks.{module}".startswith(f"{room}.")}

    def attribute(name: str) -> Any:
        if name not in homes and name in getattr(sys.modules[room], "__all__", ()):
            homes.update(exports(room.partition(".")[2]))  # the index is older than the door
        return importer(room, {key: f"blocks.{module}" for key, module in homes.items()})(name)

    return attribute


def exports(room: str) -> dict[str, str]:
    """What a room's door exports, and from which module; of '' what ``blocks`` has of the core.

    Read from the text of the door, whose imports are for type checkers alone.
    """
    import ast

    tree = ast.parse((Path(__file__).parent / room / "__init__.py").read_text(encoding="utf-8"))
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            module = node.module.removeprefix("blocks.")
            if module.startswith(f"{room}.") if room else module == "core":
                found.update(dict.fromkeys((alias.name for alias in node.names), module))
    return found
