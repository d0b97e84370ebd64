"""``runtime render``: render a picture and a film of a run with physics."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from runtime.arguments import add_json, at_least, integer
from runtime.terminal import show, show_json
from spikeblocks.mujoco.rendering.request import VIEWS, RenderRequest

HELP = "render a picture and a film of a run with physics"
GROUP = "export and import"
EXAMPLES = """
runtime render runs/wall_following_mujoco/latest
runtime render runs/wall_following_mujoco/latest --no-film --at 20
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("run", help="run folder, as in runs/<graph>/latest")
    parser.add_argument("--out", metavar="DIR", help="folder for the files (the run's plots/)")
    parser.add_argument(
        "--block", default="", metavar="NAME", help="the robot, if there are several"
    )
    parser.add_argument("--view", choices=VIEWS, help="camera view (both, side by side)")
    parser.add_argument(
        "--at", type=at_least(0.0), metavar="S", help="time of the picture (the end of the run)"
    )
    parser.add_argument("--no-film", action="store_true", help="render only the picture")
    pixels = integer(64, 2160, even=True)
    for flag, kind, value, text in (
        ("--from", at_least(0.0), RenderRequest.begin, "start of the film, s"),
        ("--until", at_least(0.0), RenderRequest.end, "end of the film, s (the end of the run)"),
        ("--speed", at_least(1e-3), RenderRequest.speed, "playback speed relative to real time"),
        ("--fps", integer(1, 240), RenderRequest.fps, "frames per second"),
        ("--height", pixels, RenderRequest.height, "height of the picture, pixels"),
        ("--film-height", pixels, RenderRequest.film_height, "height of the film, pixels"),
    ):
        text += "" if value is None else f" ({value:g})"
        parser.add_argument(flag, type=kind, default=value, metavar="N", help=text)
    add_json(parser)


def run(options: Namespace) -> int:
    """Render, and print the files."""
    from runtime.files import check_inside, refuse_link
    from runtime.runs import run_folder
    from spikeblocks.mujoco.rendering.process import render

    folder = run_folder(options.run)
    if not options.out:
        check_inside(folder)
        refuse_link(folder / "plots")
    files = render(
        RenderRequest(
            run=str(folder),
            folder=str(Path(options.out) if options.out else folder / "plots"),
            block=options.block,
            views=(options.view,) if options.view else VIEWS,
            at=options.at,
            height=options.height,
            film_height=options.film_height,
            film=not options.no_film,
            speed=options.speed,
            fps=options.fps,
            begin=getattr(options, "from"),
            end=options.until,
        )
    )
    if options.json:
        show_json({"schema_version": 1, "files": [str(path) for path in files]})
    else:
        show("\n".join(map(str, files)))
    return 0
