"""Train a policy that balances a pole, and compare it with a regulator on other seeds.

python examples/train_policy.py [GENERATIONS]          needs: pip install 'spikeblocks[gym]'
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

import spikeblocks
import spikeblocks.gym
from runtime.experiments.analysis import difference, estimate

GENERATIONS = int(sys.argv[1]) if len(sys.argv) > 1 else 10
HELD_OUT = range(1000, 1020)


def start(rng: np.random.Generator) -> dict[str, Any]:
    """Each episode begins elsewhere."""
    return {"cart.x0": rng.uniform([-0.5, -0.2, -0.3, -0.2], [0.5, 0.2, 0.3, 0.2])}


def environment(graph: spikeblocks.Graph) -> spikeblocks.gym.GraphEnv:
    return spikeblocks.gym.make(
        graph, reward="reward.out", terminated="fallen.out", start=start, engine="compiled"
    )


def episode(env: spikeblocks.gym.GraphEnv, gains: Any, seed: int) -> float:
    """The sum of the rewards when the force is gains @ observation."""
    total, is_over = 0.0, False
    observation, _ = env.reset(seed=seed)
    while not is_over:
        action = np.clip([gains @ observation], env.action_space.low, env.action_space.high)
        observation, reward, terminated, truncated, _ = env.step(action)
        total, is_over = total + reward, terminated or truncated
    return total


def train(env: spikeblocks.gym.GraphEnv, rng: np.random.Generator) -> Any:
    """The cross-entropy method: sample gains around the best ones of the generation before."""
    mean, spread = np.zeros(4), np.full(4, 20.0)
    for generation in range(GENERATIONS):
        seeds = (2 * generation, 2 * generation + 1)
        policies = rng.normal(mean, spread, (16, 4))
        scores = [np.mean([episode(env, gains, seed) for seed in seeds]) for gains in policies]
        best = policies[np.argsort(scores)[-4:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 1.0
        print(f"generation {generation + 1:2}: best {max(scores):6.1f}, gains {mean.round(1)}")
    return mean


graph = spikeblocks.load("gallery/cart_pole_balance").set("run.until", 4.0)
plant = environment(graph.without("lqr"))
gains = train(plant, np.random.default_rng(0))
learned = [episode(plant, gains, seed) for seed in HELD_OUT]

regulator = environment(graph)  # it controls the cart itself: nothing is added to its force
designed = [episode(regulator, np.zeros(4), seed) for seed in HELD_OUT]

for name, rewards in (("learned", learned), ("designed", designed)):
    print(f"{name:9} {estimate(rewards).mean:6.1f} of {plant.graph.network.ticks // plant.steps}")
found = difference(learned, designed, "ranks")
print(
    f"learned - designed over {found.n} seeds: {found.mean:+.2f} "
    f"[{found.low:+.2f}, {found.high:+.2f}], p = {found.p:.2g}"
)
