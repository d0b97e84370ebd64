"""Addresses in a graph: ``plant.pose.theta``, ``adaptive.command``, ``snn.spikes``.

In: an address and the scope in which it is written. Out: the block, port and component at its end,
followed through the ports of parts::

    adaptive.command             with outputs: {command: join.out} in the part 'adaptive'
    -> Endpoint("adaptive.join", "out")
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from blocks.core import misspelt
from blocks.messages import Message, message_of
from runtime.document import Node
from runtime.errors import Location
from runtime.network.scope import Scope, output_address

# More than an address can pass: parts nest up to 50 deep, each with an input and an output.
MAX_HOPS = 100
_BRACKETS = re.compile(r"([^\[\]]+)\[([^\[\]]*)\]")
# What is meant as a component, and the ranges that are one: 0:2 and :2, but not 00:2.
_RANGE = re.compile(r"(0|[1-9][0-9]{0,8})?:(0|[1-9][0-9]{0,8})?")
_INDEX = re.compile(r"[0-9]+|[0-9]*:[0-9]*", re.ASCII)


@dataclass(frozen=True)
class Endpoint:
    """One port or state of one block, or one component of it."""

    block: str
    port: str
    component: str = ""

    def __str__(self) -> str:
        if ":" in self.component:
            return f"{self.block}.{self.port}[{self.component}]"
        return ".".join(part for part in (self.block, self.port, self.component) if part)


@dataclass(frozen=True)
class ResolvedAddress:
    """What an address refers to.

    ``via`` names the inputs of parts that it passes, the nearest first; ``location`` is that of
    the text that names the block, if it is not the address itself.
    """

    end: Endpoint
    via: tuple[str, ...] = ()
    location: Location | None = None


class AddressError(ValueError):
    """An address that does not exist; ``location`` as in :class:`ResolvedAddress`."""

    location: Location | None = None

    @property
    def message(self) -> Message:
        """What is wrong with it."""
        return message_of(self)


class ReportedError(AddressError):
    """An address of something that is wrong, which is reported elsewhere."""


class UnwiredError(AddressError):
    """An address of a part's input to which nothing is wired."""

    def __init__(self, scope: Scope, port: str) -> None:
        self.scope, self.port = scope, port
        own = scope.parent is None  # an input of the whole graph
        name = f"inputs.{port}" if own else f"{scope.prefix}{port}"
        super().__init__(f"'{name}' has no default" if own else f"nothing is wired to '{name}'")


def find(scope: Scope, text: str, depth: int = 0) -> ResolvedAddress:
    """Follow an address, through parts and their ports, to a block.

    The port is '' where the address names a block alone.

    Raises
    ------
    AddressError : the message names what does not exist, and similar names.
    """
    names = _split(text)
    if "" in names or depth > MAX_HOPS:
        message = "leads through parts in a circle" if depth else "is not an address"
        raise AddressError(Message(f"'{text}' {message}; expected block.output", "unknown-block"))
    start = scope
    while len(names) > 1 and names[0] in scope.parts:
        scope = scope.parts[names.pop(0)]
    head, rest = names[0], names[1:]
    # From outside, 'part.k' and 'part.k[1]' are the output k, even if a block inside is named k; so
    # are 'k' and 'k[1]' of the whole graph.
    is_output = (scope is not start or scope.is_graph) and head in scope.outputs
    if head in scope.blocks and not (is_output and all(map(_INDEX.fullmatch, rest))):
        target = ResolvedAddress(Endpoint(scope.prefix + head, rest[0] if rest else ""))
        return _component(target, rest[1:], text)
    # Reported where the block is written; what the address would be is not known.
    if head in scope.broken:
        raise ReportedError
    if head == "inputs" and scope is start:
        return _from_outside(scope, rest, text, depth)
    if is_output:
        address = scope.path("outputs", head)
        return _component(
            _hop(scope, output_address(scope.outputs[head]), address, depth), rest, text
        )
    # The name may well be in a section that could not be read.
    if "blocks" in scope.unread or (scope is not start and "outputs" in scope.unread):
        raise ReportedError
    raise AddressError(_missing(start, scope, head))


def _split(text: str) -> list[str]:
    """The names in an address; ``a.out[1]`` and ``a.out[0:2]`` end in a component.

    Raises
    ------
    AddressError : what is in brackets is no component.
    """
    match = _BRACKETS.fullmatch(text)
    if match is None:
        return text.split(".")
    inner = match[2].replace(" ", "")
    if not _INDEX.fullmatch(inner):
        message = f"'{text}': expected a number or a range in brackets, as in [1] or [0:2]"
        raise AddressError(Message(message, "unknown-output"))
    return [*match[1].split("."), inner]


