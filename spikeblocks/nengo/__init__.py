"""Models of Nengo as graphs, and on our engines, with Nengo's public interface alone.

    from spikeblocks.nengo import Simulator

It offers that class and the verb ``import`` (extra ``nengo``). To delete it, remove this folder,
tests/bridges/nengo, tests/gallery/coming_from.py and its lines in pyproject.toml; nothing else
names it.
"""

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from spikeblocks.nengo.simulator import Simulator
else:
    __getattr__ = door(__name__)

__all__ = ["Simulator"]
