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
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from importlib.util import find_spec
from itertools import repeat
from pathlib import Path

from cards import GROUPS, Entry, card, entry, grid, thumbnail
from pictures import IMAGES, PICTURES, Picture, of_run

import runtime
from runtime.arguments import RARE
from runtime.cli import make_parser
from runtime.cli.commands import VERBS
from runtime.cli.commands.help import change_help
from runtime.cli.shipped import RUNNABLE, schema_line, shipped
from runtime.engine import python_seconds
from runtime.files import slug
from spikeblocks.page import export_page

MAX_SECONDS = 30.0  # estimated time under the Python engine; a longer run is cut
PHYSICS = "MujocoVacuum"
# On the landing page: one of each group.
SIX = (
    "wall_following_robust",
    "starters/adaptive",
    "gallery/nengo/lorenz_attractor",
    "gallery/balanced_pole",
    "gallery/bouncing_ball",
    "gallery/double_pendulum",
)
SMALL = "gallery/step_feedback"  # beside its diagram and its plot there
# Graphs whose pages simulate in the reader's browser, with the sliders that are not the usual ones.
LIVE: dict[str, tuple[str, ...]] = {
    "line_actuator_failure": ("fault.gain[1]=0..1",),
    "starters/adaptive": (
        "snn.learning_rate=0..2e-5",
        "match.v_r=0.5..2",
        "plant.wheel_base=0.1..1",
    ),
    "gallery/balanced_pole": (),
    "gallery/cart_pole_balance": ("force=-5..5",),
    "gallery/dc_motor": (),
    "gallery/duffing": (),
    "gallery/pendulum": (),
    "gallery/pid_loop": (),
    "gallery/step_feedback": (),
    "gallery/thermostat": (),
    "gallery/van_der_pol": ("force.constants.damping=0..3",),
    "gallery/worn_actuator": (),
}
FIRST_LIVE = "line_actuator_failure"  # on the landing page
FILTER = """<label class="filter">Show only
<input id="filter" type="search" placeholder="a word or a block, as in PID"></label>
<p id="nothing" hidden>No graph has all of these words.</p>"""
COLUMNS = "100"
COMMITTED = "../images/"


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
    lines = ["# Command line", "", "What `runtime VERB --help-all` prints. `runtime --help`:", ""]
    lines += ["```text", parser.format_help().rstrip(), "```", ""]
    changes = change_help()
    lines += ["## Options that change a graph", "", "```text", changes, "```", ""]
    for name in VERBS.names():
        lines += [f"## runtime {name}", "", "```text"]
        verbs.choices[name].explains = (RARE,)
        lines += [verbs.choices[name].format_help().rstrip(), "```", ""]
    return "\n".join(lines)


