"""A graph from a file or a mapping: ``load("gallery/pendulum")``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from runtime.document import Source, read_graph
from runtime.graph.content import Content
from runtime.graph.graph import Graph


def load(source: Source, *, modules: bool = True) -> Graph:
    """Load a graph from a file, the name of a shipped graph, or a mapping.

    Loading reads text alone. Python files that the text names as ``module`` are imported when the
    graph is checked, and never with ``modules=False``: their blocks are then errors.

    Raises
    ------
    GraphError : the text cannot be read. Use :meth:`Graph.check` for the graph itself.
    """
    document, read = read_graph(source)
    path = None if isinstance(source, Mapping) else Path(document.where.file)
    return Graph._of(Content(document, source=path, modules=modules, files=read))
