"""What comes with the package: graphs, starters, and what can be laid over or put into a graph."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from runtime.document import SHIPPED

HEADER = "# yaml-language-server: $schema="

# The folders whose use needs a word; others are listed by their names alone.
USES = {
    "graphs": "run one by its name: runtime run NAME",
    "gallery": "run one: runtime run gallery/NAME",
    "gallery/nengo": "Nengo's examples; run one: runtime run gallery/nengo/NAME",
    "gallery/papers": "models of papers; run one: runtime run gallery/papers/NAME",
    "gallery/published": "published models; run one: runtime run gallery/published/NAME",
    "starters": "begin with a copy: runtime new my.yaml --from NAME",
    "conditions": "lay one over a graph: --with conditions/NAME",
    "rules": "lay one over a graph: --with rules/NAME",
    "wheel_faults": "lay one over a graph with physics: --with wheel_faults/NAME",
    "worlds": "world: worlds/NAME, or --set world=worlds/NAME",
    "parts": "a block {graph: parts/NAME.yaml}",
    "plants": "extends: [GRAPH, plants/NAME.yaml]",
    "experiments": "runtime ablate experiments/NAME",
}
FIRST = ("graphs", "starters")
# The groups whose files run as they are.
RUNNABLE = (*FIRST, "gallery", "gallery/nengo", "gallery/papers", "gallery/published")


@dataclass(frozen=True)
class Shipped:
    """A file that comes with the package: the folder that it is in, its name and what it is."""

    group: str
    name: str
    summary: str
    path: Path


def shipped(group: str | None = None) -> list[Shipped]:
    """The files of one group, or of all; graphs first."""
    found = [
        Shipped(_group(path), path.stem, summary(path.read_text(encoding="utf-8")), path)
        for path in sorted(SHIPPED.rglob("*.yaml"))
    ]
    groups = dict.fromkeys((*FIRST, *sorted({each.group for each in found})))
    order = {name: i for i, name in enumerate(groups)}
    chosen = [each for each in found if group in (None, each.group)]
    return sorted(chosen, key=lambda each: (order[each.group], each.name))


def _group(path: Path) -> str:
    folder = path.parent.relative_to(SHIPPED)
    return str(folder) if folder.parts else FIRST[0]


def schema_line(text: str) -> str:
    """The first line of a graph's text if it names a schema, with its break; '' if not."""
    first = text.partition("\n")[0]
    return f"{first}\n" if first.startswith(HEADER) else ""


def summary(text: str) -> str:
    """The first sentence of the comment that a graph's text begins with."""
    lines = []
    for line in text.removeprefix(schema_line(text)).splitlines():
        if not line.startswith("#") or not line.strip("# "):
            break
        lines.append(line.strip("# "))
    whole = " ".join(lines)
    for i, character in enumerate(whole):
        if character == "." and whole[i + 1 : i + 2] in ("", " "):
            return whole[:i]
    return whole
