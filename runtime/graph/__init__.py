"""A graph in Python: ``graph`` is the class for users, ``content`` what one consists of."""

from runtime.graph.content import Content, Examined, examined
from runtime.graph.graph import Graph, load

__all__ = ["Content", "Examined", "Graph", "examined", "load"]
