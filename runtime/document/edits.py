"""Changes to a graph's document: one entry set, a wire moved, a block left out."""

from __future__ import annotations

from typing import Any

from blocks.core import hint
from runtime.document.node import MAX_DEPTH, Node, from_python
from runtime.document.sections import PART_SECTIONS, SECTIONS
from runtime.errors import GraphError, Problem, UsageError, Where

# Entries may be added to these; blocks and runs have the entries that they have.
OPEN_SECTIONS = ("params", "wires", "probes", "plots", "metrics")


def set_entry(document: Node, path: str, value: Any, origin: str = "") -> Node:
    """The document with one entry changed; ``None`` takes the entry out.

    Parameters
    ----------
    value : plain, or a node that keeps the places where it was read.
    path : as the file reads: ``blocks.lqr.q``, ``run.until``, ``params.v_r``; each ``blocks.``
        may be left out, and a number counts the items of a list from 0.
    origin : where the change was written, for messages about the value.

    Raises
    ------
    GraphError : the path leads nowhere.
    """
    where = Where(origin or f"set {path}")
    names = path.strip().split(".")
    if "" in names:
        message = f"'{path}' is no path; expected one such as blocks.lqr.q"
        raise GraphError([Problem(where, "", message)])
    if len(names) > MAX_DEPTH:
        raise GraphError([Problem(where, "", f"a path of more than {MAX_DEPTH} names")])
    blocks = _block_names(document)
    if names[0] not in SECTIONS and names[0] not in blocks:
        suggestion = hint(names[0], [*SECTIONS, *blocks]) or f"; expected {', '.join(SECTIONS)}"
        raise GraphError(
            [Problem(where, path, f"there is no '{names[0]}' in the graph{suggestion}")]
        )
    if names in (["blocks"], ["wires"]):
        raise GraphError([Problem(where, path, f"name an entry, as in {names[0]}.NAME.KEY")])
    node = value if value is None or isinstance(value, Node) else from_python(value, where)
    return _set(document, _completed(document, names, SECTIONS), node, path, where)


def full_path(document: Node, path: str) -> str:
    """A path with every ``blocks.`` written out, so that two of one entry are equal."""
    return ".".join(_completed(document, path.strip().split("."), SECTIONS))


def _block_names(node: Node | None) -> list[str]:
    blocks = node.get("blocks") if node is not None else None
    return [name for name, _ in blocks.items()] if blocks is not None else []


def _completed(node: Node | None, names: list[str], own: Any) -> list[str]:
    """A path with the ``blocks.`` that were left out."""
    if not names:
        return []
    blocks = node.get("blocks") if node is not None else None
    if names[0] == "blocks" and len(names) > 1:
        names = names[1:]
    elif names[0] in own or names[0] not in _block_names(node):
        return names
    below = blocks.get(names[0]) if blocks is not None else None
    return ["blocks", names[0], *_completed(below, names[1:], PART_SECTIONS)]


def _set(node: Node, names: list[str], value: Node | None, path: str, where: Where) -> Node:
    name, rest = names[0], names[1:]
    if node.is_list:
        if not name.isdecimal() or int(name) >= len(node.value):
            message = f"'{name}' is no item of a list of {len(node.value)}; items count from 0"
            raise GraphError([Problem(where, path, message)])
        items = list(node.value)
        inner = value if not rest else _set(items[int(name)], rest, value, path, where)
        items[int(name) : int(name) + 1] = [] if inner is None else [inner]
        return Node(items, where, node.key)
    if not node.is_map:
        message = f"'{name}' cannot be set inside {node.describe()}"
        raise GraphError([Problem(where, path, message)])
    below = node.get(name)
    if not rest:
        key = where if below is None else below.key
        return node.with_item(name, None if value is None else Node(value.value, value.where, key))
    if below is None:
        if rest[0].isdecimal():
            message = f"'{name}' is not written in the graph; set the whole list"
            raise GraphError([Problem(where, path, message)])
        if name not in OPEN_SECTIONS and path.split(".")[0] not in OPEN_SECTIONS:
            known = [key for key, _ in node.items()]
            suggestion = hint(name, known) or f"; there are {', '.join(known) or 'none'}"
            raise GraphError([Problem(where, path, f"there is no '{name}'{suggestion}")])
        below = Node({}, where, where)
    return node.with_item(name, _set(below, rest, value, path, where))


def set_wire(document: Node, consumer: str, source: Any, origin: str = "") -> Node:
    """The document with one input wired anew.

    Parameters
    ----------
    consumer : ``block.input``, ``part.block.input``, or ``block.input.1`` for one of many terms.

    Raises
    ------
    UsageError, GraphError : the consumer is no such thing.
    """
    names = consumer.strip().split(".")
    if names[0] == "wires" and "wires" not in _block_names(document):
        names = names[1:]
    if "" in names or len(names) < 2:
        shown = f"{origin}: " if origin else ""
        raise UsageError(
            f"{shown}expected consumer.input=producer.output, as in lqr.error=error.state, "
            f"got '{consumer}'"
        )
    path: list[str] = []
    scope: Node | None = document
    while len(names) > 2 and scope is not None:
        blocks = scope.get("blocks")
        scope = blocks.get(names[0]) if blocks is not None else None
        if not _block_names(scope):
            break
        path += ["blocks", names.pop(0)]
    return set_entry(document, ".".join([*path, "wires", *names]), source, origin)


def add_names(document: Node, section: str, names: tuple[str, ...], origin: str = "") -> Node:
    """The document with names added to ``without`` or ``bypass``.

    Raises
    ------
    UsageError : a command line names none.
    """
    if origin and not names:
        raise UsageError(f"{origin.strip()}: expected a block's name")
    where = Where(origin or section)
    old = document.get(section)
    written = [] if old is None or old.value is None else old.value if old.is_list else [old]
    known = {item.value for item in written if isinstance(item.value, str)}
    added = [Node(name, where, where) for name in names if name not in known]
    return document.with_item(section, Node([*written, *added], where, where))
