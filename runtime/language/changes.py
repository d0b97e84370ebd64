"""Changes of a graph as changes of its text, which keeps its comments and its layout.

In: a model, and the document that its text is to say, as a method of :class:`runtime.Graph` makes
it from ``model.document``. Out: the new text, of which only the entries differ that the change
touches; what a file below (``extends``, a part) says is overlaid, not repeated::

    graph = graph.set("pid.kp", 3.0)        pid: {type: PID, kp: 3.0}   # tuned by hand
    graph = graph.without("noise")          without: [noise]
    graph = graph.replace("pid", "LQR")     pid: {type: LQR}            # tuned by hand
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from runtime.document import Node, flow_yaml, same
from runtime.errors import SpikeblocksError, UsageError
from runtime.language.formatting import apply_edits
from runtime.language.insertion import Edit, add_entry, add_name, remove_entry
from runtime.language.items import YamlItem
from runtime.language.mentions import SIGNAL_KEYS
from runtime.language.model import Model

Names = tuple[str, ...]
# Sections that are lists of names.
_NAMES = ("without", "bypass")


def write_document(model: Model, new: Node) -> str:
    """The text that says another document.

    Raises
    ------
    UsageError : an edit of this file cannot say it, since another file does.
    """
    source = model.text.source
    changes = [*_changes(model.document, new, ())]
    # Entries are set before others are deleted: a block of another type loses its parameters.
    for path, node in sorted(changes, key=lambda change: change[1] is None):
        source = _write(_again(model, source), path, node, new)
    after = _again(model, source)
    if after.syntax or not same(_without_empty(after.document), _without_empty(new)):
        raise UsageError("this change cannot be written into the file; another file says it")
    return source


def write_entries(model: Model, entries: Mapping[Names, Any]) -> str:
    """The text in which entries of a file, by their path, have other values.

    Of each only the characters of its value are replaced; one that is not there is added.

    Raises
    ------
    UsageError : the file has no place for one of them.
    """
    source = model.text.source
    for path, value in entries.items():
        now = _again(model, source)
        item = _item(now.root, path)
        text = flow_yaml(value)
        if item is None or item.kind == "empty":
            source = _insert(now, path, text)
        else:
            source = _apply(source, [Edit(item.span, text)])
    return source


def why_not(model: Model, text: str) -> str:
    """Why a text of this file's graph could not run; '' if it could."""
    try:
        problems = _again(model, text).problems
    except SpikeblocksError as error:
        return str(error)
    return problems[0].text if problems else ""


def place_of(document: Node, path: str) -> str:
    """Where a value is written: an entry ``$name`` is one of ``params``, of its part if it has one.

    In: ``blocks.pid.kp`` of ``pid: {kp: $k}``. Out: ``params.k``.
    """
    names = tuple(path.split("."))
    for _ in range(10):  # params may refer to params
        node = _at(document, names)
        text = node.value if node is not None else None
        if not isinstance(text, str) or not text.startswith("$") or not text[1:].isidentifier():
            break
        scope = next(
            (
                names[:i]
                for i in range(len(names) - 1, -1, -1)
                if _at(document, (*names[:i], "params", text[1:])) is not None
            ),
            None,
        )
        if scope is None:
            break
        names = (*scope, "params", text[1:])
    return ".".join(names)


def delete_block(document: Node, name: str) -> Node:
    """The document without a block, its wires, and all that is recorded of it alone."""
    gone = {name}
    for section in ("blocks", "wires", "probes", "plots", "metrics", *_NAMES):
        node = document.get(section)
        if node is None:
            continue
        if node.is_map:
            entries = {}
            for key, entry in node.items():
                kept = None if section in ("blocks", "wires") and key == name else entry
                if kept is not None and section != "blocks":
                    kept = _prune(kept, gone, section)
                if kept is not None:
                    entries[key] = kept
                elif section == "probes":
                    gone.add(key)
            kept = Node(entries, node.where, node.key) if entries else None
        else:
            kept = _prune(node, gone, section)
        document = document.with_item(section, kept)
    return document


def _prune(node: Node, gone: set[str], section: str) -> Node | None:
    """An entry without what mentions names that are gone; None if nothing is left."""
    if node.is_list:
        items = [kept for item in node.value if (kept := _prune(item, gone, section)) is not None]
        return Node(items, node.where, node.key) if items else None
    if not node.is_map:
        head = node.value.split(".")[0] if isinstance(node.value, str) else ""
        return None if head in gone else node
    entries, is_wires = {}, section == "wires"
    for key, inner in node.items():
        if is_wires or key in SIGNAL_KEYS or (section == "probes" and key == "events"):
            kept = _prune(inner, gone, section)
            if kept is None:
                if not is_wires:
                    return None
                continue
            inner = kept
        entries[key] = inner
    return Node(entries, node.where, node.key) if entries else None


