"""What starts worker processes here: a fork server where the system can fork, else one by one.

In: nothing. Out: a :class:`Starter`, kept for the next executor: on Linux a fork server, which has
imported all that a trial needs before the first graph is checked; on Windows a spawner.
"""

from __future__ import annotations

import os
import socket
import sys

from runtime.experiments.processes.starter import Starter


def make() -> Starter:
    """What starts workers on this system."""
    if sys.platform != "win32" and hasattr(os, "fork") and hasattr(socket, "send_fds"):
        from runtime.experiments.processes.forkserver import ForkServer

        return ForkServer()
    from runtime.experiments.processes.spawner import Spawner

    return Spawner()


_spare: list[Starter] = []


def start_early() -> None:
    """Make a starter before it is needed, so that a fork server imports meanwhile."""
    if not _spare:
        _spare.append(make())


def take() -> Starter:
    """A starter for one executor: the spare one if it is still alive, else a new one."""
    while _spare:
        starter = _spare.pop()
        starter.reports()
        if starter.is_alive:
            return starter
        starter.close()
    return make()


def give_back(starter: Starter) -> None:
    """Keep a starter for the next executor."""
    _spare.append(starter)
