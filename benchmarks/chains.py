"""Chains of Gain blocks: what a block costs per tick, and what building one costs."""

from __future__ import annotations

import gc
import time

import runtime
from blocks import Constant, Gain

TICKS = 4000


def chain(length: int) -> runtime.Graph:
    """A constant and ``length`` Gains, one after the other."""
    blocks: dict[str, dict[str, object]] = {"b0": {"type": Constant.__name__, "value": 1.0}}
    wires = {}
    for i in range(1, length + 1):
        blocks[f"b{i}"] = {"type": Gain.__name__, "gain": 1.0}
        wires[f"b{i}"] = {"input": f"b{i - 1}." + ("value" if i == 1 else "out")}
    return runtime.load(
        {
            "graph": f"chain_{length}",
            "run": {"dt": 0.01, "until": TICKS * 0.01},
            "blocks": blocks,
            "wires": wires,
            "probes": {"last": {"of": f"b{length}.out", "every": 100}},
        }
    )


def build_seconds(length: int) -> float:
    """Seconds to read, check and plan a chain."""
    # What the peers have loaded is not looked at for garbage while a chain is built.
    gc.collect()
    gc.freeze()
    began = time.perf_counter()
    chain(length).check()
    return time.perf_counter() - began


def run_seconds(length: int) -> float:
    """Seconds of a chain's ticks, the generated function's compilation included."""
    graph = chain(length)
    graph.check()
    return float(graph.run().manifest["wall_s"])
