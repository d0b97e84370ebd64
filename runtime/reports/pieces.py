"""What reports of all kinds share: figures, diagrams, graphs, numbers, where they come from."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.errors import SpikeblocksError
from runtime.reports.html import Html, element, facts, join, scrolling, table
from runtime.reports.svg import diagram_svg, figure_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from runtime.graph import Graph

LEGIBLE = 0.62  # of a diagram's natural width: narrower, its letters are too small to read
BROAD = 1200.0  # pixels: a wider diagram is printed on a page of its own, lengthwise


def number(value: float | None) -> Html:
    """A number in four digits, all of them in its tooltip; a dash where there is none."""
    if value is None or math.isnan(value):
        return element("span", "–", title="no value")
    shown = f"{value:.4g}".replace("-", "−")
    return element("span", shown, title=repr(value))


def plot(figure: Figure, name: str, caption: str) -> Html:
    """A figure with what it shows below it."""
    drawn = figure_svg(figure, identifier(name), caption)
    return element(
        "figure", scrolling(drawn, caption, "plot"), element("figcaption", caption), id=name
    )


def identifier(name: str) -> str:
    """A name as an id may be."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name)


def diagram(graph: Graph, name: str) -> Html:
    """The block diagram of a graph; what cannot be built here is told in its place."""
    try:
        drawn = str(graph.diagram("svg"))
    except SpikeblocksError as error:
        said = f"The graph cannot be built here, so that there is no diagram: {error}"
        return element("p", said, class_="soft")
    return diagram_frame(drawn, name, f"block diagram of {graph.title}")


def diagram_frame(drawn: str, name: str, label: str) -> Html:
    """A diagram's SVG, as wide as the page where its letters stay legible."""
    svg = diagram_svg(drawn, identifier(name), label)
    found = re.search(r'viewBox="0 0 ([\d.]+) ', svg)
    width = float(found.group(1)) if found else 0.0
    how = f"min-width: {LEGIBLE * width:.0f}px; max-width: {width:.0f}px"
    styled = Html(svg.replace("<svg ", f'<svg style="{how}" ', 1))
    return scrolling(styled, label, "diagram wide broad" if width > BROAD else "diagram wide")


def source(text: str, label: str) -> Html:
    """The text of a graph."""
    return scrolling(element("pre", element("code", text)), label, "source")


def command(argv: Sequence[Any]) -> Html:
    """A command line as it can be typed again."""
    words = [Path(str(argv[0])).name, *map(str, argv[1:])] if argv else []
    return element("code", shlex.join(words))


def versions(found: Mapping[str, Any]) -> Html:
    """Names and versions of packages."""
    rows = [[str(name), str(version)] for name, version in found.items()]
    return table(["package", "version"], rows, label="versions")


def moment(stamp: str) -> str:
    """A date and a time of day, out of an ISO time."""
    return stamp[:16].replace("T", " ")


def provenance(made: Mapping[str, Any], more: Sequence[tuple[str, str]]) -> Html:
    """Where numbers come from: the command, the commit, when, and what else is known."""
    pairs = [
        ("command", command(made.get("argv") or [])),
        ("source", str(made.get("source") or "built in Python")),
        ("git commit", str(made.get("git") or "none")),
        ("started", str(made.get("started", ""))),
        *more,
    ]
    listed = facts([(name, value) for name, value in pairs if value], "list")
    return join(listed, element("h3", "Versions"), versions(made.get("versions") or {}))
