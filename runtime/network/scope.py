"""Scopes of names: a graph's blocks and ports, and a scope for each of its parts.

In: the sections of a graph or part. Out: what a name in it means. A block ``snn`` of the part
``adaptive`` is ``snn`` inside, and ``adaptive.snn`` in the whole graph.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from blocks.core import TYPES, SignalType, hint, signal_type
from runtime.document import (
    Node,
    check_keys,
)
from runtime.errors import Problems, Where


@dataclass
class Scope:
    """The names of a graph or part: its blocks, parts and ports.

    ``prefix`` is put before the names inside to form those in the whole graph; ``address`` is the
    scope's in the document. ``broken`` names blocks that cannot be read, ``unread`` such
    sections: they are reported once, and addresses that lead there are not. ``seed`` is that of
    its blocks, in place of the run's.
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
        near = hint(str(declared.value), [*(own or {}), *TYPES])
        problems.add(declared.where, address, f"{error}{near}")
        return None


def is_optional(declared: Node) -> bool:
    """Whether a part's input may stay open; a value that is not a boolean counts as true."""
    node = declared.get("optional")
    # A wrong value is reported where it is read; that the input is open would be a second message.
    return node is not None and node.value is not False
