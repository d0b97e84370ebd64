"""Steps of environments a second:  python -m benchmarks --only environments

The graph gallery/cart_pole_balance without its regulator, 10 ticks of 2 ms a step, beside the same
environment written by hand with NumPy, which agrees with it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

import runtime
from benchmarks.tables import Goal, faster, figure, goals, table
from benchmarks.timing import take_turns

STEPS = 500  # an episode
NOISE = 0.02  # density of the gusts (N^2/Hz)
BY_HAND = "by hand with NumPy"
Step = tuple[Any, float, bool, bool, dict[str, Any]]


class ByHand:
    """A pole on a cart by rk4, as one writes it for Gymnasium; the equations are CartPole's."""

    def __init__(self, density: float = NOISE) -> None:
        self.deviation = math.sqrt(density / 0.02)
        self.rng = np.random.default_rng(0)

    def reset(self, *, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        if seed is not None:
            self.rng = np.random.default_rng(seed)
        self.x, self.ticks = np.array([0.0, 0.0, 0.2, 0.0]), 0
        return self.x.copy(), {}

    def step(self, action: Any) -> Step:
        push = float(np.clip(action[0], -10.0, 10.0))
        force, h, x = push + self.rng.normal(0.0, self.deviation), 0.002, self.x
        for _ in range(10):
            k1 = self.rates(x, force)
            k2 = self.rates(x + 0.5 * h * k1, force)
            k3 = self.rates(x + 0.5 * h * k2, force)
            k4 = self.rates(x + h * k3, force)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        self.x, self.ticks = x, self.ticks + 10
        cost = 2.0 * x[0] ** 2 + x[1] ** 2 + 20.0 * x[2] ** 2 + x[3] ** 2 + 0.05 * push**2
        fallen = bool(abs(x[0]) > 2.4 or abs(x[2]) > 0.6)
        return x.copy(), 1.0 - cost / 20.0, fallen, self.ticks >= 10 * STEPS, {}

    def rates(self, x: Any, force: float) -> Any:
        v, angle, rate = x[1], x[2], x[3]
        sine, cosine = math.sin(angle), math.cos(angle)
        push = force + 0.05 * rate**2 * sine
        a = (push - 0.981 * sine * cosine) / (1.0 + 0.1 * sine**2)
        return np.array([v, a, rate, (9.81 * sine - a * cosine) / 0.5])


def of_graph(engine: str, *without: str) -> Any:
    """The environment of the graph."""
    import spikeblocks.gym  # fails where gymnasium is not installed

    graph = runtime.load("gallery/cart_pole_balance").without("lqr", *without)
    return spikeblocks.gym.make(
        graph, reward="reward.out", terminated="fallen.out", engine=engine, steps=10
    )


def episode(env: Any, act: Callable[[Any], Any], seed: int) -> list[Step]:
    """What each step of an episode returns."""
    rows: list[Step] = []
    observation, _ = env.reset(seed=seed)
    while not rows or not (rows[-1][2] or rows[-1][3]):
        rows.append(env.step(act(observation)))
        observation = rows[-1][0]
    return rows


def balancing(observation: Any) -> Any:
    gains = [3.0, 9.0, 35.0, 9.0]
    return np.clip([np.dot(gains, observation)], -10.0, 10.0)


def seconds(env: Any) -> float:
    """CPU seconds of the steps of an episode whose actions were computed before."""
    observation, actions = env.reset(seed=1)[0], []
    for _ in range(STEPS):
        actions.append(balancing(observation))
        observation = env.step(actions[-1])[0]
    env.reset(seed=1)
    env.step(actions[0])
    began = time.process_time()
    for action in actions[1:]:
        env.step(action)
    return time.process_time() - began


def section(rounds: int) -> str:
    contestants: dict[str, Any] = {BY_HAND: ByHand()}
    with suppress(runtime.MissingExtraError):
        contestants |= {
            "Python engine": of_graph("python"),
            "compiled engine": of_graph("compiled"),
        }
    timings = take_turns(
        {name: partial(seconds, env) for name, env in contestants.items()}, rounds, STEPS - 1
    )
    rows = [
        [name, figure(timing, 1e6, "µs"), f"{1.0 / timing.median:,.0f}"]
        for name, timing in timings.items()
    ]
    rate = 1.0 / timings["compiled engine"].median if "compiled engine" in timings else None
    wanted = [
        Goal("steps a second, compiled", rate, least=40_000.0, unit=""),
        faster("compiled beside NumPy by hand", timings, "compiled engine", BY_HAND, 1.0),
    ]
    text = (
        "\n## Environments of Gymnasium\n\n`gallery/cart_pole_balance` without its regulator, one "
        f"episode of {STEPS} steps of 10 ticks; CPU time of `env.step`.\n\n"
    )
    return text + table(["environment", "a step", "steps a second"], rows) + goals(wanted)
