"""A graph as one HTML file that simulates it in the reader's browser, by WebAssembly.

It offers the target ``html`` of ``runtime export`` (extra ``compiler``). To delete it, remove this
folder, tests/bridges/page, its lines in pyproject.toml and docs/pages.md; nothing else names it but
the generator of the site, docs/site_pages.py.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.export import ExportTarget

if TYPE_CHECKING:
    from runtime.export import Exported
    from runtime.graph import Graph


def export_page(graph: Graph, folder: str | Path, **options: Any) -> Exported:
    """Write a page that simulates a graph: see :func:`spikeblocks.page.writing.export_page`."""
    from spikeblocks.page.writing import export_page

    return export_page(graph, folder, **options)


SLIDER = {
    "action": "append",
    "metavar": "NAME=LOW..HIGH",
    "help": "a value that the reader of a page may change, as fault.gain[1]=0..1",
}
PAGE = ExportTarget("a page", export_page, {"slider": SLIDER})
