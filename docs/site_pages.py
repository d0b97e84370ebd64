"""Pages of the site that are made when it is built: the command line, and the gallery.

The gallery runs graphs, all processors at once, of long ones the first part, and shows committed
pictures of those with physics. A thumbnail is drawn again only if its graph has changed.
``SPIKEBLOCKS_DOCS_RUNS=0`` runs nothing.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

import runtime
from runtime.cli import make_parser
from runtime.cli.commands import NAMES
from runtime.cli.shipped import Shipped, shipped
from runtime.engine import python_seconds

DPI = 80
MAX_SECONDS = 10.0  # estimated time of a run; a longer one is cut
STILLS = {"wall_following_mujoco_robust": "physics.png", "wall_following_robust": "room.png"}
PHYSICS = "MujocoVacuum"
GROUPS = {
    "graphs": "Cases of the paper",
    "starters": "Starters",
    "gallery": "Gallery",
    "gallery/nengo": "Examples of Nengo",
    "gallery/published": "Published models",
}
COLUMNS = "100"


def write(folder: Path) -> None:
    """Write all pages into a folder."""
    folder.mkdir(exist_ok=True)
    (folder / "command-line.md").write_text(command_line(), encoding="utf-8")
    gallery(folder)


def command_line() -> str:
    """A section for each verb, with what its ``--help`` prints."""
    os.environ["COLUMNS"] = COLUMNS
    parser = make_parser()
    (verbs,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    lines = ["# Command line", "", "What `runtime VERB --help` prints. `runtime --help`:", ""]
    lines += ["```text", parser.format_help().rstrip(), "```", ""]
    for name in NAMES:
        lines += [f"## runtime {name}", "", "```text"]
        lines += [verbs.choices[name].format_help().rstrip(), "```", ""]
    return "\n".join(lines)


@dataclass(frozen=True)
class _Entry:
    """A graph of the gallery: its name for ``runtime run``, and the name of its page."""

    group: str
    name: str
    page: str
    shipped: Shipped


def gallery(folder: Path) -> None:
    """Write a page for each graph that can be run, and the page that shows them all."""
    entries = []
    for group in GROUPS:
        for each in shipped(group):
            name = each.name if group == "graphs" else f"{group}/{each.name}"
            entries.append(_Entry(group, name, f"graph-{name.replace('/', '-')}", each))
    with ProcessPoolExecutor() as pool:
        pictures = list(pool.map(_page, repeat(folder), entries))
    lines = ["# Gallery", "", "Every graph that comes with the package. Run one by its name.", ""]
    for group, title in GROUPS.items():
        lines += [f"## {title}", ""]
        for entry, picture in zip(entries, pictures, strict=True):
            if entry.group == group:
                link = f"{entry.page}.md"
                shown = f"[![{entry.name}]({picture}){{width=420px}}]({link})" if picture else ""
                lines += [f"### [{entry.name}]({link})", "", f"{entry.shipped.summary}.", ""]
                lines += [shown, ""]
    lines += ["```{toctree}", ":hidden:", "", *(entry.page for entry in entries), "```"]
    (folder / "gallery.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _page(folder: Path, entry: _Entry) -> str:
    """Write a graph's page; returns the address of its thumbnail."""
    page, name = entry.page, entry.name
    text = entry.shipped.path.read_text(encoding="utf-8")
    graph = runtime.load(name)
    diagram = ""
    try:
        (folder / f"{page}.svg").write_text(str(graph.diagram("svg")), encoding="utf-8")
        diagram = f"![block diagram of {name}]({page}.svg)"
    except runtime.MissingExtraError as error:
        diagram = f"The diagram is missing: {error}."
    picture, end = _thumbnail(folder, page, name, graph)
    shown = f"![{name}]({picture})" if picture else ""
    cut = f"The first {end:g} s of the run." if end else ""
    parts = [f"# {name}", f"{entry.shipped.summary}.", f"    runtime run {name}", shown, cut]
    parts += ["## Diagram", diagram, "## Text", f"```yaml\n{text.rstrip()}\n```"]
    (folder / f"{page}.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return picture


def _thumbnail(folder: Path, page: str, name: str, graph: runtime.Graph) -> tuple[str, float]:
    """The address of a picture of a run, drawn if there is none yet, and the end of a cut run."""
    if name in STILLS:
        return f"../images/{STILLS[name]}", 0.0
    try:
        network = graph.network
    except runtime.MissingExtraError:
        return "", 0.0
    if not _plots(graph) or any(e.cls.__name__ == PHYSICS for e in network.entries.values()):
        return "", 0.0
    share = MAX_SECONDS / max(python_seconds(network), MAX_SECONDS)
    end = float(f"{share * network.ticks * network.dt:.1g}") if share < 1.0 else 0.0
    digest = hashlib.sha256(repr((graph.to_dict(), end)).encode()).hexdigest()[:12]
    target = folder / f"{page}-{digest}.png"
    if not target.exists():
        if os.environ.get("SPIKEBLOCKS_DOCS_RUNS") == "0":
            return "", 0.0
        for old in folder.glob(f"{page}-*.png"):
            if re.fullmatch(rf"{re.escape(page)}-[0-9a-f]{{12}}\.png", old.name):
                old.unlink()
        result = graph.run(until=end) if end else graph.run()
        result.plot(_plots(graph)[0]).savefig(target, dpi=DPI)
    return target.name, end


def _plots(graph: runtime.Graph) -> list[str]:
    return [plot.name for plot in graph.observation.drawn]
