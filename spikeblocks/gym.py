"""Graphs as environments of Gymnasium: see ``docs/gym.md``."""

from __future__ import annotations

from runtime.gym import GraphEnv, make

__all__ = ["GraphEnv", "make"]
