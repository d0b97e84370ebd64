"""A part of a graph as C for a microcontroller, with a test that replays a recorded run.

``selection`` is what is exported, ``units`` the blocks' C text, ``tuning`` what follows from their
parameters, ``unchanged`` what is constant; ``files`` and ``library`` write around it,
``recording`` is the run to compare with, ``report`` what it all needs.
"""

from runtime.export.controller import Exported, export
from runtime.export.targets import TARGETS, ExportTarget

__all__ = ["TARGETS", "ExportTarget", "Exported", "export"]
