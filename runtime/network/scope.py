"""Scopes of names: a graph's blocks and ports, and a scope for each of its parts.

In: the sections of a graph or part. Out: what a name in it means. A block ``snn`` of the part
``adaptive`` is ``snn`` inside, and ``adaptive.snn`` in the whole graph.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from runtime.document import Node
from runtime.errors import Where

# Before the names of blocks that stand for inputs: "inputs.push", and "pid.inputs.limit" in a part.
INPUTS = "inputs."


@dataclass
class Scope:
    """The names of a graph or part: its blocks, parts and ports.

    ``prefix`` is put before the names inside to form those in the whole graph; ``address`` is the
    scope's in the document. ``broken`` names blocks that cannot be read, ``unread`` such
    sections: they are reported once, and addresses that lead there are not. ``seed`` is that of
    its blocks, in place of the run's. ``params`` are the names of those of the graph and of the
    graphs around it. ``holds_copies`` tells whether it is what stands around the copies of a
    repeated part: these, and the blocks that gather their outputs. ``is_file_of_part`` tells that
    what is outside of the outermost scope is not there, since the file of a part is checked alone.
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
    defaults: dict[str, Node] = field(default_factory=dict)
    where: Where = field(default_factory=Where)
    seed: int | None = None
    params: frozenset[str] = frozenset()
    holds_copies: bool = False
    is_file_of_part: bool = False
    broken: set[str] = field(default_factory=set)
    unread: set[str] = field(default_factory=set)

    @property
    def is_graph(self) -> bool:
        """Whether it is a whole graph, and no part."""
        return self.parent is None and not self.is_file_of_part

    def names(self) -> list[str]:
        return [*self.blocks, *self.parts]

    def block_names(self) -> list[str]:
        """The names of blocks inside, those that stand for inputs first."""
        return [*(INPUTS + name for name in self.inputs if self.own_value(name)), *self.blocks]

    def walk(self) -> Iterator[Scope]:
        """This scope and all below it."""
        yield self
        for part in self.parts.values():
            yield from part.walk()

    @property
    def plain_prefix(self) -> str:
        """The prefix without the copies that it leads through: ``robots.`` in each robot."""
        if self.parent is None or self.parent.holds_copies:
            return self.prefix if self.parent is None else self.parent.plain_prefix
        return f"{self.parent.plain_prefix}{self.name}."

    def all_names(self) -> list[str]:
        """Full names of all blocks and parts; those in a repeated part stand for all copies."""
        scopes = (scope for scope in self.walk() if not scope.holds_copies)
        names = (scope.plain_prefix + name for scope in scopes for name in scope.names())
        return list(dict.fromkeys(names))

    def path(self, section: str, name: str) -> str:
        """The document address of an entry: ``blocks.adaptive.wires.snn_v``."""
        return ".".join(part for part in (self.address, section, name) if part)

    def own_value(self, port: str) -> str:
        """The block that stands for an input to which nothing is wired; '' if none does: something
        is wired to it, or it has no default and may, or must not, be open."""
        declared = self.inputs.get(port)
        # An input of the whole graph that lacks a default is one error; its readers have a source.
        if declared is None:
            return ""
        # What is wired to an input of a part from outside is not there in a check of its file.
        is_given = self.is_file_of_part or not is_optional(declared)
        if not ((self.parent is None and is_given) or has_default(declared)):
            return ""
        wires = self.parent.wires.get(self.name) if self.parent is not None else None
        is_wired = wires is not None and (not wires.is_map or wires.get(port) is not None)
        return "" if is_wired else f"{self.prefix}{INPUTS}{port}"

    def path_of(self, block: str) -> str:
        """The document address of a block, of those that stand for inputs included."""
        return self.path("" if block.startswith(INPUTS) else "blocks", block)


def output_address(node: Node) -> Node:
    """The address of an entry of ``outputs``, which may have other keys beside it."""
    return (node.get("of") or Node(None, node.where, node.key)) if node.is_map else node


def has_default(declared: Node) -> bool:
    """Whether an input has a value if nothing is wired to it."""
    node = declared.get("default") if declared.is_map else None
    return node is not None and node.value is not None


def is_optional(declared: Node) -> bool:
    """Whether a part's input may stay open; a value that is not a boolean counts as true."""
    node = declared.get("optional")
    # A wrong value is reported where it is read; that the input is open would be a second message.
    return node is not None and node.value is not False
