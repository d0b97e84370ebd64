"""A graph in Python: ``graph`` is the class for users, ``content`` what one consists of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.graph.checked import BlockInfo, WireInfo
    from runtime.graph.content import Content, Examination, examine
    from runtime.graph.graph import Graph
    from runtime.graph.loading import load
    from runtime.graph.repeating import RepeatedRuns
    from runtime.graph.replaying import is_session, open_session, resumable
else:
    __getattr__ = door(__name__)
