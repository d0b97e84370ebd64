"""Scopes of names: a graph's blocks and ports, and a scope for each of its parts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from blocks.core import SignalType, hint, signal_type
from runtime.document import (
    PART_SECTIONS,
    SECTIONS,
    Node,
    Work,
    check_keys,
    expected,
    fill_sections,
    is_part,
    misspelt,
    section,
)
from runtime.errors import Problems, Where

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
RESERVED = ("inputs", "outputs")


@dataclass
class Scope:
    """The names of a graph or part: its blocks, parts and ports.

    ``prefix`` is put before the names inside to form those in the whole graph; ``address`` is the
    scope's in the document. ``broken`` names blocks that cannot be read, ``unread`` such
    sections: they are reported once, and addresses that lead there are not.
    """

    prefix: str
    address: str
    parent: Scope | None = None
    name: str = ""
    blocks: dict[str, Node] = field(default_factory=dict)
    parts: dict[str, Scope] = field(default_factory=dict)
    wires: dict[str, Node] = field(default_factory=dict)
    inputs: dict[str, Node] = field(default_factory=dict)
    outputs: dict[str, Node] = field(default_factory=dict)
    where: Where = field(default_factory=Where)
    broken: set[str] = field(default_factory=set)
    unread: set[str] = field(default_factory=set)

    def names(self) -> list[str]:
        return [*self.blocks, *self.parts]

    def walk(self) -> Iterator[Scope]:
        """This scope and all below it."""
        yield self
        for part in self.parts.values():
            yield from part.walk()

    def all_names(self) -> list[str]:
        """Full names of all blocks and parts."""
        return [s.prefix + name for s in self.walk() for name in s.names()]

    def path(self, section: str, name: str) -> str:
        """The document address of an entry: ``blocks.adaptive.wires.snn_v``."""
        return ".".join(part for part in (self.address, section, name) if part)


def expand(document: Node, problems: Problems) -> tuple[Scope, Node]:
    """Check the document's sections and open its parts.

    Returns
    -------
    The top scope, and the document with every ``$name`` of the top level filled in.
    """
    work = Work(problems)
    work.check(document, document.where, "")
    check_keys(document, SECTIONS, "", problems, "section")
    filled = fill_sections(document, document.get("params"), "", problems, work)
    top = Scope("", "", unread=_unread(document, SECTIONS))
    return _scope(filled, top, problems, work), filled


def _unread(document: Node, known: Iterable[str]) -> set[str]:
    """Sections that cannot be read because their names are misspelt."""
    found = misspelt(document, known)
    strange = any(name not in known for name, _ in document.items())
    return found | {"wires"} if strange and document.get("wires") is None else found


def _scope(document: Node, scope: Scope, problems: Problems, work: Work) -> Scope:
    def entries(name: str) -> dict[str, Node]:
        return section(document, name, scope.path(name, ""), problems, scope.unread)

    scope.wires = entries("wires")
    scope.inputs, scope.outputs = entries("inputs"), entries("outputs")
    written = entries("blocks")
    for name, entry in written.items():
        address = scope.path("blocks", name)
        message = _misnamed(name)
        if message:
            problems.add(entry.key, address, message)
            scope.broken.add(name.partition("{")[0].strip())
        elif not entry.is_map:
            message = f"expected {{type: ...}}, got {entry.describe()}"
            if entry.value is None:
                others = [other for other in written if other != name]
                message += hint(name, others) or "; null only deletes what 'extends' adds"
            problems.add(entry.where, address, message)
            scope.broken.add(name)
        elif is_part(entry):
            scope.parts[name] = _part(entry, scope, name, address, problems, work)
        else:
            work.block(entry.key, address)
            scope.blocks[name] = entry
    if not (scope.blocks or scope.parts or scope.broken or scope.unread & {"blocks"}):
        node = document.get("blocks")
        where = document.where if node is None else node.key
        problems.add(where, scope.path("blocks", ""), f"there are no blocks; {expected('blocks')}")
        scope.unread.add("blocks")
    return scope


def _misnamed(name: str) -> str:
    if name in RESERVED:
        return f"'{name}' is reserved for the ports of a part; give the block another name"
    if "{" in name:
        return f"a colon is missing after '{name.split('{')[0].strip()}'"
    if not NAME.fullmatch(name):
        return f"'{name}' is not a name for a block; use letters, digits and _"
    return ""


def _part(
    entry: Node, above: Scope, name: str, address: str, problems: Problems, work: Work
) -> Scope:
    declared = entry.get("params")
    for key, item in entry.items():
        if key not in PART_SECTIONS:
            known = declared is not None and declared.get(key) is not None
            suggestion = hint(key, PART_SECTIONS[:5]) or f"; it has {', '.join(PART_SECTIONS[:5])}"
            suggestion = f"; write it as params: {{{key}: ...}}" if known else suggestion
            problems.add(item.key, f"{address}.{key}", f"a part has no '{key}'{suggestion}")
    filled = fill_sections(entry, declared, address, problems, work)
    scope = Scope(f"{above.prefix}{name}.", address, above, name, where=entry.key)
    scope.unread = _unread(entry, PART_SECTIONS)
    return _scope(filled, scope, problems, work)


def part_input(
    node: Node, address: str, problems: Problems, own: Mapping[str, SignalType] | None = None
) -> SignalType | None:
    """The type that an entry of a part's ``inputs`` declares; None if it declares none.

    ``own`` are the signal types that the graph's own blocks define, by name.
    """
    declared = node.get("type") if node.is_map else node
    if node.is_map:
        check_keys(node, ("type", "optional", "doc"), address, problems, "key")
        optional = node.get("optional")
        if optional is not None and not isinstance(optional.value, bool):
            message = f"expected true or false, got {optional.describe()}"
            problems.add(optional.where, f"{address}.optional", message)
    if declared is None or declared.value is None:
        return None
    try:
        if not isinstance(declared.value, str):
            raise ValueError(f"expected a signal type such as Twist, got {declared.describe()}")
        return signal_type(declared.value, own=own)
    except ValueError as error:
        problems.add(declared.where, address, str(error))
        return None


def is_optional(declared: Node) -> bool:
    """Whether a part's input may stay open; a value that is not a boolean counts as true."""
    node = declared.get("optional")
    return node is not None and node.value is not False
