"""What is asked of the process that draws: options only, so that it loads nothing."""

from __future__ import annotations

from dataclasses import dataclass

VIEWS = ("top", "perspective")


@dataclass(frozen=True)
class RenderRequest:
    """The options for a picture and a film of one run, sent to the process that draws them.

    run : its folder. folder : of the files to write. block : the robot's name; '' if there is only
    one. views : names of views. at : time of the picture (s); None is the end. height,
    film_height : pixels. film : whether to make one. speed : simulated seconds per film second.
    fps : pictures per film second. begin, end : time span of the film (s).
    """

    run: str
    folder: str
    block: str = ""
    views: tuple[str, ...] = VIEWS
    at: float | None = None
    height: int = 900
    film_height: int = 480
    film: bool = True
    speed: float = 5.0
    fps: int = 15
    begin: float = 0.0
    end: float | None = None
