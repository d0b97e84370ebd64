"""Writes the generated files of docs/ and graphs/: ``python -m docs.describe``."""

from __future__ import annotations

import importlib
import inspect
import json
import re
import subprocess
import sys
from collections.abc import Container, Iterable, Mapping
from pathlib import Path

from blocks.core import Block
from blocks.library.lazy import exports
from blocks.library.registry import BUILTIN
from blocks.limits import TABLE
from docs.expressions_page import expressions_page
from docs.public_api import listing
from runtime.cli.shipped import shipped
from runtime.descriptions import (
    describe_markdown,
    families,
    forms,
    option_text,
    settings,
    summary,
)
from runtime.document import RUN_KEYS, SHIPPED
from runtime.language import json_schema
from runtime.observation import (
    METRIC_KINDS,
    PLOT_KINDS,
    Figure,
    MetricKind,
    MetricOptions,
    PlotKind,
)

INDEX = '''"""Where the names of ``blocks`` are; written by ``python -m docs.describe``.

In: the doors of the rooms. Out: types of blocks, and their other names, each with its module::

    "Gain": "generic.arithmetic"
"""

from __future__ import annotations

'''
# In the order of docs/blocks.md.
ROOMS = (
    *("control", "neural", "world", "wall_fitting", "vehicle", "sources", "generic"),
    *("dynamics", "nonlinear", "plants", "sensors"),
)

MADE = "<!-- Made from the declarations by `python -m docs.describe`; do not edit. -->"
HEADER = f"""# Blocks

{MADE}

Every block also takes `dt` (s), its step: a whole multiple of `run.dt`, which is the default.
`runtime blocks --search WORD` searches this list, and `runtime blocks TYPE` shows one block.
"""

OBSERVING = """# Plots and metrics

<!-- Made from their own declarations by `python -m docs.describe`; do not edit. -->

`of` names probes or addresses. Angles may be written in degrees, as in `90deg`.
"""

EVERY_PLOT = """A graph without the section `plots` draws each probe that changes: a `trajectory` of
a pose, a `raster` of spikes, a `heatmap` of many columns, and a `timeseries` of others.
`plots: {}` draws nothing. Every plot takes, besides its own options:
"""
COMMON_DOC = {
    "title": "`title` (a string): default: the name of the plot",
    "labels": "`labels` (strings): names of the lines, in their order",
}

GALLERY = """# Examples of other packages

<!-- Made from the graphs' own comments by `python -m docs.describe`; do not edit. -->

Which shipped graph is which example of bdsim, PathSim and Nengo. Run one by its name, as in
`runtime run gallery/van_der_pol`; `runtime graphs` lists all, with a line each.
"""


PUBLISHED = """
## Published examples

Examples of other packages in our blocks, with their parameters. Those of `gallery/published` are
there for this alone; tests compare many with scipy's solution or a closed form, and run all.
"""

NENGO = """
## Nengo's examples

Each notebook of Nengo's documentation with the graph made after it. Tests compare means over seeds
with Nengo's own runs of the same model. Two more graphs in `gallery/nengo` are of no notebook. The
notebooks of `spa`, which is a package of its own now, are left out; `gallery/circular_convolution`
is the model of one of them.
"""

# The notebooks whose model is not shipped, and why.
ABSENT = {
    "usage/config": "no model: defaults for many objects; `params` and `extends` do that here",
    "usage/exceptions": "no model: errors of Nengo's own objects",
    "usage/network_design": "no model: how to divide a script; parts do that here",
    "usage/network_design_advanced": "no model: how to divide a script; parts do that here",
    "usage/strings": "no model: objects as text; `runtime explain` does that here",
}


def gallery_page() -> str:
    """The text of docs/gallery.md."""
    lines = [GALLERY.rstrip(), PUBLISHED, "| example | of | graph | blocks |", "|---|---|---|---|"]
    after = _after("gallery", "gallery/published")
    lines += [f"| {name} | {of} | {graph} | {kinds} |" for name, of, graph, kinds in after]
    lines += [NENGO, "| notebook | graph | blocks |", "|---|---|---|"]
    covered = {name: f"{graph} | {kinds}" for name, _, graph, kinds in _after("gallery/nengo")}
    absent = {name: f"{reason} |" for name, reason in ABSENT.items()}
    lines += [f"| {name} | {cells} |" for name, cells in sorted((covered | absent).items())]
    return "\n".join(lines) + "\n"


def _after(*groups: str) -> list[tuple[str, str, str, str]]:
    """Published examples: name, package, the graph made after it, and its blocks; sorted."""
    found = []
    for each in (file for group in groups for file in shipped(group)):
        text = each.path.read_text(encoding="utf-8")
        after = re.search(r"^# After (\S+) of (bdsim|PathSim|Nengo)", text, re.MULTILINE)
        if after is not None:
            found.append((after[1], after[2], f"`{each.group}/{each.name}`", _types(text)))
    return sorted(found)


def _types(text: str) -> str:
    """The types of the blocks of a graph."""
    return ", ".join(sorted(set(re.findall(r"type: (\w+)", text))))


