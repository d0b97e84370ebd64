"""The process that draws: reads a render request from stdin, writes notes and the files' names
to stdout, one JSON object a line.

It is a process of its own since MUJOCO_GL must be set before mujoco is imported, and since OpenGL
libraries may crash it. If none works, it writes what is missing instead.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from runtime.files import own_file, write_whole
from runtime.terminal import Progress, duration
from spikeblocks.mujoco.rendering.motion import recorded_motion
from spikeblocks.mujoco.rendering.request import RenderRequest

PICTURE = "render.png"
FILM = "render.mp4"


def make(request: RenderRequest, say: Callable[[str], None]) -> list[Path]:
    """Draw the picture and the film; returns the files. ``say`` takes what to tell meanwhile."""
    from spikeblocks.mujoco.rendering.scene import SceneRenderer

    motion = recorded_motion(request.run, request.block)
    folder = Path(request.folder)
    folder.mkdir(parents=True, exist_ok=True)
    renderer = SceneRenderer(motion, request.views, request.height)
    files = [folder / PICTURE]
    last = float(motion.t[-1])
    progress = Progress("picture")
    progress(0, 1)
    _save(renderer.picture(renderer.row_at(last if request.at is None else request.at)), files[0])
    progress.close()
    renderer.close()
    if request.film:
        files.append(folder / FILM)
        renderer = SceneRenderer(motion, request.views, request.film_height, 2048, request.speed)
        end = min(last, last if request.end is None else request.end)
        _film(renderer, request, end, files[1], say)
        renderer.close()
    return files


def _save(pixels: Any, path: Path) -> None:
    from PIL import Image

    content = BytesIO()
    Image.fromarray(pixels).save(content, format="png", optimize=True)
    write_whole(path, content.getvalue())


def _film(
    renderer: Any, request: RenderRequest, end: float, path: Path, say: Callable[[str], None]
) -> None:
    """Write an H.264 film in a mp4 file."""
    import imageio_ffmpeg

    rows = [renderer.row_at(t) for t in np.arange(request.begin, end, request.speed / request.fps)]
    renderer.picture(rows[0])  # the first one takes longer
    began = time.monotonic()
    first = renderer.picture(rows[0])
    takes = duration((time.monotonic() - began) * len(rows))
    shown = f"{end - request.begin:g} s of the run at {request.speed:g} x real time"
    say(f"film: {len(rows)} pictures, {shown}; drawing takes about {takes}")
    height, width, _ = first.shape
    partial = own_file(path.with_name(f".{path.name}"))
    # All players support yuv420p; it needs even sizes.
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
            sink.send(np.ascontiguousarray(renderer.picture(row)))
            progress(done + 1, len(rows))
        sink.close()
        partial.replace(path)
    finally:
        progress.close()
        partial.unlink(missing_ok=True)


def main() -> None:
    """Read the request, draw, and write the answer."""
    # Output of libraries must not be mixed with the answer.
    answer = sys.stdout
    sys.stdout = sys.stderr
    options = json.load(sys.stdin)
    request = RenderRequest(**{**options, "views": tuple(options["views"])})
    try:
        import mujoco

        mujoco.GLContext(16, 16).make_current()
    except Exception as error:  # noqa: BLE001 -- a missing library raises various exceptions
        json.dump({"missing": f"{type(error).__name__}: {error}".splitlines()[0]}, answer)
        return

    def say(text: str) -> None:
        print(json.dumps({"note": text}), file=answer, flush=True)

    json.dump({"files": [str(path) for path in make(request, say)]}, answer)


if __name__ == "__main__":
    main()
