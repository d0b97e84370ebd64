"""A graph that costs nothing to run, whose numbers are known, and that fails when asked to."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from runtime.engine.state import seed_of

MODULE = '''
import builtins
import os
import signal
import time
from pathlib import Path

import blocks


class Draw(blocks.Block):
    """A level and a random number, drawn once: out = level + slope + N(0, 1)."""

    out = blocks.Output(blocks.Scalar)
    held = blocks.State()

    level: float = blocks.param(0.0, doc="what the number is added to", at_most=100.0)
    count: int = blocks.param(0, doc="added as well")
    how: str = blocks.param("fine", doc="what happens")
    raises: str = blocks.param("", doc="an exception to raise, by its name")
    at: str = blocks.param("first", doc="when: 'start', 'first' tick, or 'later'")
    mark: str = blocks.param("", doc="a file that tells a second try from the first")

    def start(self, state):
        state.held[...] = self.level + self.count + state.rng.normal()
        self.raise_if(self.at == "start")
        if self.how == "brief" and self.mark:
            with open(self.mark, "a") as log:
                print(self.level, file=log)

    def raise_if(self, is_time):
        if self.raises and is_time:
            raise getattr(builtins, self.raises)("on purpose")

    def output(self, state, t):
        self.raise_if(self.at == "first" or (self.at == "later" and t > 0.025))
        if self.how == "long":
            raise RuntimeError("=long " * 50_000)
        if self.how == "raise":
            raise RuntimeError("it broke, on purpose")
        if self.how == "nan":
            return float("nan")
        if self.how == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.how == "die once" and not Path(self.mark).exists():
            Path(self.mark).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep({"brief": 0.004, "slow": 0.8}.get(self.how, 0.0))
        return float(state.held)
'''
GRAPH = """
graph: draw
run: {dt: 0.01, until: 0.05}
params: {gain: 2.0}
blocks:
  draw: {type: Draw, module: own.py, level: 1.0}
  twice: {type: Gain, gain: $gain}
  half: {type: Gain, gain: 0.5}
  sum: {type: Sum}
wires:
  twice: {input: draw.out}
  half: {input: twice.out}
  sum: {terms: [draw.out, half.out]}
probes:
  out: draw.out
metrics:
  drawn: {kind: final, of: draw.out}
  total: {kind: final, of: sum.out}
  above_two: {kind: first_time, of: draw.out, level: 2.0}
"""


def write_graph(folder: Path) -> Path:
    """Write the graph and its module; returns the graph's file."""
    (folder / "own.py").write_text(MODULE)
    path = folder / "draw.yaml"
    path.write_text(GRAPH)
    return path


def normal(seed: int, block: str = "draw") -> float:
    """The number that the block draws."""
    return float(np.random.Generator(np.random.PCG64(seed_of(seed, block))).normal())
