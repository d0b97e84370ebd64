"""A part of a graph as C for a microcontroller, with a test that replays a recorded run.

``selection`` is what is exported, ``units`` the blocks' C text, ``tuning`` what follows from their
parameters; ``files`` and ``library`` write around it, ``recording`` is the run to compare with,
``report`` what it all needs. What a block stores to and how many operations it takes is asked of
its typed form (``stored`` and ``Counter`` of :mod:`runtime.codegen`). A target of another package
gets the C of a whole graph from ``make_layout``, ``header`` and ``source``.
"""

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.export.controller import Exported, about, export, make_layout, make_units
    from runtime.export.files import header, source
    from runtime.export.interface import literal
    from runtime.export.layout import Layout, comment
    from runtime.export.names import check_name, member_name, unused
    from runtime.export.targets import TARGETS, ExportTarget
    from runtime.export.units import Units
else:
    __getattr__ = door(__name__)

__all__ = [
    "TARGETS",
    "ExportTarget",
    "Exported",
    "Layout",
    "Units",
    "about",
    "check_name",
    "comment",
    "export",
    "header",
    "literal",
    "make_layout",
    "make_units",
    "member_name",
    "source",
    "unused",
]
