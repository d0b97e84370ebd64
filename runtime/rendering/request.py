"""What is asked of a rendering, as one record that travels to the process that draws."""

from __future__ import annotations

from dataclasses import dataclass

VIEWS = ("top", "perspective")


@dataclass(frozen=True)
class RenderRequest:
    """A picture and a film of one run.

    run : its folder. folder : where files go. block : the robot's name; '' if there is one.
    views : seen from where. at : time of the picture (s); None is the end.
    height, film_height : pixels. film : whether there is one. speed : film seconds show so many
    seconds. fps : pictures per film second. begin, end : what the film shows (s).
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
