"""Changes to a graph's document: an entry set, a wire moved, a block added or left out.

In: a tree and a change. Out: a new tree, in which only the nodes on the way to the entry are new::

    set_entry(document, "lqr.q", [1, 1])            # --set lqr.q=[1, 1]
    set_wire(document, "lqr.error", "error.state")  # --wire lqr.error=error.state
    add_names(document, "without", ("adaptive",))   # --without adaptive
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from blocks.core import hint, misspelt
from blocks.messages import suggestion
from runtime.document.arrays import array_values
from runtime.document.limits import Work
from runtime.document.loader import TYPED, is_of_another_kind
from runtime.document.node import Node, from_python
from runtime.document.parse_errors import MAX_DEPTH
from runtime.document.sections import PART_SECTIONS, SECTIONS
from runtime.errors import GraphError, Problem, Problems, UsageError, Where

# New entries may be added to these; blocks and run have fixed keys.
OPEN_SECTIONS = ("run", "params", "wires", "probes", "plots", "metrics")


@dataclass(frozen=True)
class Override:
    """One change to a loaded graph: ``set lqr.q=[1, 1]``, ``without adaptive``, ``with own.yaml``.

    ``kind`` is the method that made it, ``target`` the entry, block or file that it names, and
    ``value`` what was given for it, as text. A run's manifest holds the printed form.
    """

    kind: str
    target: str
    value: str | None = None

    def __str__(self) -> str:
        return f"{self.kind} {self.target}" + ("" if self.value is None else f"={self.value}")

    @classmethod
    def parse(cls, text: str) -> Override:
        """The change that a manifest holds in printed form."""
        kind, _, rest = text.partition(" ")
        if kind not in ("set", "wire", "replace"):
            return cls(kind, rest)
        target, equals, value = rest.partition("=")
        return cls(kind, target, value if equals else None)


def set_entry(document: Node, path: str, value: Any, origin: str = "") -> Node:
    """The document with one entry changed; ``None`` deletes the entry.

    Parameters
    ----------
    value : plain, or a node that keeps the positions where it was read.
    path : as in the file: ``blocks.lqr.q``, ``run.until``, ``params.v_r``; each ``blocks.``
        may be left out, and a number counts the items of a list from 0.
    origin : where the change was written, for messages about the value.

    Raises
    ------
    GraphError : the path does not exist.
    """
    where = Where(origin or f"set {path}")
    names = path.strip().split(".")
    if "" in names:
        message = f"'{path}' is not a path; expected one such as blocks.lqr.q"
        raise GraphError([Problem(where, "", message)])
    if len(names) > MAX_DEPTH:
        raise GraphError([Problem(where, "", f"a path of more than {MAX_DEPTH} names")])
    blocks = names_in(document)
    if names[0] not in SECTIONS and names[0] not in blocks:
        text, other = f"there is no '{names[0]}' in the graph", f"; expected {', '.join(SECTIONS)}"
        elsewhere = _elsewhere(document, names[0])
        known = () if elsewhere else (*SECTIONS, *blocks)
        message = misspelt("unknown-name", text, names[0], known, elsewhere or other)
        raise GraphError([Problem(where, path, message)])
    if names in (["blocks"], ["wires"]):
        raise GraphError([Problem(where, path, f"name an entry, as in {names[0]}.NAME.KEY")])
    # lqr=PID would put a word where a block's mapping is; what is meant is another type.
    if isinstance(value, str) and names[-1] in blocks and names[:-1] in ([], ["blocks"]):
        message = f"expected a parameter, as in {names[-1]}.KEY; a block of another type takes the "
        message += f"place of this one with --replace {names[-1]}={value}"
        raise GraphError([Problem(where, path, message)])
    node = value if value is None or isinstance(value, Node) else from_python(value, where)
    if node is not None:
        problems = Problems()
        node = array_values(node, path, problems, Work(problems))
        problems.raise_any()
    return _set(document, _with_blocks(document, names, SECTIONS), node, path, where)


def _elsewhere(document: Node, name: str) -> str:
    """Where a graph has an entry of that name: in ``params``, ``inputs`` or a block."""
    params, blocks = document.get("params"), document.get("blocks")
    places = []
    if params is not None and params.get(name) is not None:
        places.append(f"params.{name}")
    inputs = document.get("inputs")
    if inputs is not None and inputs.get(name) is not None:
        places.append(f"inputs.{name}.default")
    if blocks is not None:
        places += [f"{block}.{name}" for block, entry in blocks.items() if entry.get(name)]
    return suggestion(places[:3])


def full_path(document: Node, path: str) -> str:
    """A path with every ``blocks.`` written out, so that paths of the same entry are equal."""
    return ".".join(_with_blocks(document, path.strip().split("."), SECTIONS))


def names_in(node: Node | None) -> list[str]:
    """Names of the blocks and parts of a graph or part."""
    blocks = node.get("blocks") if node is not None else None
    return [name for name, _ in blocks.items()] if blocks is not None else []


def _with_blocks(node: Node | None, names: list[str], own: Any) -> list[str]:
    """A path with the ``blocks.`` that were left out."""
    if not names:
        return []
    blocks = node.get("blocks") if node is not None else None
    if names[0] == "blocks" and len(names) > 1:
        names = names[1:]
    elif names[0] in own or names[0] not in names_in(node):
        return names
    below = blocks.get(names[0]) if blocks is not None else None
    return ["blocks", names[0], *_with_blocks(below, names[1:], PART_SECTIONS)]


def _set(node: Node, names: list[str], value: Node | None, path: str, where: Where) -> Node:
    name, rest = names[0], names[1:]
    if node.is_list:
        if not name.isdecimal() or int(name) >= len(node.value):
            message = f"'{name}' is not an item of a list of {len(node.value)}; items count from 0"
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
        # The position of the key stays that in the file: messages about a block point there.
        key = where if below is None else below.key
        return node.with_item(name, None if value is None else Node(value.value, value.where, key))
    if below is None:
        if rest[0].isdecimal():
            message = f"'{name}' is not written in the graph; set the whole list"
            raise GraphError([Problem(where, path, message)])
        if name not in OPEN_SECTIONS and path.split(".")[0] not in OPEN_SECTIONS:
            known = [key for key, _ in node.items()]
            other = f"; there are {', '.join(known) or 'none'}"
            message = misspelt("unknown-name", f"there is no '{name}'", name, known, other)
            raise GraphError([Problem(where, path, message)])
        # params.new=1 in a graph without params.
        below = Node({}, where, where)
    return node.with_item(name, _set(below, rest, value, path, where))


def set_wire(document: Node, consumer: str, source: Any, origin: str = "") -> Node:
    """The document with one input connected to another source.

    Parameters
    ----------
    consumer : ``block.input``, ``part.block.input``, or ``block.input.1`` for one of several terms.

    Raises
    ------
    UsageError, GraphError : there is no such consumer.
    """
    names = consumer.strip().split(".")
    if names[0] == "wires" and "wires" not in names_in(document):
        names = names[1:]
    if "" in names or len(names) < 2:
        prefix = f"{origin}: " if origin else ""
        raise UsageError(
            f"{prefix}expected consumer.input=producer.output, as in lqr.error=error.state, "
            f"got '{consumer}'"
        )
    path: list[str] = []
    scope: Node | None = document
    # part.block.input: each name but the last two is a part, whose wires are its own.
    while len(names) > 2 and scope is not None:
        blocks = scope.get("blocks")
        scope = blocks.get(names[0]) if blocks is not None else None
        if not names_in(scope):
            break
        path += ["blocks", names.pop(0)]
    return set_entry(document, ".".join([*path, "wires", *names]), source, origin)


def add_names(document: Node, section: str, names: tuple[str, ...], origin: str = "") -> Node:
    """The document with names added to ``without`` or ``bypass``.

    Raises
    ------
    UsageError : a command line names no block.
    """
    if origin and not names:
        raise UsageError(f"{origin.strip()}: expected a block's name")
    where = Where(origin or section)
    old = document.get(section)
    items = [] if old is None or old.value is None else old.value if old.is_list else [old]
    names_before = {item.value for item in items if isinstance(item.value, str)}
    added = [Node(name, where, where) for name in names if name not in names_before]
    return document.with_item(section, Node([*items, *added], where, where))


def add_entry(document: Node, section: str, name: str, entry: Any) -> Node:
    """The document with an entry of a section added or replaced."""
    entries = document.get(section) or Node({})
    return document.with_item(section, entries.with_item(name, from_python(entry)))


def add_block(document: Node, name: str, entry: dict[str, Any]) -> Node:
    """The document with a block added.

    Raises
    ------
    UsageError : there is a block of that name.
    """
    if name in names_in(document):
        raise UsageError(f"there is a block '{name}' already; every block needs its own name")
    return add_entry(document, "blocks", name, entry)


def add_wire(document: Node, source: str, target: str, is_variadic: bool) -> Node:
    """The document with a wire added; a variadic input keeps those that it has.

    Raises
    ------
    UsageError : the target's block does not exist, or the input takes one wire and has it.
    """
    block, _, port = target.partition(".")
    if block not in names_in(document):
        near = hint(block, names_in(document))
        raise UsageError(
            f"there is no block '{block}' to connect '{source}' to{near or ';'} "
            "a graph never changes: keep what add() returns, as in graph = graph.add(...)"
        )
    old = ((document.get("wires") or Node({})).get(block) or Node({})).get(port)
    if is_variadic:
        before = [] if old is None else old.plain()
        return set_wire(
            document, target, [*(before if isinstance(before, list) else [before]), source]
        )
    if old is not None:
        raise UsageError(f"'{target}' is wired to '{old.plain()}' already; use wire() to move it")
    return set_wire(document, target, source)


# What one document changes in another one, as the document that is merged over it:
#     old   blocks: {a: {type: Gain, gain: 1}, b: {type: Sine}}
#     new   blocks: {a: {type: Gain, gain: 2}}
#     difference    blocks: {a: {gain: 2}, b: null}
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
