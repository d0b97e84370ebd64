"""A graph as an FMU for co-simulation: the target ``fmu`` of ``runtime export``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.export import ExportTarget

if TYPE_CHECKING:
    from runtime.export import Exported
    from runtime.graph import Graph


def export_fmu(graph: Graph, folder: str | Path, **options: Any) -> Exported:
    """Write a graph as an FMU: see :func:`spikeblocks.fmu.export.writing.export_fmu`."""
    from spikeblocks.fmu.export.writing import export_fmu

    return export_fmu(graph, folder, **options)


FMI = {"type": int, "choices": (2, 3), "help": "version of an FMU's interface: 3 (default) or 2"}
TARGET = ExportTarget("an FMU", export_fmu, {"fmi": FMI})
