"""Stop a run, look at it, and let two copies of it go on: with and without adaptation.

python examples/stepping.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import runtime
from runtime.graph import open_session

session = runtime.load("starters/adaptive").session(seed=3)
session.run(20.0)
print(f"at {session.t:g} s the robot is at x, y, theta = {session.read('plant.pose').round(3)}")

# The robot has learned to hold against a drift to the left. Now it drifts to the right.
session.set("fault.bias", [0.0, -0.1])
other = session.branch()
other.without("adaptive")
for name, each in (("with adaptation", session), ("without", other)):
    each.run(20.0)
    error = abs(each.read("error.lateral"))
    print(f"{name}: {100.0 * error:.1f} cm from the line at {each.t:g} s")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp()) / "drift"
session.save(folder)
again = open_session(folder).result()
print("replayed to the bit:", (again["plant.pose"] == session.result()["plant.pose"]).all())
