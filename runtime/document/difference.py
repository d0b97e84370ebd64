"""What one document changes in another one, as a document that is merged over it.

In: two trees. Out: the smallest one that makes the second of the first::

    old   blocks: {a: {type: Gain, gain: 1}, b: {type: Sine}}
    new   blocks: {a: {type: Gain, gain: 2}}
    ─▶    blocks: {a: {gain: 2}, b: null}
"""

from __future__ import annotations

from collections.abc import Iterator

from runtime.document.loader import TYPED, is_of_another_kind
from runtime.document.node import Node


def difference(old: Node, new: Node) -> Node:
    """The mapping with ``merge(old, difference(old, new))`` equal to ``new``, but for the order.

    Raises
    ------
    ValueError : no merge makes the one of the other, since a null deletes an entry, and since
        a block, plot or metric keeps its type; says where.
    """
    if not (old.is_map and new.is_map):
        raise ValueError("expected two mappings")
    found = _entries(old, new, "", "")
    return found


def same(one: Node, other: Node) -> bool:
    """Whether two trees say the same: 1, 1.0 and true are three values, the order is none."""
    if one.is_map and other.is_map:
        return one.value.keys() == other.value.keys() and all(
            same(node, other.value[name]) for name, node in one.items()
        )
    if one.is_list and other.is_list:
        return len(one.value) == len(other.value) and all(map(same, one.value, other.value))
    if one.is_map or one.is_list or other.is_map or other.is_list:
        return False
    a, b = one.value, other.value
    return type(a) is type(b) and (a is b or bool(a == b) or (a != a and b != b))


def changed_paths(node: Node, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Node]]:
    """The entries that a difference sets or deletes: each path with its value."""
    for name, entry in node.items():
        if entry.is_map and entry.value:
            yield from changed_paths(entry, (*path, name))
        else:
            yield (*path, name), entry


def _entries(old: Node, new: Node, section: str, key: str) -> Node:
    entries: dict[str, Node] = {name: Node(None) for name, _ in old.items() if not new.get(name)}
    for name, node in new.items():
        below = old.get(name)
        if below is None:
            entries[name] = node
        elif not same(below, node):
            entries[name] = _between(below, node, key, name)
    return Node(entries, new.where, new.key)


def _between(old: Node, new: Node, section: str, key: str) -> Node:
    if new.value is None:
        raise ValueError(f"'{key}' becomes null, which would delete it")
    is_typed = section in TYPED
    if not (old.is_map and new.is_map) or (is_typed and is_of_another_kind(old, new)):
        return new
    if key == "world" and not section:
        return new
    found = _entries(old, new, section, key)
    if is_typed and is_of_another_kind(old, found):
        raise ValueError(f"'{key}' has no type any more")
    return found
