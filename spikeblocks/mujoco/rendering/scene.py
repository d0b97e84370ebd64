"""Draws a robot's recorded states with OpenGL; imported only in the worker process."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib
import mujoco
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from blocks.core import FloatArray
from blocks.world import bearings
from spikeblocks.mujoco import POSITION, SEEN_GROUP, BeamCaster, model_of, state_parts
from spikeblocks.mujoco.rendering.motion import Motion
from spikeblocks.mujoco.rendering.views import (
    ASPECTS,
    FLOOR_SQUARE,
    TRAIL_SEGMENTS,
    bar_length,
    draw_hits,
    draw_trail,
    extent_of,
    light_scene,
    place_camera,
)

Picture = npt.NDArray[np.uint8]
MODEL_GEOMS = 500
INK, PAPER = (40, 40, 40), (255, 255, 255)
FONT = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"


class SceneRenderer:
    """The scene of one run, seen from one or more views side by side.

    Parameters
    ----------
    motion : what to draw.
    views : names of views.
    height : of a picture (pixels); even.
    shadows : size of the shadow map (pixels), which takes most of the time.
    speed : of a film, relative to real time, which its pictures then show.
    """

    def __init__(
        self,
        motion: Motion,
        views: tuple[str, ...],
        height: int,
        shadows: int = 4096,
        speed: float | None = None,
    ) -> None:
        self.motion = motion
        robot, model = motion.robot, model_of(motion.robot, motion.world)
        self.model, self.data = model, mujoco.MjData(model)
        model.vis.quality.shadowsize = shadows
        self.parts = state_parts(mujoco)
        beam_angles = bearings(robot.beams, -math.pi, math.pi)
        self.beams = BeamCaster(mujoco, model, self.data, beam_angles, SEEN_GROUP, robot.range_max)
        self.path = motion.states[:, POSITION][:, :2]
        room = MODEL_GEOMS + TRAIL_SEGMENTS + robot.beams + model.ngeom
        extent = extent_of(motion.world, self.path)
        light_scene(model, extent)
        self.views, self.speed = views, speed
        self.pixels_per_metre = height / (2.0 * extent.reach)
        self.renderers, self.cameras, self.openings = [], [], []
        for view in views:
            width = 2 * round(0.5 * ASPECTS[view] * height)
            self.renderers.append(mujoco.Renderer(model, height, width, max_geom=room))
            camera = mujoco.MjvCamera()
            self.openings.append(place_camera(camera, view, extent))
            self.cameras.append(camera)
        self.font = ImageFont.truetype(str(FONT), max(10, height // 32))

    def row_at(self, t: float) -> int:
        """The row of the last state recorded up to a time (s)."""
        return max(0, int(np.searchsorted(self.motion.t, t + 1e-9, side="right")) - 1)

    def picture(self, row: int) -> Picture:
        """The views of one recorded state, side by side, (height, width, 3)."""
        mujoco.mj_setState(self.model, self.data, self.motion.states[row], self.parts)
        mujoco.mj_forward(self.model, self.data)
        hits = self._hits()
        shown = []
        for renderer, camera, opening in zip(
            self.renderers, self.cameras, self.openings, strict=True
        ):
            self.model.vis.global_.fovy = opening
            renderer.update_scene(self.data, camera)
            draw_trail(mujoco, renderer.scene, self.path[: row + 1])
            draw_hits(mujoco, renderer.scene, hits)
            shown.append(renderer.render())
        when = f"t = {self.motion.t[row]:.1f} s"
        if self.speed is not None:
            when += f", {self.speed:g} x real time"
        shown[-1] = self._labelled(shown[-1], when)
        for i, view in enumerate(self.views):
            shown[i] = self._with_scale(shown[i], view)
        return np.hstack(shown)

    def _hits(self) -> FloatArray:
        """The points that the beams hit, (n, 3) in m."""
        ranges = self.beams.cast()
        seen = np.isfinite(ranges)
        hits: FloatArray = self.beams.site.xpos + ranges[seen, None] * self.beams.directions()[seen]
        return hits

    def _labelled(self, pixels: Picture, text: str) -> Picture:
        image: Any = Image.fromarray(pixels)
        edge = self.font.size // 2
        ImageDraw.Draw(image).text((edge, edge), text, fill=INK, font=self.font)
        return np.asarray(image)

    def _with_scale(self, pixels: Picture, view: str) -> Picture:
        """A bar of a round length where all distances have one scale; the floor's squares else."""
        image: Any = Image.fromarray(pixels)
        draw, edge = ImageDraw.Draw(image), self.font.size // 2
        bottom = pixels.shape[0] - edge
        if view == "top":
            length = bar_length(pixels.shape[1] / self.pixels_per_metre)
            end = 2 * edge + length * self.pixels_per_metre
            text, left = f"{length:g} m", end + edge
            line = edge // 2
            level = bottom - edge
            draw.rectangle((2 * edge, level - line // 2, end, level + line // 2), fill=INK)
        else:
            text, left = f"squares: {FLOOR_SQUARE:g} m", 2 * edge
        anchor = (left, bottom - edge)
        stroke = max(1, self.font.size // 10)
        draw.text(
            anchor,
            text,
            fill=INK,
            font=self.font,
            anchor="lm",
            stroke_width=stroke,
            stroke_fill=PAPER,
        )
        return np.asarray(image)

    def close(self) -> None:
        """Free the resources of OpenGL."""
        for renderer in self.renderers:
            renderer.close()
