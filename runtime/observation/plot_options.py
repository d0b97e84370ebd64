"""The options of plots: what every figure takes, and what kinds of plots add.

In: the entries of a plot. Out: their declarations, which check, document and complete them:
``{kind: xy, of: [a.x, a.y], xlim: [0, 1], compare: without=adaptive}``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from blocks.core import FloatArray, Options, param, show

CHANGES = ("without", "bypass", "replace", "with", "set", "wire")
Checks = Iterable[tuple[str, str]]


class Figure(Options):
    """What every figure takes."""

    xlim: FloatArray | None = param(None, shape=(2,), doc="ends of the horizontal axis")
    ylim: FloatArray | None = param(None, shape=(2,), doc="likewise, of the upper axes")
    size: FloatArray | None = param(
        None, unit="in", above=0.0, at_most=40.0, shape=(2,), doc="width and height in inches"
    )
    legend: bool = param(True, doc="whether the lines are named")
    compare: str = param(
        "",
        doc="a change, as without=adaptive: `runtime run` also runs the graph with it, and draws "
        "both in this figure",
    )


class Space(Figure):
    """The third axis, and from where the three are seen."""

    zlim: FloatArray | None = param(None, shape=(2,), doc="ends of the upward axis")
    view: FloatArray = param(
        [25.0, -60.0], unit="deg", shape=(2,), doc="elevation and azimuth from which it is seen"
    )


class Levels(Figure):
    """Marked levels of the vertical axis."""

    limits: FloatArray | None = param(
        None, shape=[(), (None,)], doc="levels that are drawn as dashed lines on the upper axes"
    )
    band: float | None = param(
        None, at_least=0.0, doc="shade from -band to band; default: that of a settling_time of `of`"
    )
    events: str | None = param(None, doc="a probe of events, whose times are marked at the bottom")


class Raster(Figure):
    """The order of the neurons."""

    sort: str = param(
        "activity",
        choices=("activity", "direction"),
        doc="order of the neurons: by the first principal component of their rates, or by the "
        "preferred direction (in one dimension by intercept) of those of an Ensemble",
    )


class Averaged(Figure):
    """The mean of a noisy signal, and its scatter."""

    window: float = param(
        0.05, unit="s", above=0.0, doc="the mean and the deviation are taken over so long a time"
    )
    after: float = param(0.0, unit="s", at_least=0.0, doc="rows before this time are not shown")


class Distance(Levels):
    """The distance to follow."""

    distance: float = param(unit="m", above=0.0, doc="the distance from the walls to follow")


class Plane(Figure):
    """The robot in a plane, and the contact of its body with the graph's world."""

    body_radius: float | None = param(
        None, unit="m", above=0.0, doc="size of the robot; default: that of its block"
    )


class Map(Plane):
    """What a map shows, apart from the trajectory."""

    distance: float | None = param(
        None, unit="m", above=0.0, doc="draw the contour that far from the walls"
    )


class Scans(Map):
    """The times of a run, and the bearings of a scan."""

    at: FloatArray | None = param(
        None, unit="s", at_least=0.0, shape=[(), (None,)], doc="the times; default: four"
    )
    angles: FloatArray | None = param(
        None, unit="rad", shape=(2,), doc="bearings of the scan's ends; default: the sensor's"
    )


def ordered(options: Mapping[str, Any]) -> Checks:
    """Errors in the ends of axes, and in a change to compare with, of options that were read."""
    kind, equals, what = options["compare"].partition("=")
    if options["compare"] and not (kind in CHANGES and equals and what):
        message = f"expected a change, as in without=adaptive ({', '.join(CHANGES)}), got "
        yield "compare", message + show(options["compare"])
    for key in ("xlim", "ylim", "zlim"):
        ends = options.get(key)
        if ends is not None and ends[0] >= ends[1]:
            yield key, f"expected the lower end first, as in [0, 1], got [{ends[0]:g}, {ends[1]:g}]"


def moments(options: Mapping[str, Any]) -> Checks:
    """The same, and errors in the times and bearings of scans."""
    yield from ordered(options)
    at, angles = options["at"], options["angles"]
    if at is not None and not at.size:
        yield "at", f"expected {Scans.declared['at'].describe()}, got {show([])}"
    if angles is not None and angles[0] >= angles[1]:
        message = (
            "expected the scan's first bearing below its last (rad), as in [-1.57, 1.57], got "
        )
        yield "angles", f"{message}[{angles[0]:g}, {angles[1]:g}]"
