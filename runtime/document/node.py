"""YAML text as a tree in which every value has its position.

In: the text of a file. Out: a :class:`Node` for each value, or every problem up to the first
syntax error::

    parse_yaml("lqr: {q: [1, 2]}", "g.yaml").plain()                 # {'lqr': {'q': [1, 2]}}
    parse_yaml("lqr: {q: [1, 2]}", "g.yaml").get("lqr").get("q").where   # g.yaml:1:10

A strict reading of YAML 1.2: scalars by its core schema (:mod:`runtime.document.scalars`),
keys must be unique. Tags and merge keys are refused; aliases are expanded up to a limit.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any, Protocol, TypeAlias

import numpy as np
import yaml

from blocks.core import StoredArray, plain, show
from blocks.limits import GRAPH_VALUES
from blocks.messages import Message, Replace
from runtime.document.parse_errors import MAX_DEPTH, explain
from runtime.document.scalars import in_range, parse_scalar
from runtime.document.writer import dump_yaml as dump_yaml
from runtime.errors import NOWHERE, GraphError, Problem, Where

# The C parser is many times as fast, and its events are the same.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
MAX_NODES = GRAPH_VALUES


class Array(Protocol):
    """An array or a number of NumPy."""

    def tolist(self) -> object:
        """Its values in plain Python."""


# What a graph's text can say, in Python.
Value: TypeAlias = "bool | int | float | str | Array | Sequence[Value] | Mapping[str, Value] | None"

_MISSING_SPACE = re.compile(r"\w+:\S.*")


@dataclass(frozen=True, slots=True)
class Node:
    """A value in the tree: a scalar, a list of nodes, or a mapping from text to nodes.

    ``where`` is the position of the value, ``key`` that of its key. Trees are never changed in
    place; edits share what they do not change.
    """

    value: Any
    where: Where = NOWHERE
    key: Where = field(default=NOWHERE)

    @property
    def is_map(self) -> bool:
        return isinstance(self.value, dict)

    @property
    def is_list(self) -> bool:
        return isinstance(self.value, list)

    def get(self, name: str) -> Node | None:
        """A mapping's entry, or None."""
        entry = self.value.get(name) if self.is_map else None
        return entry if isinstance(entry, Node) else None

    def items(self) -> Iterable[tuple[str, Node]]:
        return self.value.items() if self.is_map else ()

    def plain(self) -> Any:
        """The tree as plain Python dicts, lists and scalars."""
        if self.is_map:
            return {key: node.plain() for key, node in self.items()}
        if self.is_list:
            return [node.plain() for node in self.value]
        return self.value

    def with_item(self, name: str, node: Node | None) -> Node:
        """The mapping with one entry set, or deleted where ``node`` is None."""
        entries = dict(self.value) if self.is_map else {}
        if node is None:
            entries.pop(name, None)
        else:
            entries[name] = node
        return Node(entries, self.where, self.key)

    def describe(self) -> str:
        """The value, or what kind it is, for messages."""
        return show(self.plain() if not self.is_map else {})


def from_python(value: Any, where: Where = NOWHERE) -> Node:
    """A tree from plain Python values; every node has the position ``where``.

    Raises
    ------
    GraphError : a value that YAML cannot represent, or nesting that is too deep.
    """
    return _from_python(value, where, "", 0, count(1))


def _from_python(value: Any, where: Where, address: str, depth: int, counter: count[int]) -> Node:
    def refuse(message: str) -> GraphError:
        return GraphError([Problem(where, address[:60], message)])

    if depth > MAX_DEPTH:
        raise refuse(f"nested more than {MAX_DEPTH} deep")
    if next(counter) > MAX_NODES:
        raise refuse(f"more than {MAX_NODES} values")
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiu":
        value = plain(value)
    if isinstance(value, StoredArray):
        return Node(value, where, where)
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        entries = {}
        for key, item in value.items():
            if not isinstance(key, str) or not _is_unicode(key):
                raise refuse(f"expected a string as key, got {show(key)}")
            inner = f"{address}.{key}".lstrip(".")
            entries[key] = _from_python(item, where, inner, depth + 1, counter)
        return Node(entries, where, where)
    if isinstance(value, (list, tuple)):
        items = [
            _from_python(item, where, f"{address}[{i}]", depth + 1, counter)
            for i, item in enumerate(value)
        ]
        return Node(items, where, where)
    if isinstance(value, int) and not isinstance(value, bool):
        try:
            in_range(value)
        except ValueError as error:
            raise refuse(str(error)) from None
    elif value is not None and not isinstance(value, (bool, float, str)):
        raise refuse(f"expected a number, string, list or mapping, got {type(value).__name__}")
    elif isinstance(value, str) and not _is_unicode(value):
        raise refuse("a string with a lone surrogate, which is not a character")
    return Node(value, where, where)


def _is_unicode(text: str) -> bool:
    return text.isascii() or not any("\ud800" <= c <= "\udfff" for c in text)


def parse_yaml(text: str, file: str) -> Node:
    """Read one YAML document.

    Raises
    ------
    GraphError : the first syntax error, and every duplicate key, tag and number out of range
        before it; or there is no document.
    """
    reader = _Reader(file)
    try:
        # Events, not yaml.load or compose: these drop duplicate keys or build Python objects from
        # tags.
        root = reader.document(iter(yaml.parse(text, Loader=_LOADER)))
    except (yaml.YAMLError, UnicodeError) as error:
        reader.problems.append(explain(error, text, file))
        root = None
    if root is None and not reader.problems:
        reader.problems.append(Problem(Where(file), "", "the file is empty"))
    if root is None or reader.problems:
        raise GraphError(reader.problems)
    return root


