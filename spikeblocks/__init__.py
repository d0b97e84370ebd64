"""The name that is installed: ``import spikeblocks`` gives what ``import runtime`` does.

    import spikeblocks

    graph = spikeblocks.load("starters/adaptive")
    spikeblocks.blocks.Gain(gain=2.0)

The two packages that it consists of are ``blocks`` and ``runtime``.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import runtime

if not hasattr(runtime, "PACKAGE") or Path(runtime.PACKAGE) != Path(__file__).parents[1]:
    raise ImportError(
        f"your own '{runtime.__file__ or runtime.__path__[0]}' hides the package 'runtime' of "
        "spikeblocks; rename it, or start Python in another folder"
    )

__all__ = [*runtime.__all__, "blocks"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # not at the start of every command

        return version(__name__)
    return importlib.import_module("blocks") if name == "blocks" else getattr(runtime, name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
