"""Build a graph in code, run it, look at arrays, and write the graph as YAML.

python examples/run_from_python.py
"""

from __future__ import annotations

import numpy as np

import runtime
from blocks import LQR, CirclePath, DifferentialDrive, MatchingPoint, Sum, TrackingError

graph = runtime.Graph("circle", dt=0.01, until=20.0)
graph = graph.add("track", CirclePath(radius=2.0, samples=1257))
graph = graph.add("match", MatchingPoint(v_r=1.0, alpha=1.0))
graph = graph.add("error", TrackingError())
graph = graph.add("lqr", LQR(q=[1, 1, 1], r=[1, 1]))
graph = graph.add("total", Sum())
graph = graph.add("plant", DifferentialDrive(x0=[2.5, 0.0, 1.0]))

graph = graph.connect("plant.pose", "match.pose").connect("track.path", "match.path")
graph = graph.connect("plant.pose", "error.pose").connect("match.reference", "error.reference")
graph = graph.connect("error.state", "lqr.error").connect("match.reference", "lqr.reference")
graph = graph.connect("lqr.command", "total.terms").connect("match.feedforward", "total.terms")
graph = graph.connect("total.out", "plant.command")

graph = graph.probe("pose", "plant.pose").probe("lateral", "error.lateral")
graph = graph.plot("path", "trajectory", "pose", "track.path")
graph = graph.metric("settled_at", "settling_time", "lateral", band=0.02)

result = graph.run()
radius = np.hypot(result["plant.pose"][:, 0], result["plant.pose"][:, 1])
settled = result.metrics["settled_at"]
print(f"settled within 2 cm after {settled:.2f} s; last radius {radius[-1]:.4f} m")

soft = graph.set("blocks.lqr.q", [0.1, 0.1, 0.1]).run()
print(f"with soft gains after {soft.metrics['settled_at']:.2f} s")

print(graph.to_yaml())