class _Reader:
    """Builds the tree from libyaml's events."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[Problem] = []
        self.anchors: dict[str, Node | None] = {}
        self.sizes: dict[int, int] = {}
        self.count = 0

    def where(self, event: Any) -> Where:
        mark = event.start_mark
        return Where(self.file, mark.line + 1, mark.column + 1)

    def note(self, event: Any, address: str, message: str) -> None:
        self.problems.append(Problem(self.where(event), address[:200], message))

    def stop(self, event: Any, address: str, message: str) -> GraphError:
        """The error that ends reading, with all problems found before."""
        self.note(event, address, message)
        return GraphError(self.problems)

    def document(self, events: Iterator[Any]) -> Node | None:
        root: Node | None = None
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                if root is not None:
                    raise self.stop(event, "", "a second document; expected one per file")
                root = self.node(next(events), events, NOWHERE, 0, "")
        return root

    def node(
        self, event: Any, events: Iterator[Any], key: Where | None, depth: int, address: str
    ) -> Node:
        where = self.where(event)
        # An item of a list has the place of its value: one object for both, since a list is long.
        key = where if key is None else key
        if depth > MAX_DEPTH:
            raise self.stop(event, "", f"nested more than {MAX_DEPTH} deep")
        self.count += 1
        if self.count > MAX_NODES:
            message = f"more than {MAX_NODES} values in one file; name arrays as my.npz#w"
            raise self.stop(event, address, message)
        if isinstance(event, yaml.AliasEvent):
            return self.alias(event, where, key, address)
        if event.anchor:
            # None until the value is complete: an alias inside of it would refer to itself.
            self.anchors[event.anchor] = None
        before = self.count
        if isinstance(event, yaml.ScalarEvent):
            node = Node(self.scalar(event, address), where, key)
        elif isinstance(event, yaml.SequenceStartEvent):
            self.refuse_tag(event, address)
            node = Node(self.sequence(events, depth, address), where, key)
        else:
            self.refuse_tag(event, address)
            node = Node(self.mapping(events, depth, address), where, key)
        if event.anchor:
            self.anchors[event.anchor] = node
            # An alias counts as all that it stands for, though it shares the tree: ten lines of ten
            # aliases each are 10^10 values once written out.
            self.sizes[id(node)] = self.count - before + 1
        return node

    def refuse_tag(self, event: Any, address: str) -> None:
        if event.tag and event.tag != "!":
            tag = event.tag.replace("tag:yaml.org,2002:", "!!")
            self.note(event, address, f"tag '{tag}': a graph contains plain data only; remove it")

    def scalar(self, event: Any, address: str) -> Any:
        self.refuse_tag(event, address)
        # Quotes make a string of anything: '1e-3' is text.
        if not event.implicit[0] or event.tag:
            return event.value
        try:
            return parse_scalar(event.value)
        except ValueError as error:
            # Reading goes on with any value, so that all such numbers are reported at once.
            self.note(event, address, f"{event.value[:40]} is {error}")
            return 0

    def alias(self, event: Any, where: Where, key: Where, address: str) -> Node:
        target = self.anchors.get(event.anchor)
        if target is None:
            inside = event.anchor in self.anchors
            message = "refers to itself" if inside else "is not defined above"
            raise self.stop(event, address, f"alias '*{event.anchor}' {message}")
        self.count += self.sizes[id(target)]
        if self.count > MAX_NODES:
            raise self.stop(event, address, f"aliases expand to more than {MAX_NODES} values")
        return Node(target.value, where, key)

    def sequence(self, events: Iterator[Any], depth: int, address: str) -> list[Node]:
        items: list[Node] = []
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            inner = f"{address}[{len(items)}]"
            items.append(self.node(event, events, None, depth + 1, inner))
        return items

    def mapping(self, events: Iterator[Any], depth: int, address: str) -> dict[str, Node]:
        entries: dict[str, Node] = {}
        while not isinstance(event := next(events), yaml.MappingEndEvent):
            name = self.key(event, events, depth, address)
            inner = f"{address}.{name}".lstrip(".")
            following = next(events)
            value = self.node(following, events, self.where(event), depth + 1, inner)
            if name in entries:
                first = entries[name].key.line
                message = f"duplicate key, first in line {first}; keep one"
                if inner.startswith("wires.") and inner.count(".") == 2:
                    message += "; to add two signals, wire both to a Sum: {terms: [a.out, b.out]}"
                self.note(event, inner, message)
            # {gain:2} is a key 'gain:2' without a value for YAML.
            elif _MISSING_SPACE.fullmatch(name) and getattr(following, "value", None) == "":
                before, _, after = name.partition(":")
                text = f"a space is missing after the colon: {before}: {after}"
                fix = Replace(f"{before}: ", f"{before}:", "Insert the space")
                self.note(event, address, Message(text, "invalid-yaml", [fix]))
            # The first of two equal keys stays: the second is the reported one.
            entries.setdefault(name, value)
        return entries

    def key(self, event: Any, events: Iterator[Any], depth: int, address: str) -> str:
        if not isinstance(event, yaml.ScalarEvent):
            self.node(event, events, NOWHERE, depth + 1, address)
            self.note(event, address, "a key must be a string")
            return ""
        self.refuse_tag(event, address)
        name = str(event.value)
        if event.anchor:
            self.anchors[event.anchor] = node = Node(name, self.where(event))
            self.sizes[id(node)] = 1
        if event.implicit[0] and name == "":
            self.note(event, address, "a key must be a string")
        if event.implicit[0] and name == "<<":
            message = "YAML 1.2 has no merge keys; write the entries out, or use extends"
            self.note(event, address, message)
        return name