def _again(model: Model, source: str) -> Model:
    if source == model.text.source:
        return model
    return Model(source, Path(model.path), model.surroundings, model.change)


def _without_empty(document: Node) -> Node:
    """A document without sections that have no entries, which say nothing."""
    entries = {name: node for name, node in document.items() if node.value not in ({}, [])}
    return Node(entries, document.where, document.key)


def _at(node: Node, path: Names) -> Node | None:
    found: Node | None = node
    for name in path:
        if found is not None and found.is_list:
            is_there = name.isdecimal() and int(name) < len(found.value)
            found = found.value[int(name)] if is_there else None
        else:
            found = None if found is None else found.get(name)
    return found


def _changes(old: Node, new: Node, path: Names) -> Iterator[tuple[Names, Node | None]]:
    """The entries that differ: each path with its new value, None for one that is deleted."""
    if same(old, new):
        return
    if old.is_map and new.is_map:
        for name, node in new.items():
            below = old.get(name)
            if below is None:
                yield (*path, name), node
            else:
                yield from _changes(below, node, (*path, name))
        yield from (((*path, name), None) for name in old.value if new.get(name) is None)
    else:
        yield path, new


def _item(root: YamlItem, path: Names) -> YamlItem | None:
    """The entry of a text at a path, in which numbers count the items of lists."""
    item: YamlItem | None = root
    for name in path:
        if item is not None and item.kind == "list":
            is_there = name.isdecimal() and int(name) < len(item.items)
            item = item.items[int(name)] if is_there else None
        else:
            item = None if item is None else item.get(name)
    return item


def _write(model: Model, path: Names, node: Node | None, new: Node) -> str:
    """The text with one entry set or deleted."""
    source, item = model.text.source, _item(model.root, path)
    if node is None:
        if item is not None:
            source = _apply(source, [remove_entry(model, _outermost(item))])
        # What a file below says is deleted by a null.
        after = _again(model, source)
        if not after.syntax and _at(after.document, path) is not None:
            source = _insert(after, path, "null")
        return source
    if item is None and path[0] in _NAMES and len(path) == 1 and node.is_list and node.value:
        return _apply(source, add_name(model, path[0], ", ".join(_names_in(node))))
    if item is None or item.kind == "empty":
        return _insert(model, path, flow_yaml(node.plain()))
    edits = _list_edits(model, item, node, path)
    return _apply(source, edits or [Edit(item.span, flow_yaml(node.plain()))])


def _names_in(node: Node) -> list[str]:
    return [str(each.value) for each in node.value]


def _insert(model: Model, path: Names, text: str) -> str:
    edits = add_entry(model, path[:-1], path[-1], text)
    if edits is None:
        raise UsageError(f"'{'.'.join(path)}' is not written in this file as an entry of its own")
    return _apply(model.text.source, edits)


def _outermost(item: YamlItem) -> YamlItem:
    """The entry that goes with an entry, since it has no other."""
    while (
        item.parent is not None and item.parent.parent is not None and len(item.parent.items) == 1
    ):
        item = item.parent
    return item


def _list_edits(model: Model, item: YamlItem, node: Node, path: Names) -> list[Edit]:
    """The edits of the items of a list that differ; none if the list is written anew."""
    old = _at(model.document, path)
    if item.kind != "list" or not node.is_list or old is None or not old.is_list:
        return []
    before, after = old.value, node.value
    if len(before) != len(item.items):
        return []
    if len(before) == len(after):
        return [
            Edit(where.span, flow_yaml(b.plain()))
            for where, a, b in zip(item.items, before, after, strict=True)
            if not same(a, b)
        ]
    shared = min(len(before), len(after))
    first = next((i for i in range(shared) if not same(before[i], after[i])), shared)
    if len(after) == len(before) - 1 and all(map(same, before[first + 1 :], after[first:])):
        return [remove_entry(model, item.items[first])]
    is_longer = first == len(before) and len(after) == len(before) + 1
    if is_longer and len(path) == 1 and path[0] in _NAMES:
        return add_name(model, path[0], str(after[-1].value))
    return []


def _apply(source: str, edits: list[Edit]) -> str:
    return apply_edits(source, [(edit.span, edit.new) for edit in edits])
