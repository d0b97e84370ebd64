"""What blocks of a graph can be exported to; packages offer further targets.

[project.entry-points."spikeblocks.exports"]
rust = "my_package:RUST"
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from blocks.extensions import Registry
from runtime.export.controller import Exported, export
from runtime.export.fmu import export_fmu
from runtime.export.html import export_page
from runtime.export.library import export_library


@dataclass(frozen=True)
class ExportTarget:
    """A language or format that blocks of a graph are written in.

    Parameters
    ----------
    doc : what it is, in a few words.
    write : writes the files, with the arguments of :func:`runtime.export.export`.
    """

    doc: str
    write: Callable[..., Exported]


OWN = {
    "c": ExportTarget("C99", export),
    "library": ExportTarget("a shared library with a C header and a Python module", export_library),
    "fmu": ExportTarget("an FMU for co-simulation", export_fmu),
    "html": ExportTarget("one HTML file that simulates the graph", export_page),
}
TARGETS: Registry[ExportTarget] = Registry("exports", ExportTarget, "an ExportTarget", own=OWN)
