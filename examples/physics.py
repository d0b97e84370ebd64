"""A robot with mass, friction and slipping wheels follows the walls; one wheel becomes weak.

    python examples/physics.py [seconds]

Needs the extra 'physics'; 'runtime render' (extra 'render') then draws the run.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import runtime
from runtime.runs import new_folder

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 130.0
graph = runtime.load("wall_following_mujoco_robust").set("plots", {})
faulty = graph.overlay("wheel_faults/weak_wheel.yaml").set("plant.start", 0.5 * seconds)

result = faulty.run(seed=1, until=seconds)
error = result.metrics["distance_mae"]
print("distance error", "not measured yet" if error is None else f"{1e3 * error:.1f} mm")
print(f"time in contact with walls {result.metrics['contacts']:.1%}")

# The odometry integrates the rotation of the wheels, which is not the motion of a slipping body.
odometry, true = result["plant.odometry"], result["plant.pose"][::2]
drift = np.hypot(*(odometry - true[: len(odometry)])[:, :2].T)
print(f"the odometry is {1e3 * drift[-1]:.1f} mm off at the end")

folder = result.save(new_folder(Path("runs"), result.title))
print(f"to draw it: runtime render {folder}")
