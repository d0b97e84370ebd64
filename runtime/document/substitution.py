"""Substitution of ``$names`` by the values of ``params``; nothing is evaluated.

In: a graph or part and its params. Out: the same tree with values in place of names, each with the
position of the param, where a wrong value has to be corrected::

    params: {v: 1.5}   blocks: {lqr: {v_r: $v}}    ->    blocks: {lqr: {v_r: 1.5}}
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from blocks.core import hint
from runtime.document.limits import Work
from runtime.document.node import Node
from runtime.document.sections import SECTIONS, expected_form, is_part, misspelt_keys
from runtime.errors import Problems

_NAME = re.compile(r"\$([A-Za-z_]\w*)")


def fill_sections(
    document: Node, declared: Node | None, address: str, problems: Problems, work: Work
) -> Node:
    """A graph with every ``$name`` replaced by the value of its param.

    Parameters
    ----------
    declared : the section ``params``; for a part with the values given, already filled in.
    address : of the graph in the document: '' or ``blocks.adaptive``.
    """
    prefix = f"{address}." if address else ""
    # With 'param:' for 'params:' every name would be unknown; the misspelling is reported alone.
    params: dict[str, Node] | None = None if "params" in misspelt_keys(document, SECTIONS) else {}
    if declared is not None and declared.value is not None:
        params = dict(declared.items()) if declared.is_map else None
        if params is None:
            message = f"{expected_form('params')}, got {declared.describe()}"
            problems.add(declared.where, f"{prefix}params", message)
    filler = _Filler(params, problems, work)
    if not address:
        filler.refuse_nested()
    for name, node in document.items():
        if name not in ("params", "part"):
            fill = filler.blocks if name == "blocks" else filler.fill
            document = document.with_item(name, fill(node, f"{prefix}{name or repr(name)}"))
    for name, node in (params or {}).items():
        # An unused 'gain' and an unknown '$gian' are one mistake, reported at the name.
        if name not in filler.used and not hint(name, filler.missing):
            suggestion = hint(name, filler.used) or "; remove it, or write it as a value"
            problems.add(node.key, f"{prefix}params.{name}", f"${name} is not used{suggestion}")
    return document


def without_unused(before: Node, after: Node, address: str = "") -> tuple[Node, list[str]]:
    """A graph after a change, without the params that only what was replaced has used.

    A file in which a param is not used is wrong; a change that makes one unused is not::

        lqr: {q: $q}  --set lqr.q=1  lqr: {q: 1}      'q' is left out of params

    Returns
    -------
    tuple : the graph, and a note for each param that was left out, at every depth.
    """
    notes = []
    blocks, old = (each.get("blocks") or Node({}) for each in (after, before))
    for name, entry in blocks.items():
        old_entry = old.get(name)
        # What was not changed is the same object.
        if old_entry is not None and old_entry is not entry and is_part(entry):
            inner = f"{address}.{name}".lstrip(".")
            part, more = without_unused(old_entry, entry, inner)
            notes += more
            blocks = blocks.with_item(name, part) if more else blocks
    if notes:
        after = after.with_item("blocks", blocks)
    declared = after.get("params")
    params = [name for name, _ in declared.items()] if declared is not None else []
    used = _references_of(after) if params else set()
    unused = set(params) - used
    for name in sorted(unused & _references_of(before) if unused else ()):
        declared = declared.with_item(name, None) if declared is not None else None
        place = f"{address}.params.{name}".lstrip(".")
        notes.append(f"{place} is left out: nothing uses ${name} after the change")
    return after if not unused else after.with_item("params", declared), notes


def _references_of(graph: Node) -> set[str]:
    """The params that a graph refers to; inside a part, names are its own."""
    nodes = []
    for key, node in graph.items():
        if key == "blocks":
            for entry in dict(node.items()).values():
                inside = (entry.get(each) for each in ("params", "repeat", "share"))
                nodes += [n for n in inside if n is not None] if is_part(entry) else [entry]
        elif key not in ("params", "part"):
            nodes.append(node)
    return {item.value[1:] for node in nodes for item in _references(node)}


def _references(node: Node) -> Iterator[Node]:
    if isinstance(node.value, str) and _NAME.fullmatch(node.value):
        yield node
    for item in node.value if node.is_list else [n for _, n in node.items()]:
        yield from _references(item)


class _Filler:
    """Replaces ``$names``; ``params`` is None where they cannot be read."""

    def __init__(self, params: dict[str, Node] | None, problems: Problems, work: Work) -> None:
        self.params = params
        self.work = work
        self.problems = problems
        self.used: set[str] = set()
        self.missing: set[str] = set()
        # With the values, since an id is unique only while its object exists.
        self._known: dict[int, tuple[object, bool]] = {}

    def _has_references(self, node: Node) -> bool:
        """Whether a value holds another param; a shared part of it is looked through once."""
        if not isinstance(node.value, (dict, list)):
            return any(_references(node))
        entry = self._known.get(id(node.value))
        if entry is None:
            items = node.value if node.is_list else [item for _, item in node.items()]
            entry = node.value, any(map(self._has_references, items))
            self._known[id(node.value)] = entry
        return entry[1]

    # Params in params would need an order, and could be circular; a part's params may name those of
    # the graph around it, which are filled in before the part is opened.
    def refuse_nested(self) -> None:
        for name, node in (self.params or {}).items():
            for bad in _references(node):
                self.used.add(bad.value[1:])
                message = f"'{bad.value}': the values of params cannot be other params"
                self.problems.add(bad.where, f"params.{name}", message)

    def blocks(self, node: Node, address: str) -> Node:
        """The section ``blocks``; the inside of a part uses the part's own params."""
        if not node.is_map:
            return self.fill(node, address)
        entries = dict(node.items())
        for name, entry in node.items():
            inner = f"{address}.{name}"
            if not is_part(entry):
                entries[name] = self.fill(entry, inner)
                continue
            for key in ("params", "repeat", "share"):
                if (node_of_key := entry.get(key)) is not None:
                    value = self.fill(node_of_key, f"{inner}.{key}")
                    self.work.check(value, node_of_key.where, f"{inner}.{key}")
                    entries[name] = entries[name].with_item(key, value)
        return Node(entries, node.where, node.key)

    def fill(self, node: Node, address: str) -> Node:
        if node.is_map:
            entries = {name: self.fill(item, f"{address}.{name}") for name, item in node.items()}
            return Node(entries, node.where, node.key)
        if node.is_list:
            items = [self.fill(item, f"{address}[{i}]") for i, item in enumerate(node.value)]
            return Node(items, node.where, node.key)
        match = _NAME.fullmatch(node.value) if isinstance(node.value, str) else None
        return node if match is None else self.value(match[1], node, address)

    def value(self, name: str, node: Node, address: str) -> Node:
        """The value of a param, with the position where it is written, not where it is used."""
        param = (self.params or {}).get(name)
        if param is not None and param.value is not None:
            self.used.add(name)
            self.work.substitute(name, param, node.where, address)
            # Reported by refuse_nested: what the value does to its block is no news.
            if self._has_references(param):
                self.problems.silence(param.where, address)
            return Node(param.value, param.where, node.key)
        if param is not None:
            self.used.add(name)
            self.problems.add(param.key, address, f"param '{name}' has no value")
        elif self.params is not None:
            self.missing.add(name)
            known = hint(name, self.params) or f"; params: {', '.join(self.params) or 'none'}"
            self.problems.add(node.where, address, f"there is no param '{name}'{known}")
        self.problems.silence(node.where, address)
        return node
