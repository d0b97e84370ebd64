"""A graph in Python: ``graph`` is the class for users, ``content`` what one consists of."""

from runtime.graph.content import Content, Examination, examine, examine_edit
from runtime.graph.graph import Graph
from runtime.graph.loading import load

__all__ = ["Content", "Examination", "Graph", "examine", "examine_edit", "load"]