def gallery(folder: Path) -> None:
    """Write a page for each graph that can be run, the page of all, and the landing page's part."""
    entries = [entry(group, each) for group in RUNNABLE for each in shipped(group)]
    with ProcessPoolExecutor() as pool:
        pictures = list(pool.map(_page, repeat(folder), entries))
    shown = dict(zip((each.name for each in entries), pictures, strict=True))
    cards = {each.name: card(each, *shown[each.name]) for each in entries}
    lines = ["# Gallery\n\nEvery graph that comes with the package, and what its run shows.\n"]
    lines += ["```{raw} html", FILTER, "```", ""]
    for group, about in GROUPS.items():
        members = [each for each in entries if each.group == group]
        lines += [f"## {group}", "", about, ""]
        lines += [grid([cards[each.name] for each in members]), ""]
    (folder / "gallery.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    chosen = [each for name in SIX for each in entries if each.name == name]
    six = grid([card(each, *shown[each.name], up="generated/") for each in chosen])
    (folder / "six.txt").write_text(six + "\n", encoding="utf-8")
    first = next(each for each in entries if each.name == FIRST_LIVE)
    (folder / "live.txt").write_text(_live(folder, first, "") + "\n", encoding="utf-8")
    small = next(each for each in entries if each.name == SMALL)
    text = small.shipped.path.read_text(encoding="utf-8")
    text = text.removeprefix(schema_line(text))
    (folder / "small.txt").write_text(text[text.index("graph:") :], encoding="utf-8")


def _page(folder: Path, each: Entry) -> tuple[str, str]:
    """Write a graph's page; returns its thumbnail, and what that shows."""
    text = each.shipped.path.read_text(encoding="utf-8")
    text = text.removeprefix(schema_line(text))
    diagram = f"{each.page}.svg"
    try:
        (folder / diagram).write_text(str(each.graph.diagram("svg")), encoding="utf-8")
        drawn = f"![Block diagram of {each.name}]({diagram})"
    except runtime.MissingExtraError as error:
        diagram, drawn = "", f"The diagram is missing: {error}."
    address, commands, alt = _picture(folder, each)
    kinds = ", ".join(f"`{name}`" for name in each.types)
    # In no table of contents: a hundred and fifty entries beside every page help nobody.
    parts = ["---\norphan: true\n---", f"# {each.title}", each.line, _shell(commands)]
    parts += [f"![{alt}]({address})" if address else "", _live(folder, each, "../")]
    parts += ["## Diagram", drawn]
    parts += [f"Blocks: {kinds}." if kinds else "", "## Text", f"```yaml\n{text.rstrip()}\n```"]
    parts += ["## What to try", _shell(_trials(each))]
    text = "\n\n".join(part for part in parts if part)
    (folder / f"{each.page}.md").write_text(text + "\n", encoding="utf-8")
    if not (address or diagram):
        return "", ""
    is_committed = address.startswith(COMMITTED)
    source = IMAGES.parent / address[3:] if is_committed else folder / (address or diagram)
    small = thumbnail(source, folder / "static", each.page)
    return small, alt if address else f"Block diagram of {each.name}"


def _live(folder: Path, each: Entry, root: str) -> str:
    """A section with a page that simulates, if the graph has one and the extra is installed.

    The page is a file of its own, which a browser loads when it comes into sight.
    """
    if each.name not in LIVE or find_spec("ziglang") is None:
        return ""
    file = f"{each.page}-live"
    export_page(each.graph, folder / "static", name=file, slider=LIVE[each.name])
    address = f"{root}_static/{file}.html"
    frame = f'<iframe class="live" src="{address}" loading="lazy" title="{each.title}"></iframe>'
    link = f'<p class="small"><a href="{address}">On a page of its own</a>; '
    link += f'how it was made: <a href="{root}pages.html">pages that simulate</a>.</p>'
    return "\n".join(["## Try it here", "", "```{raw} html", frame, link, "```"])


def _shell(commands: Iterable[str]) -> str:
    return "\n".join(("```sh", *commands, "```"))


def _trials(each: Entry) -> list[str]:
    """Commands that change a graph: each was checked with it."""
    found = [f"runtime new my.yaml --from {each.name}"]
    try:
        each.graph.check()
    except runtime.MissingExtraError:
        return found
    names = [name for name in each.graph.network.entries if "." not in name]
    changes = [("without", name) for name in reversed(names)]
    changes += [("bypass", name) for name in names]
    for how, name in changes:
        with suppress(runtime.SpikeblocksError):
            getattr(each.graph, how)(name).check()
            found.append(f"runtime run {each.name} --vs {how}={name}")
            break
    for path, value in _numbers(each.graph):
        with suppress(runtime.SpikeblocksError):
            each.graph.set(path, 2 * value).check()
            found.append(f"runtime run {each.name} --vs set={path}={2 * value:g}")
            break
    return [*found, f"runtime explain {each.name}"]


def _numbers(graph: runtime.Graph) -> Iterator[tuple[str, float]]:
    """Numbers of a graph that can be doubled, with their addresses."""
    tree = graph.to_dict()
    sections = [("params", tree.get("params", {}))]
    sections += [(f"blocks.{name}", entry) for name, entry in tree["blocks"].items()]
    for path, entries in sections:
        for key, value in entries.items() if isinstance(entries, dict) else ():
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if is_number and value and key not in ("dt", "offset"):
                yield f"{path}.{key}", value


def _picture(folder: Path, each: Entry) -> tuple[str, tuple[str, ...], str]:
    """The address of an entry's picture, '' if there is none; its commands; what it shows."""
    command = f"runtime run {each.name}"
    for name, committed in PICTURES.items():
        if committed.commands[0].split()[:3] == command.split():
            return f"{COMMITTED}{name}", committed.commands, f"{each.title}: {committed.shows}"
    picture = _of_graph(command, each.graph)
    if picture is None:
        return "", (command,), ""
    alt = f"{each.title}: {picture.shows}"
    made = (each.graph.to_dict(), picture.made, picture.commands)
    digest = hashlib.sha256(repr(made).encode()).hexdigest()[:12]
    target = folder / f"{each.page}-{digest}.png"
    if not target.exists():
        if os.environ.get("SPIKEBLOCKS_DOCS_RUNS") == "0":
            return "", picture.commands, ""
        for old in folder.glob(f"{each.page}-*.png"):
            if re.fullmatch(rf"{re.escape(each.page)}-[0-9a-f]{{12}}\.png", old.name):
                old.unlink()
        picture.make(target)
    return target.name, picture.commands, alt


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
    plot = plots[0]
    title = plot.options.get("title") or plot.name.replace("_", " ")
    signals = ", ".join(plot.of)
    shows = f"plot of kind {plot.kind}, {title}" + (f", of {signals}" if signals else "")
    return of_run(command, slug(plot.name, "plot"), shows)
