"""Makes the images of the README and of the documents:  python docs/pictures.py"""

from __future__ import annotations

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import runtime
from runtime.compare import Run
from runtime.compare.overlay import versus
from runtime.rendering import RenderRequest, render

IMAGES = Path(__file__).parent / "images"
IMAGES.mkdir(exist_ok=True)

graph = runtime.load("starters/adaptive")
(IMAGES / "diagram.svg").write_text(str(graph.diagram("svg")), encoding="utf-8")
variants = {"with adaptive": graph, "without adaptive": graph.without("adaptive")}
runs = [Run(name, IMAGES, variant.run(), {}) for name, variant in variants.items()]
plots = {plot.name: plot for plot in runs[0].result.plots}
versus(runs, plots["errors"]).savefig(IMAGES / "errors.png", dpi=130)

walls = runtime.load("wall_following_robust").overlay("conditions/turn_loss_50")
walls.run().plot("room").savefig(IMAGES / "room.png", dpi=130)

physics = runtime.load("wall_following_mujoco_robust").overlay("wheel_faults/turn_loss_35.yaml")
with TemporaryDirectory() as folder:
    run = physics.run(until=100.0).save(Path(folder) / "run")
    picture = render(RenderRequest(run=str(run), folder=folder, height=600, film=False))[0]
    shutil.copyfile(picture, IMAGES / "physics.png")
