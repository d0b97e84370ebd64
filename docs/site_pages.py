"""Pages of the site that are made when it is built: the command line, and the gallery.

A page of the gallery prints commands and shows what they made: those of a committed picture, or a
run of the graph, of long ones the first part. All processors run them at once, again only if a
graph or a command has changed.
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

from pictures import PICTURES, Picture, of_run

import runtime
from runtime.cli import make_parser
from runtime.cli.commands import VERBS
from runtime.cli.shipped import Shipped, shipped
from runtime.engine import python_seconds
from runtime.files import slug

MAX_SECONDS = 30.0  # estimated time under the Python engine; a longer run is cut
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
    for name in VERBS.names():
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
    address, commands = _picture(folder, entry, graph)
    shown = f"![{name}]({address})" if address else ""
    console = "\n".join(f"    {command}" for command in commands)
    parts = [f"# {name}", f"{entry.shipped.summary}.", console, shown]
    parts += ["## Diagram", diagram, "## Text", f"```yaml\n{text.rstrip()}\n```"]
    (folder / f"{page}.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return address


def _picture(folder: Path, entry: _Entry, graph: runtime.Graph) -> tuple[str, tuple[str, ...]]:
    """The address of an entry's picture, if there is one, and the commands that make it."""
    command = f"runtime run {entry.name}"
    for name, committed in PICTURES.items():
        if committed.commands[0].split()[:3] == command.split():
            return f"../images/{name}", committed.commands
    picture = _of_graph(command, graph)
    if picture is None:
        return "", (command,)
    digest = hashlib.sha256(repr((graph.to_dict(), picture)).encode()).hexdigest()[:12]
    target = folder / f"{entry.page}-{digest}.png"
    if not target.exists():
        if os.environ.get("SPIKEBLOCKS_DOCS_RUNS") == "0":
            return "", picture.commands
        for old in folder.glob(f"{entry.page}-*.png"):
            if re.fullmatch(rf"{re.escape(entry.page)}-[0-9a-f]{{12}}\.png", old.name):
                old.unlink()
        picture.make(target)
    return target.name, picture.commands


def _of_graph(command: str, graph: runtime.Graph) -> Picture | None:
    """The first plot of a graph's run, of a long one of its first part."""
    try:
        network = graph.network
    except runtime.MissingExtraError:
        return None
    plots = graph.observation.all_plots
    if not plots or any(e.cls.__name__ == PHYSICS for e in network.entries.values()):
        return None
    share = MAX_SECONDS / max(python_seconds(network), MAX_SECONDS)
    if share < 1.0:
        command += f" --until={share * network.ticks * network.dt:.1g}"
    return of_run(command, slug(plots[0].name, "plot"))
