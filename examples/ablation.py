"""An ablation by hand: the same seeds with and without the adaptive part, and their difference.

    python examples/ablation.py [seeds]

Every block's noise and neurons depend only on the seed and the block's name, so the two runs of
a seed see the same noise: the difference is paired.
"""

from __future__ import annotations

import sys

import numpy as np

import runtime

graph = runtime.load("sine_estimation_error").set("plots", {})
variants = {
    "adaptive": graph,
    "LQR alone": graph.without("adaptive"),
    "no feedforward": graph.wire("total.terms", ["lqr.command", "adaptive.command"]),
}
seeds = range(int(sys.argv[1]) if len(sys.argv) > 1 else 3)

table = {
    name: np.array([variant.run(seed=seed).metrics["position_mae"] for seed in seeds])
    for name, variant in variants.items()
}
for name, values in table.items():
    gain = values - table["adaptive"]
    print(f"{name:<15} {values.mean():.3f} m, {gain.mean():+.3f} +- {gain.std():.3f} m to adaptive")
