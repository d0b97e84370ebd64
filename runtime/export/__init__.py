"""A part of a graph as C for a microcontroller, with a test that replays a recorded run.

``selection`` is what is exported, ``units`` the blocks' C text, ``tuning`` what follows from their
parameters; ``files`` and ``library`` write around it, ``recording`` is the run to compare with,
``report`` what it all needs. What a block stores to and how many operations it takes is asked of
its typed form (``stored`` and ``Counter`` of :mod:`runtime.codegen`).
"""

from pathlib import Path

from runtime.export.controller import Exported, export
from runtime.export.targets import TARGETS, ExportTarget

__all__ = ["TARGETS", "ExportTarget", "Exported", "export", "page_asset"]


def page_asset(file: str) -> str:
    """The text of a file that pages contain, as ``uplot.js``."""
    return (Path(__file__).parent / "page" / file).read_text(encoding="utf-8")
