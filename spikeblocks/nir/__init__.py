"""Populations of neurons as a NIR file, which neuromorphic hardware and other simulators read.

It offers the target ``nir`` of ``runtime export`` (extra ``nir``). To delete it, remove this
folder, tests/bridges/nir, docs/nir.md and its lines in pyproject.toml; nothing else names it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.export import ExportTarget

if TYPE_CHECKING:
    from runtime.export import Exported
    from runtime.graph import Graph


def export_nir(graph: Graph, folder: str | Path, **options: Any) -> Exported:
    """Write populations as NIR: see :func:`spikeblocks.nir.writing.export_nir`."""
    from spikeblocks.nir.writing import export_nir

    return export_nir(graph, folder, **options)


NIR = ExportTarget("NIR, for neuromorphic hardware", export_nir)
