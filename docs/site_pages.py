"""Pages of the site that are made when it is built: the command line, and the gallery.

The gallery runs graphs that are cheap, and shows committed pictures of the others. A thumbnail is
drawn again only if its graph has changed. ``SPIKEBLOCKS_DOCS_RUNS=0`` runs nothing.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
from pathlib import Path

import runtime
from runtime.cli import make_parser
from runtime.cli.commands import NAMES
from runtime.cli.shipped import Shipped, shipped

DPI = 80
MAX_WORK = 1.0e7  # ticks times blocks, a minute
STILLS = {"wall_following_mujoco_robust": "physics.png", "wall_following_robust": "room.png"}
PHYSICS = "MujocoVacuum"
GROUPS = {"graphs": "Cases of the paper", "starters": "Starters", "gallery": "Gallery"}
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


def gallery(folder: Path) -> None:
    """Write a page for each graph that can be run, and the page that shows them all."""
    lines = ["# Gallery", "", "Every graph that comes with the package. Run one by its name.", ""]
    pages = []
    for group, title in GROUPS.items():
        entries = shipped(group)
        lines += [f"## {title}", ""] if entries else []
        for each in entries:
            name = each.name if group == "graphs" else f"{group}/{each.name}"
            page = f"graph-{name.replace('/', '-')}"
            picture = _page(folder, page, name, each)
            pages.append(page)
            shown = f"[![{name}]({picture}){{width=420px}}]({page}.md)" if picture else ""
            lines += [f"### [{name}]({page}.md)", "", f"{each.summary}.", "", shown, ""]
    lines += ["```{toctree}", ":hidden:", "", *pages, "```"]
    (folder / "gallery.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _page(folder: Path, page: str, name: str, entry: Shipped) -> str:
    """Write a graph's page; returns the address of its thumbnail."""
    text = entry.path.read_text(encoding="utf-8")
    graph = runtime.load(name)
    diagram = ""
    try:
        (folder / f"{page}.svg").write_text(str(graph.diagram("svg")), encoding="utf-8")
        diagram = f"![block diagram of {name}]({page}.svg)"
    except runtime.MissingExtraError as error:
        diagram = f"The diagram is missing: {error}."
    picture = _thumbnail(folder, page, name, graph)
    shown = f"![{name}]({picture})" if picture else ""
    parts = [f"# {name}", f"{entry.summary}.", f"    runtime run {name}", shown, "## Diagram"]
    parts += [diagram, "## Text", f"```yaml\n{text.rstrip()}\n```"]
    (folder / f"{page}.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return picture


def _thumbnail(folder: Path, page: str, name: str, graph: runtime.Graph) -> str:
    """The address of a picture of a run, drawn if the graph is cheap and none is there yet."""
    if name in STILLS:
        return f"../images/{STILLS[name]}"
    digest = hashlib.sha256(repr(graph.to_dict()).encode()).hexdigest()[:12]
    target = folder / f"{page}-{digest}.png"
    if target.exists():
        return target.name
    network = graph.network
    work = network.ticks * len(network.entries)
    is_slow = work > MAX_WORK or any(e.cls.__name__ == PHYSICS for e in network.entries.values())
    if os.environ.get("SPIKEBLOCKS_DOCS_RUNS") == "0" or is_slow or not _plots(graph):
        return ""
    for old in folder.glob(f"{page}-*.png"):
        if re.fullmatch(rf"{re.escape(page)}-[0-9a-f]{{12}}\.png", old.name):
            old.unlink()
    graph.run().plot(_plots(graph)[0]).savefig(target, dpi=DPI)
    return target.name


def _plots(graph: runtime.Graph) -> list[str]:
    return [plot.name for plot in graph.observation.plots]
