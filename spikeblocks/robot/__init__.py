"""Robots: recorded data and live topics as the signals of a graph.

    messages    a signal to and from a ROS message          bags      bag files, read and written
    ports       which topic is which port: robot.yaml       safety    when a command may be sent
    transports  UDP, serial line, zenoh; your own adapter   driving   a session between topics

It offers the block ``FromBag``, the verbs ``bag``, ``play``, ``drive`` and ``serve-plant``
(extras ``ros``, ``robot``). To delete it, remove this folder,
tests/bridges/robot, docs/robot.md, examples/robot and its lines in pyproject.toml; nothing else
names it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from spikeblocks.robot.from_bag import FromBag
else:
    __getattr__ = door(__name__)

__all__ = ["FromBag"]
