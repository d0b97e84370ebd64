"""A text after an edit, from its last version without problems: what the edit touches is checked.

In: a :class:`Version` and the pieces of a later text. Out: an :class:`Edited`, with what checking
all of the text would find; None where it has to be checked as a whole. The entries around the edit
are read as a small text in which all others are empty lines, so that positions stay; ``update`` in
the room ``network`` does the rest::

    blocks:                                  blocks:
      a: {type: Sine}                ─▶                              an empty line
      b: {type: Gain, gain: 3}                 b: {type: Gain, gain: 3}
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from runtime.document import Node, parse_scalar, parse_yaml
from runtime.errors import GraphError, Problem
from runtime.graph import Examination, examine_edit
from runtime.language.cut import CUT, Cut
from runtime.language.items import YamlItem
from runtime.language.scan import scan
from runtime.language.text import SourceText
from runtime.network import BlockCache, Edit, near_to


@dataclass(frozen=True)
class Version:
    """A text without problems, in pieces, and what checking it found."""

    cut: Cut
    examination: Examination


def agrees(now: Cut, examination: Examination, document: Node) -> bool:
    """Whether the pieces of a text are the entries of its graph, which no other file completes."""
    network = examination.network
    if network is None or network.scope.parts or now.reads_files(now.keys("blocks")):
        return False
    return all(
        [name for name, _ in (document.get(section) or Node({})).items()] == now.keys(section)
        for section in CUT
    )


@dataclass(frozen=True)
class Edited:
    """What is known of a text after an edit; ``syntax`` says why it cannot be read as YAML."""

    examination: Examination
    syntax: list[Problem]


def edited(version: Version, now: Cut, path: Path, block_cache: BlockCache) -> Edited | None:
    """What checking a text would find; None if all of it has to be checked."""
    network, touched = version.examination.network, now.touched_since(version.cut)
    if network is None or touched is None:
        return None
    # One entry at least: sections are not empty, as checks would say.
    keys = {section: now.keys(section) for section in CUT}
    near = near_to(network, touched or keys["blocks"][:1])
    if len(near) > len(keys["blocks"]) // 2 + 100 or now.reads_files(near):
        return None
    if not near & {*keys["blocks"]}:
        near |= {*keys["blocks"][:1]}
    syntax: list[Problem] | None = []
    try:
        document = parse_yaml(now.near(near), str(path))
    except GraphError:
        syntax = _syntax(now, touched, near, path)
        text = now.near(near, lines=False)
        document = repaired(scan(text), SourceText(text), str(path))
    for section in CUT:
        written = [name for name, _ in (document.get(section) or Node({})).items()]
        if written != [key for key in keys[section] if key in near]:
            return None
    if syntax is None:
        return None
    # Paths in entries have been excluded: nothing is left to read for this document.
    params = now.params_beside(near)
    edit = Edit(keys["blocks"], keys["wires"], frozenset(touched), near, params, document)
    examination = examine_edit(version.examination, edit, block_cache)
    return None if examination is None else Edited(examination, syntax)


def _syntax(now: Cut, touched: set[str], near: frozenset[str], path: Path) -> list[Problem] | None:
    """Why a text cannot be read; None if the mistake may reach beyond the entries around it."""
    around = {*touched, *now.following(touched)}
    try:
        parse_yaml(now.near({*near, *around}), str(path))
    except GraphError as error:
        text = SourceText(now.source)
        for problem in error.problems:
            name = now.entry_at(text.at(problem.where))
            if name not in around:
                return None
        return error.problems
    return None


# Completion needs the types of a graph that does not parse. So what was scanned goes to the
# same loader and checks, as if the rest had been written:
#     wires: {sum: {terms: [a.out,      becomes     {"wires": {"sum": {"terms": ["a.out"]}}}
# A key without a colon is left out: as an entry with the value null it would delete what
# "extends" brings. Of two equal keys the first counts; the second is probably being renamed.
def repaired(item: YamlItem, text: SourceText, file: str) -> Node:
    """What was scanned of a text, as the loader has it."""
    where = text.where(item.start, file)
    key = where if item.key_start < 0 else text.where(item.key_start, file)
    if item.kind == "map":
        entries: dict[str, Node] = {}
        for inner in item.items:
            if inner.colon >= 0 or inner.kind != "empty":
                entries.setdefault(inner.key, repaired(inner, text, file))
        return Node(entries, where, key)
    if item.kind == "list":
        return Node([repaired(inner, text, file) for inner in item.items], where, key)
    if item.kind == "empty" or item.quoted:
        return Node(item.value if item.quoted else None, where, key)
    try:
        return Node(parse_scalar(item.value), where, key)
    except ValueError:
        return Node(0, where, key)
