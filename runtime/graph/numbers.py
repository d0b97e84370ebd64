"""Numbers of a graph on which nothing but parameters of blocks depends, and blocks with others.

In: a graph whose entries at some paths were set, with the paths as origins, and its network. Out:
:class:`Numbers`, which makes the blocks for other values without building the network again::

    params: {k: 2}   blocks: {a: {gain: $k}, b: {gain: $k}}     params.k: the blocks a and b
    params: {k: 2}   blocks: {a: {gain: 2 * $k}}                None: a value is computed from k
    params: {n: 9}   blocks: {a: {neurons: $n}}                 a; but no block for n = 10, since
                                                                another plan would follow from it
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from blocks.core import Block, BlockContext, state_shape
from blocks.library.registry import is_built_in
from runtime.document import Node, Value, from_python, full_path, is_part
from runtime.errors import Where
from runtime.network import BLOCK_KEYS, Network, parameters_of


def structure(block: Block, context: BlockContext) -> tuple[str, ...]:
    """What a network and a plan read of a block; with the same, they are the same."""
    shapes = [state_shape(block, each, context) for each in block.spec.states.values()]
    ports = [(block.port_type(name), block.port_unit(name)) for name in block.spec.ports]
    edges = () if context.until is None else np.asarray(block.edges(context.until)).tolist()
    said = (block.evaluations, block.indirect, block.recalls, block.stepwise, block.jumps)
    known = (block.sizes_in(context), block.variables, block.state_names, block.couplings(context))
    found = (*said, *known, tuple(block.crossings(context)), edges, shapes, ports)
    return tuple(map(repr, found))


class _Varied:
    """A block as it is constructed again and again, with other values of some parameters.

    Parameters
    ----------
    values : that its parameters depend on, by path.
    """

    def __init__(self, network: Network, name: str, values: Mapping[str, Value]) -> None:
        entry = network.entries[name]
        self.network, self.entry, self.values = network, entry, values
        params = {key: item for key, item in entry.node.items() if key in entry.cls.spec.params}
        self.nodes = {
            key: item for key, item in params.items() if any(_has(item, *v) for v in values.items())
        }
        self.context = network.context(name)
        self.before = self._plan(entry.block)
        rest = Node({key: item for key, item in params.items() if key not in self.nodes})
        # Those of a block of a checked network are right. Settings, such as distributions, take
        # longer to read than all else.
        fixed = parameters_of(network, entry, rest) or {}
        self.fixed = fixed | {
            key: declared.convert(fixed.get(key, declared.default))
            for key, declared in entry.cls.spec.params.items()
            if declared.setting is not None and key not in self.nodes
        }

    def _plan(self, block: Block) -> object:
        return structure(block, self.context), block.stack_key(self.context)

    def block(self, values: Mapping[str, Value]) -> Block | None:
        """The block with other values; None if one is wrong, or the plan would be another one."""
        nodes = self.nodes
        for path, before in self.values.items():
            nodes = {k: _replaced(node, path, before, values[path]) for k, node in nodes.items()}
        parameters = parameters_of(self.network, self.entry, Node(nodes))
        if parameters is None:
            return None
        try:
            block = self.entry.cls(**self.fixed, **parameters)
            block.validate_in(self.context)
            return block if self._plan(block) == self.before else None
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return None  # said, with its place, by who checks the graph


@dataclass(frozen=True)
class Numbers:
    """The blocks that depend on some numbers of a graph.

    Parameters
    ----------
    network : of the graph with ``values``, by path.
    blocks : those that depend on them, with the paths whose values each has.
    """

    network: Network
    values: Mapping[str, Value]
    blocks: Mapping[str, tuple[str, ...]]
    _known: dict[str, _Varied] = field(init=False, default_factory=dict)

    @classmethod
    def of(cls, document: Node, network: Network, values: Mapping[str, Value]) -> Numbers:
        """Those of the values on which nothing depends but parameters of built-in blocks."""
        left = {p: v for p, v in values.items() if is_number(v) and _is_parameter(document, p)}
        blocks: dict[str, tuple[str, ...]] = {}
        for name, entry in network.entries.items():
            paths = tuple(path for path, value in left.items() if _has(entry.node, path, value))
            publishes = any(port.publishes for port in entry.cls.spec.outputs.values())
            if paths and (not is_built_in(entry.cls) or publishes or _is_named(network, name)):
                left = {path: value for path, value in left.items() if path not in paths}
            elif paths:
                blocks[name] = paths
        # A value that no block has belongs to one that was removed.
        used = {path for paths in blocks.values() for path in paths}
        left = {path: value for path, value in left.items() if path in used}
        blocks = {n: tuple(p for p in paths if p in left) for n, paths in blocks.items()}
        return cls(network, left, {name: paths for name, paths in blocks.items() if paths})

    def changed(self, values: Mapping[str, Value]) -> dict[str, Block] | None:
        """All blocks that depend on the numbers, for these values.

        None if one of them is wrong, or the plan would be another one.
        """
        found: dict[str, Block] = {}
        if not all(map(is_number, values.values())):
            return None
        for name, paths in self.blocks.items():
            if name not in self._known:
                own = {path: self.values[path] for path in paths}
                self._known[name] = _Varied(self.network, name, own)
            block = self._known[name].block(values)
            if block is None:
                return None
            found[name] = block
        return found


def is_number(value: Value) -> bool:
    """Whether a value is a number, or a list of numbers."""
    if isinstance(value, list):
        return all(map(is_number, value))
    return isinstance(value, (int, float)) and not isinstance(value, bool) and value == value


def _is_parameter(document: Node, path: str) -> bool:
    """Whether an entry is a parameter of a block, or a param that stands for such alone."""
    graph, names = document, full_path(document, path).split(".")
    while names[0] == "blocks" and len(names) > 2:
        entry = (graph.get("blocks") or Node({})).get(names[1])
        if entry is None or not entry.is_map:
            return False
        names = names[2:]
        if not is_part(entry):
            return names[0] not in BLOCK_KEYS
        graph = entry
    return names[0] == "params" and len(names) > 1 and _is_whole(graph, names[1])


def _is_whole(graph: Node, param: str) -> bool:
    """Whether a param is named only as a whole value inside the parameters of blocks."""
    for key, node in graph.items():
        if key == "params":
            others = (item for name, item in node.items() if name != param)
            if any(True for item in others for _ in _uses(item, param)):
                return False
        elif key == "blocks":
            if not all(_is_whole_in(entry, param) for _, entry in node.items()):
                return False
        elif any(True for _ in _uses(node, param)):
            return False
    return True


def _is_whole_in(entry: Node, param: str) -> bool:
    """The same of one entry of the section ``blocks``; names inside a part are its own."""
    if not is_part(entry):
        given = {key: list(_uses(item, param)) for key, item in entry.items()}
        return all(all(uses) for uses in given.values()) and not any(map(given.get, BLOCK_KEYS))
    for key, item in entry.items():
        if key == "params":
            for name, value in item.items():
                uses = list(_uses(value, param))
                if uses and not (all(uses) and _is_whole(entry, name)):
                    return False
        elif key != "blocks" and any(True for _ in _uses(item, param)):
            return False
    return True


def _uses(node: Node, param: str) -> Iterator[bool]:
    """For each text that names a param, whether it is nothing else."""
    used = re.compile(rf"\${param}(?!\w)")
    if isinstance(node.value, str) and used.search(node.value):
        yield node.value == f"${param}"
    if any(used.search(key) for key, _ in node.items()):
        yield False
    for item in _items(node):
        yield from _uses(item, param)


def _has(node: Node, path: str, value: Value) -> bool:
    """Whether a value that was set at a path is in a block's entry."""
    if node.where == Where(path) and node.plain() == value:
        return True
    return any(_has(item, path, value) for item in _items(node))


def _items(node: Node) -> list[Node]:
    return node.value if node.is_list else [item for _, item in node.items()]


def _replaced(node: Node, path: str, before: Value, after: Value) -> Node:
    """A block's entry with another value in place of the one that was set at a path."""
    if node.where == Where(path) and node.plain() == before:
        return Node(from_python(after, node.where).value, node.where, node.key)
    if node.is_list:
        items = [_replaced(item, path, before, after) for item in node.value]
        return Node(items, node.where, node.key)
    if node.is_map:
        entries = {key: _replaced(item, path, before, after) for key, item in node.items()}
        return Node(entries, node.where, node.key)
    return node


def _is_named(network: Network, name: str) -> bool:
    """Whether a block of the graph may ask for another one by its name, as for a plant."""
    names = {name, network.entries[name].short}
    return any(
        entry.block.value(each) in names
        for entry in network.entries.values()
        for each, declared in entry.cls.spec.params.items()
        if isinstance(entry.block.value(each), str)
    )
