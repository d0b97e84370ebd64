"""Names that a package imports when they are first used, so that its other modules load faster."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any


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
