"""Makes the pictures of the README:  python docs/pictures.py"""

from __future__ import annotations

from pathlib import Path

import runtime

IMAGES = Path(__file__).parent / "images"

graph = runtime.load("line_actuator_failure")
IMAGES.mkdir(exist_ok=True)
graph.run().plot("trajectory").savefig(IMAGES / "trajectory.png", dpi=150)
walls = runtime.load("wall_following_robust").overlay("conditions/turn_loss_50.yaml")
walls.run().plot("room").savefig(IMAGES / "room.png", dpi=130)
(IMAGES / "diagram.svg").write_text(str(graph.diagram("svg")), encoding="utf-8")