def blocks_pages() -> dict[str, str]:
    """The text of docs/blocks.md, all blocks with a line each, and of a page for each room."""
    index, pages = [HEADER], {}
    for family, names in families(BUILTIN).items():
        room, _, about = family.partition(": ")
        title = room.replace("_", " ").capitalize()
        index += [f"## [{title}](blocks/{room}.md)", "", f"{about}.", "", "| block | is |"]
        index.append("|---|---|")
        for name in names:
            line = summary(BUILTIN[name]).replace("|", "\\|")
            index.append(f"| [`{name}`](blocks/{room}.md#{name.lower()}) | {line} |")
        index.append("")
        described = "\n".join(describe_markdown(BUILTIN[name]) for name in names)
        described += "\n" + settings_markdown({name: BUILTIN[name] for name in names})
        pages[f"blocks/{room}.md"] = f"# {title}\n\n{MADE}\n\n{about}.\n\n{described.rstrip()}\n"
    return {"blocks.md": "\n".join(index).rstrip() + "\n", **pages}


def settings_markdown(known: Mapping[str, type[Block]]) -> str:
    """What parameters of these blocks choose from: a table for each kind of setting."""
    lines = []
    for setting, users in settings(known).items():
        places = ", ".join(f"`{user}`" for user in users)
        lines += [f"## {setting.__name__}", "", f"For {places}: {setting.expected}.", ""]
        lines += ["| form | parameters, with defaults | meaning |", "|---|---|---|"]
        for form, given, _, doc in forms(setting):
            cells = (f"`{form}`", f"`{given}`" if given else "", doc)
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        lines.append("")
    return "\n".join(lines)


def observing_page() -> str:
    """The text of docs/observing.md."""
    figure = {**COMMON_DOC, **{k: option_text(k, d) for k, d in Figure.declared.items()}}
    lines = [OBSERVING, "## Plots", "", EVERY_PLOT]
    lines += [f"* {text}" for text in figure.values()]
    lines += ["", *_kinds_table(PLOT_KINDS, "plot", hidden=figure)]
    common = list(MetricOptions.declared.items())
    lines += ["", "## Metrics", "", "Every metric takes, besides its own options:", ""]
    lines += [f"* {option_text(name, declared)}" for name, declared in common]
    lines += ["", *_kinds_table(METRIC_KINDS, "metric", hidden=dict(common))]
    return "\n".join(lines) + "\n"


def _kinds_table(
    kinds: Mapping[str, PlotKind | MetricKind], noun: str, hidden: Container[str] = ()
) -> list[str]:
    rows = [f"| {noun} | is | options |", "|---|---|---|"]
    for name, kind in kinds.items():
        own = [
            option_text(key, declared)
            for key, declared in kind.options.declared.items()
            if key not in hidden
        ]
        own += [f"`{key}` (a probe or an address)" for key in getattr(kind, "signals", ())]
        cells = (f"`{name}`", kind.doc, "; ".join(own))
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return rows


def schema_file() -> str:
    """The text of graphs/schema.json."""
    return json.dumps(json_schema(), indent=1, ensure_ascii=False) + "\n"


def index_file() -> str:
    """The text of blocks/library/index.py: where the names of the rooms' doors are, types apart."""
    types, others = "", ""
    for room in ("", *ROOMS):
        door = importlib.import_module(f"blocks.{room}".rstrip("."))
        homes = {name: home.partition(":")[0] for name, home in exports(door.__name__).items()}
        for name in door.__all__ if room else (n for n in homes if homes[n] == "blocks.core"):
            value = getattr(door, name)
            line = f'    "{name}": "{homes[name].removeprefix("blocks.")}",\n'
            is_type = isinstance(value, type) and issubclass(value, Block)
            if room and is_type and not inspect.isabstract(value):
                types += line
            else:
                others += line
    return f"{INDEX}TYPES = {{\n{types}}}\nOTHERS = {{\n{others}}}\n"


def with_limits(page: str) -> str:
    """The text of docs/security.md with the table of limits as it is in the code."""
    return _with_table(page, ("what", "limit"), TABLE)


def with_run_keys(page: str) -> str:
    """The text of docs/graph-format.md with the keys of ``run`` as they are declared."""
    rows = [
        (f"`{key}`", ". ".join(filter(None, (each.doc, each.more))), each.shown)
        for key, each in RUN_KEYS.items()
    ]
    return _with_table(page, ("key of `run`", "meaning", "default"), rows)


def _with_table(page: str, head: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> str:
    """A page in which the rows of the table with this head are replaced."""
    first = f"| {' | '.join(head)} |\n{'|---' * len(head)}|\n"
    text = first + "".join(f"| {' | '.join(map(str, row))} |\n" for row in rows)
    return re.sub(rf"{re.escape(first)}(\|.*\n)*", lambda _: text, page)


def main() -> int:
    """Write what is generated."""
    docs = Path(__file__).parent
    index, text = docs.parent / "blocks" / "library" / "index.py", index_file()
    if index.read_text(encoding="utf-8") != text:
        index.write_text(text, encoding="utf-8")
        # This process has imported the index as it was, with a room that is gone.
        return subprocess.call([sys.executable, "-m", "docs.describe"])
    (SHIPPED / "schema.json").write_text(schema_file(), encoding="utf-8")
    (docs / "blocks").mkdir(exist_ok=True)
    pages = blocks_pages() | {
        "observing.md": observing_page(),
        "api.txt": listing(),
        "expressions.md": expressions_page(),
        "gallery.md": gallery_page(),
    }
    for name, complete in (("security.md", with_limits), ("graph-format.md", with_run_keys)):
        pages[name] = complete((docs / name).read_text(encoding="utf-8"))
    for name, page in pages.items():
        (docs / name).write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
