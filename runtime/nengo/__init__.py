"""Models of Nengo as graphs, with Nengo's public interface alone (extra ``nengo``).

A bridge: its door is the verb ``import``, and nothing but the table of verbs names it.
"""

from runtime.nengo.verb import EXAMPLES, HELP, add, run

__all__ = ["EXAMPLES", "HELP", "add", "run"]
