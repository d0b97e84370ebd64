"""Makes the pictures of the README:  python docs/pictures.py"""

from __future__ import annotations

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import runtime
from runtime.rendering import RenderRequest, render

IMAGES = Path(__file__).parent / "images"

graph = runtime.load("line_actuator_failure")
IMAGES.mkdir(exist_ok=True)
graph.run().plot("trajectory").savefig(IMAGES / "trajectory.png", dpi=150)
walls = runtime.load("wall_following_robust").overlay("conditions/turn_loss_50.yaml")
walls.run().plot("room").savefig(IMAGES / "room.png", dpi=130)
(IMAGES / "diagram.svg").write_text(str(graph.diagram("svg")), encoding="utf-8")
physics = runtime.load("wall_following_mujoco_robust").overlay("wheel_faults/turn_loss_35.yaml")
with TemporaryDirectory() as folder:
    run = physics.run(until=100.0).save(Path(folder) / "run")
    picture = render(RenderRequest(run=str(run), folder=folder, height=600, film=False))[0]
    shutil.copyfile(picture, IMAGES / "physics.png")
