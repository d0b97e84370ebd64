"""Opens a document: its sections checked, and a scope made for the graph and for each part.

In: a document in which files are merged. Out: the top :class:`Scope` and, below it, one for each
part, in which ``$names`` have their values::

    blocks: {a: {graph: part.yaml, params: {k: 2}}}   ->   top.parts["a"].blocks, with $k = 2
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from blocks.core import misspelt
from runtime.document import (
    PART_SECTIONS,
    SECTIONS,
    Node,
    Work,
    check_keys,
    expected_form,
    fill_sections,
    is_part,
    misspelt_keys,
    read_seed,
    section,
)
from runtime.errors import Problems
from runtime.network.repetition import repeat_part
from runtime.network.scope import Scope

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
RESERVED = ("inputs", "outputs")


def expand(document: Node, problems: Problems, is_part: bool = False) -> tuple[Scope, Node]:
    """Check the document's sections and open its parts; ``is_part`` if it is that of a part.

    Returns
    -------
    The top scope, and the document with every ``$name`` of the top level filled in.
    """
    work = Work(problems)
    # Before anything walks it: a few lines may stand for more values than fit in memory.
    work.check(document, document.where, "")
    check_keys(document, (*SECTIONS, "seed") if is_part else SECTIONS, "", problems, "section")
    declared = document.get("params")
    document_filled = fill_sections(document, declared, "", problems, work)
    unread = _unread(document, SECTIONS)
    top = Scope("", "", unread=unread, params=_names(declared), is_file_of_part=is_part)
    return _scope(document_filled, top, problems, work), document_filled


def _names(declared: Node | None) -> frozenset[str]:
    """The names of params that are declared."""
    return frozenset() if declared is None else frozenset(name for name, _ in declared.items())


def _unread(document: Node, known: Iterable[str]) -> set[str]:
    """Sections that cannot be read because their names are misspelt."""
    names = misspelt_keys(document, known)
    strange = any(name not in known for name, _ in document.items())
    # An unknown section may be the wires, in a word that no spelling suggests ('connections').
    return names | {"wires"} if strange and document.get("wires") is None else names


def _scope(document: Node, scope: Scope, problems: Problems, work: Work) -> Scope:
    def entries(name: str) -> dict[str, Node]:
        return section(document, name, scope.path(name, ""), problems, scope.unread)

    scope.wires = entries("wires")
    scope.inputs, scope.outputs = entries("inputs"), entries("outputs")
    scope.defaults = entries("defaults")
    for section_name, ports in (("inputs", scope.inputs), ("outputs", scope.outputs)):
        for name in [name for name in ports if not NAME.fullmatch(name)]:
            message = f"'{name}' is not a name for a port; use letters, digits and _"
            problems.add(ports.pop(name).key, scope.path(section_name, ""), message)
    block_entries = entries("blocks")
    for name, entry in block_entries.items():
        address = scope.path("blocks", name)
        message = _name_problem(name)
        if message:
            problems.add(entry.key, address, message)
            # 'a{type: Sum}' lacks a colon; the wires still name 'a'.
            scope.broken.add(name.partition("{")[0].strip())
        elif not entry.is_map:
            message = f"expected {{type: ...}}, got {entry.describe()}"
            if entry.value is None:
                others = [other for other in block_entries if other != name]
                other = "; null only deletes what 'extends' adds"
                message = misspelt("null-value", message, name, others, other)
            problems.add(entry.where, address, message)
            scope.broken.add(name)
        elif is_part(entry):
            scope.parts[name] = _open_part(entry, scope, name, address, problems, work)
        else:
            work.block(entry.key, address)
            scope.blocks[name] = entry
    if not (scope.blocks or scope.parts or scope.broken or scope.unread & {"blocks"}):
        node = document.get("blocks")
        where = document.where if node is None else node.key
        message = f"there are no blocks; {expected_form('blocks')}"
        problems.add(where, scope.path("blocks", ""), message, "no-blocks")
        scope.unread.add("blocks")
    return scope


def _name_problem(name: str) -> str:
    if name in RESERVED:
        return f"'{name}' is reserved for the ports of a part; give the block another name"
    if "{" in name:
        return f"a colon is missing after '{name.split('{')[0].strip()}'"
    if not NAME.fullmatch(name):
        return f"'{name}' is not a name for a block; use letters, digits and _"
    return ""


def _open_part(
    entry: Node, above: Scope, name: str, address: str, problems: Problems, work: Work
) -> Scope:
    """The scope of a part, or of all copies of a repeated one."""
    if entry.get("repeat") is None:
        if (shared := entry.get("share")) is not None:
            message = "only a part with 'repeat' shares inputs among its copies"
            problems.add(shared.key, f"{address}.share", message)
            entry = entry.with_item("share", None)
        return _part(entry, above, name, address, problems, work)

    def copy(one: Node, inside: Scope, own: str) -> Scope:
        work.charge(work.measure.of(one)[0], one.where, address)
        # All copies have the address of the part, so that a mistake in it is reported once.
        return _part(one, inside, own, address, problems, work)

    scope = Scope(f"{above.prefix}{name}.", address, above, name, where=entry.key)
    scope.params, scope.holds_copies = above.params, True
    return repeat_part(entry, scope, problems, copy)


def _part(
    entry: Node, above: Scope, name: str, address: str, problems: Problems, work: Work
) -> Scope:
    declared = entry.get("params")
    for key, item in entry.items():
        if key not in PART_SECTIONS:
            known = declared is not None and declared.get(key) is not None
            names = () if known else PART_SECTIONS[:5]
            other = f"; write it as params: {{{key}: ...}}" if known else ""
            other = other or f"; it has {', '.join(names)}"
            message = misspelt("unknown-name", f"a part has no '{key}'", key, names, other)
            problems.add(item.key, f"{address}.{key}", message)
    entry_filled = fill_sections(entry, declared, address, problems, work, above.params)
    scope = Scope(f"{above.prefix}{name}.", address, above, name, where=entry.key)
    scope.unread = _unread(entry, PART_SECTIONS)
    seed = read_seed(entry.get("seed"), f"{address}.seed", problems)
    scope.seed = above.seed if seed is None else seed
    scope.params = above.params | _names(declared)
    return _scope(entry_filled, scope, problems, work)
