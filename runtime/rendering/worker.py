"""The process that draws: reads a wish from stdin, tells files or what is missing on stdout.

It is started with MUJOCO_GL set. OpenGL libraries can take a process down with them; this one is
there to be lost.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from runtime.files import own_file
from runtime.rendering.motion import recorded_motion
from runtime.rendering.request import RenderRequest
from runtime.terminal import Progress

PICTURE = "render.png"
FILM = "render.mp4"


def make(request: RenderRequest) -> list[Path]:
    """Draw the picture and the film; returns the files."""
    from runtime.rendering.stage import SceneRenderer

    motion = recorded_motion(request.run, request.block)
    folder = Path(request.folder)
    folder.mkdir(parents=True, exist_ok=True)
    stage = SceneRenderer(motion, request.views, request.height)
    files = [own_file(folder / PICTURE)]
    last = float(motion.t[-1])
    _save(stage.picture(stage.row_at(last if request.at is None else request.at)), files[0])
    stage.close()
    if request.film:
        files.append(folder / FILM)
        stage = SceneRenderer(motion, request.views, request.film_height, shadows=1024)
        _film(stage, request, min(last, last if request.end is None else request.end), files[1])
        stage.close()
    return files


def _save(pixels: Any, path: Path) -> None:
    from PIL import Image

    Image.fromarray(pixels).save(path, optimize=True)


def _film(stage: Any, request: RenderRequest, end: float, path: Path) -> None:
    """Write an H.264 film in a mp4 file."""
    import imageio_ffmpeg

    rows = [stage.row_at(t) for t in np.arange(request.begin, end, request.speed / request.fps)]
    first = stage.picture(rows[0])
    height, width, _ = first.shape
    partial = own_file(path.with_name(f".{path.name}"))
    # yuv420p is what every player takes; it needs even sizes.
    sink = imageio_ffmpeg.write_frames(
        str(partial),
        (width, height),
        fps=request.fps,
        codec="libx264",
        pix_fmt_out="yuv420p",
        macro_block_size=2,
        output_params=["-f", "mp4", "-movflags", "+faststart"],
    )
    progress = Progress("film")
    try:
        sink.send(None)
        for done, row in enumerate(rows):
            sink.send(np.ascontiguousarray(stage.picture(row)))
            progress(done + 1, len(rows))
        sink.close()
        partial.replace(path)
    finally:
        progress.close()
        partial.unlink(missing_ok=True)


def main() -> None:
    """Draw what stdin asks for."""
    # What libraries print must not end up between the answer's lines.
    answer = sys.stdout
    sys.stdout = sys.stderr
    asked = json.load(sys.stdin)
    request = RenderRequest(**{**asked, "views": tuple(asked["views"])})
    try:
        import mujoco

        mujoco.GLContext(16, 16).make_current()
    except Exception as error:  # noqa: BLE001 -- a missing library shows in many ways
        json.dump({"missing": f"{type(error).__name__}: {error}".splitlines()[0]}, answer)
        return
    json.dump({"files": [str(path) for path in make(request)]}, answer)


if __name__ == "__main__":
    main()
