"""Cards of the gallery and of the landing page: what a graph is, in a title, a line and a picture.

In: the file of a shipped graph and its picture. Out: HTML::

    <a class="card" href="graph-gallery-pendulum.html" ...><img ...><strong>A pendulum ...</strong>
"""

from __future__ import annotations

import html
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

import runtime
from runtime.cli.shipped import Shipped

WIDTH, QUALITY = 400, 60  # pixels, and of the webp: about 6 kB each
NEURONS, PUBLISHED = "Neurons", "Published models"
# In the order of the gallery: a graph is in the first group whose rooms it has blocks of.
ROOMS = {
    "Robots": {"vehicle", "wall_fitting", "mujoco"},
    NEURONS: {"neural"},
}
CONTROLLERS = re.compile(r"PID|Regulator|Kalman|MRAC|LQR|LQI|MPC|Controller")
EVENTS = re.compile(r"\b(when|reset|edge):|type: (Relay|Enable|Trigger)")
GROUPS = {
    "Robots": "Robots that drive along lines, along walls and to points, with neurons and without.",
    NEURONS: "Spiking neurons that represent, compute, remember and learn.",
    "Control": "Feedback loops, observers and regulators.",
    "Hybrid": "Continuous in time, with events that are located between ticks.",
    "Physics": "Oscillators, mechanisms, reactions and circuits.",
    PUBLISHED: "Examples of other packages, compared with closed forms and other solvers.",
}


@dataclass(frozen=True)
class Entry:
    """A graph that can be run: its name for ``runtime run``, and the name of its page."""

    name: str
    page: str
    shipped: Shipped
    graph: runtime.Graph

    @property
    def title(self) -> str:
        """What it is, in words: its first sentence up to a colon."""
        return self.shipped.summary.partition(": ")[0]

    @property
    def line(self) -> str:
        """The rest of the sentence."""
        rest = self.shipped.summary.partition(": ")[2]
        return f"{rest[:1].upper()}{rest[1:]}." if rest else ""

    @property
    def types(self) -> list[str]:
        """The types of its blocks."""
        try:
            return sorted({e.cls.__name__ for e in self.graph.network.entries.values()})
        except runtime.MissingExtraError:
            return []

    @property
    def group(self) -> str:
        """What the gallery lists it under."""
        if self.shipped.group.endswith("/published"):
            return PUBLISHED
        try:
            network = self.graph.network
        except runtime.MissingExtraError:
            return "Robots"
        names = [e.cls.__module__.split(".") for e in network.entries.values()]
        rooms = {name[1] for name in names if name[0] == "blocks"}
        for group, wanted in ROOMS.items():
            if rooms & wanted:
                return group
        if CONTROLLERS.search(" ".join(self.types)):
            return "Control"
        text = self.shipped.path.read_text(encoding="utf-8")
        return "Hybrid" if EVENTS.search(text) else "Physics"


def entry(group: str, each: Shipped) -> Entry:
    """The entry of a file of one group of shipped files."""
    name = each.name if group == "graphs" else f"{group}/{each.name}"
    return Entry(name, f"graph-{name.replace('/', '-')}", each, runtime.load(name))


def thumbnail(picture: Path, folder: Path, page: str) -> str:
    """Write a small copy of a picture, of a film its last frame; returns the file's name."""
    folder.mkdir(exist_ok=True)
    target = folder / f"{page}{'.svg' if picture.suffix == '.svg' else '.webp'}"
    if target.suffix == ".svg":
        shutil.copyfile(picture, target)
        return target.name
    with Image.open(picture) as image:
        image.seek(getattr(image, "n_frames", 1) - 1)
        size = (WIDTH, round(WIDTH * image.height / image.width))
        image.convert("RGB").resize(size, Image.Resampling.LANCZOS).save(
            target, quality=QUALITY, method=6
        )
    return target.name


def card(entry: Entry, picture: str, alt: str, up: str = "") -> str:
    """The card of a graph; ``up`` leads from its page to the folder of the gallery's pages."""
    root = "" if up else "../"
    words = " ".join((entry.name, entry.shipped.summary, *entry.types)).lower()
    parts = [
        f'<a class="card" href="{up}{entry.page}.html" data-words="{html.escape(words)}">',
        f'<img loading="lazy" src="{root}_static/{picture}" alt="{html.escape(alt)}">',
        f"<strong>{html.escape(entry.title)}</strong>",
        f"<span>{html.escape(entry.line)}</span>" if entry.line else "",
        f"<code>{entry.name}</code></a>",
    ]
    return "".join(parts)


def grid(cards: list[str]) -> str:
    """Cards beside each other, as raw HTML of a page."""
    return "\n".join(["```{raw} html", '<div class="cards">', *cards, "</div>", "```"])