def _component(target: ResolvedAddress, rest: list[str], text: str) -> ResolvedAddress:
    if not rest:
        return target
    if len(rest) > 1 or (target.end.component and not is_range(target.end.component)):
        message = f"'{text}' has too many parts; expected block.output.component"
        raise AddressError(Message(message, "unknown-output"))
    return replace(target, end=replace(target.end, component=within(target.end.component, rest[0])))


def is_range(component: str) -> bool:
    """Whether a component is a range, such as ``0:2``."""
    return ":" in component


def bounds(component: str) -> tuple[int, int | None] | None:
    """The ends of a range, None for one that is open; None if it is no range."""
    match = _RANGE.fullmatch(component)
    return None if match is None else (int(match[1] or 0), int(match[2]) if match[2] else None)


def within(outer: str, inner: str) -> str:
    """The component of a signal that ``inner`` is of its component ``outer``.

    ``within("2:6", "1:3")`` is ``3:5``, and ``within("2:6", "1")`` is ``3``.
    """
    if not outer or not inner:
        return outer or inner
    ends = bounds(outer)
    if ends is None:
        return outer
    first, last = ends
    if not is_range(inner):
        return str(first + int(inner)) if inner.isdecimal() else inner
    low, _, high = inner.partition(":")
    end = first + int(high) if high else "" if last is None else last
    return f"{first + int(low or 0)}:{end}"


def relative(outer: str, component: str) -> str:
    """The inverse of :func:`within`: ``relative("2:6", "3:5")`` is ``1:3``."""
    ends = bounds(outer)
    if not outer or component == outer or ends is None:
        return component if not outer else ""
    if not is_range(component):
        return str(int(component) - ends[0]) if component.isdecimal() else component
    low, _, high = component.partition(":")
    return f"{int(low) - ends[0]}:{int(high) - ends[0] if high else ''}"


def _hop(scope: Scope, node: Node, address: str, depth: int) -> ResolvedAddress:
    """Follow an address that is written elsewhere, and keep its location."""
    if not isinstance(node.value, str):
        raise ReportedError
    try:
        target = find(scope, node.value, depth + 1)
    except AddressError as error:
        error.location = error.location or (node.where, address)
        raise
    return replace(target, location=target.location or (node.where, address))


def _from_outside(scope: Scope, rest: list[str], text: str, depth: int) -> ResolvedAddress:
    """The source that the graph around a part wires to one of the part's inputs, or its default."""
    if "inputs" in scope.unread:
        raise ReportedError
    if not rest or rest[0] not in scope.inputs:
        known = ", ".join(scope.inputs) or "none"
        owner = "graph" if scope.is_graph else "part"
        message, name = f"'{text}' is not an input of this {owner}", rest[0] if rest else ""
        other = f"; its inputs: {known}"
        raise AddressError(misspelt("unknown-input", message, name, scope.inputs, other))
    if own := scope.own_value(rest[0]):
        # Its block's output and its state may be named as those of other blocks are.
        port = rest.pop(1) if rest[1:] and rest[1] in ("out", "value") else "out"
        return _component(ResolvedAddress(Endpoint(own, port)), rest[1:], text)
    if scope.parent is None:
        raise UnwiredError(scope, rest[0])
    wires = scope.parent.wires.get(scope.name)
    if "wires" in scope.parent.unread or (wires is not None and not wires.is_map):
        raise ReportedError
    wire = wires.get(rest[0]) if wires is not None else None
    if wire is None:
        raise UnwiredError(scope, rest[0])
    address = f"{scope.parent.path('wires', scope.name)}.{rest[0]}"
    target = _hop(scope.parent, wire, address, depth)
    return _component(replace(target, via=(scope.prefix + rest[0], *target.via)), rest[1:], text)


def _missing(start: Scope, scope: Scope, head: str) -> Message:
    """What is wrong with a name in ``scope`` that an address written in ``start`` refers to."""
    if scope is not start:
        known = [*scope.outputs, *scope.names()]
        text = f"part '{scope.prefix.rstrip('.')}' has no output '{head}'"
        other = f"; its outputs: {', '.join(scope.outputs) or 'none'}"
        return misspelt("unknown-output", text, head, known, other)
    if head in scope.parts:
        outputs = ", ".join(f"{head}.{name}" for name in scope.parts[head].outputs) or "none"
        text = f"'{head}' is a part; expected one of its outputs: {outputs}"
        return Message(text, "unknown-output")
    inputs = {name: f"inputs.{name}" for name in scope.inputs}
    known = [*scope.names(), *scope.broken, *inputs.values()]
    text = f"there is no block '{head}'"
    if scope.is_graph:
        known += scope.outputs
        other = f"; if it was deleted, restore it and write 'without: [{head}]'"
    else:
        text += f" in part '{scope.prefix.rstrip('.')}'" if scope.prefix else ""
        other = f"; inputs of the part: {', '.join(inputs.values()) or 'none'}"
    return misspelt("unknown-block", text, head, known, other, inputs)
