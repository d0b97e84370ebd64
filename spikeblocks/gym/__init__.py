"""Graphs as environments of Gymnasium (extra ``gym``).

In: a graph with the sections ``inputs`` and ``outputs``. Out: an environment for one agent, which
is a session that is stepped::

    import spikeblocks.gym

    env = spikeblocks.gym.make("gallery/cart_pole_balance", reward="reward.out")
    observation, info = env.reset(seed=3)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

``gymnasium.make("spikeblocks.gym:spikeblocks/Graph-v0", graph=..., reward=...)`` and ``make_vec``
give the same. To delete it, remove this folder, tests/bridges/gym, the extra in pyproject.toml,
docs/gym.md and examples/train_policy.py; nothing else names it.
"""

from __future__ import annotations

from runtime.errors import MissingExtraError

try:
    import gymnasium
except ImportError:
    raise MissingExtraError("an environment", "gym") from None
from spikeblocks.gym.environment import GraphEnv

__all__ = ["GraphEnv", "make"]

ID = "spikeblocks/Graph-v0"
make = GraphEnv
if ID not in gymnasium.registry:
    gymnasium.register(ID, entry_point=f"{__name__}:GraphEnv")
