"""Models of Nengo as graphs, with Nengo's public interface alone (extra ``nengo``).

A bridge: its doors are the verb ``import`` and ``spikeblocks.nengo``, and nothing else names it.
"""

from typing import TYPE_CHECKING

from blocks.lazy import door
from runtime.nengo.verb import EXAMPLES, GROUP, HELP, add, run

if TYPE_CHECKING:
    from runtime.nengo.simulator import Simulator
else:
    __getattr__ = door(__name__)

__all__ = ["EXAMPLES", "GROUP", "HELP", "Simulator", "add", "run"]
