"""Wires: from the text to the blocks and ports that they connect.

In: scopes with their sections ``wires``, and the blocks' ports. Out: a :class:`Wire` for each::

    wires: {total: {terms: [lqr.command, adaptive.command]}}
    ->  Wire(lqr.command, "total", "terms", term=0), Wire(adaptive.join.out, "total", "terms", 1)
"""

from __future__ import annotations

from blocks.core import misspelt, similar
from blocks.messages import Message, RemoveEntry
from runtime.document import Node
from runtime.errors import Problems
from runtime.network.addresses import (
    AddressError,
    ReportedError,
    ResolvedAddress,
    UnwiredError,
    find,
)
from runtime.network.block_types import relative_with
from runtime.network.network import Network, NetworkEntry, Wire, check_output
from runtime.network.scope import Scope, is_optional, output_address

Input = tuple[str, str]


class Wiring:
    """Resolves the wires of a network; reports those that lead to or from nothing.

    ``wires``, ``part_wires`` and ``terms`` are the network's. ``connected`` holds
    the inputs of blocks and parts that need no further message: something is wired to them, even
    if it is wrong. ``open_for`` says why the wire that is written to an input leads to nothing.
    """

    def __init__(self, network: Network, problems: Problems) -> None:
        self.network = network
        self.problems = problems
        self.wires: list[Wire] = []
        self.part_wires: list[Wire] = []
        self.terms: dict[Input, tuple[bool, ...]] = {}
        self.connected: set[Input] = set()
        self.open_for: dict[Input, str] = {}
        for scope in network.scope.walk():
            for name, node in scope.outputs.items():
                # Also where nothing reads the output.
                self.check_source(scope, output_address(node), scope.path("outputs", name))
            for consumer, ports in scope.wires.items():
                self.consumer(scope, consumer, ports)

    def inputs(self, scope: Scope, name: str) -> list[str]:
        """The inputs of a block or part."""
        if name in scope.parts:
            return list(scope.parts[name].inputs)
        entry = self.network.entries.get(scope.prefix + name)
        return [] if entry is None else list(entry.cls.spec.inputs)

    def mark_connected(self, scope: Scope, name: str) -> None:
        self.connected |= {(scope.prefix + name, port) for port in self.inputs(scope, name)}

    def consumer(self, scope: Scope, name: str, ports: Node) -> None:
        address = scope.path("wires", name)
        is_known = name in scope.blocks or name in scope.parts or name in scope.broken
        if not is_known and "blocks" not in scope.unread:
            near = self.unknown_consumer(scope, name, ports, address)
            if not near:
                return
            # The wires are meant for the block of the similar name: it is not reported as open.
            self.mark_connected(scope, near)
        if not ports.is_map:
            message = f"expected {{input: producer.output}}, got {ports.describe()}"
            self.problems.add(ports.where, address, message)
            self.mark_connected(scope, name)
            return
        inputs = self.inputs(scope, name)
        entry = self.network.entries.get(scope.prefix + name)
        for port, node in ports.items():
            inner = f"{address}.{port}"
            if name in scope.parts and port in inputs:
                self.part_port(scope, name, port, node, inner)
            elif entry is not None and port in inputs:
                self.port(entry, port, node, inner)
            elif entry is not None or (
                name in scope.parts and "inputs" not in scope.parts[name].unread
            ):
                self.unknown_port(scope, name, port, node, inner)
            else:
                for item in node.value if node.is_list else [node]:
                    self.check_source(scope, item, inner)

    def unknown_consumer(self, scope: Scope, name: str, ports: Node, address: str) -> str:
        """Report wires of a block that does not exist; returns the block that they are meant for,
        '' if no name is similar.
        """
        known = [*scope.names(), *scope.broken]
        text, near = f"there is no block '{name}'", similar(name, known)
        head, _, port = name.rpartition(".")
        if head in known:
            message = Message(f"{text}; write {head}: {{{port}: ...}}", "unknown-block")
            self.connected.add((scope.prefix + head, port))
            near = ""
        elif near:
            message = misspelt("unknown-block", text, name, known)
        else:
            text += f"; delete these wires, or restore it and write 'without: [{name}]'"
            removal = RemoveEntry(f"Delete the wires of '{name}'")
            message = Message(text, "unknown-block", [removal])
        self.problems.add(ports.key, address, message)
        return near

    def unknown_port(self, scope: Scope, name: str, port: str, node: Node, address: str) -> None:
        inputs = self.inputs(scope, name)
        full = scope.prefix + name
        # The input is connected, if by a misspelt name; by which one is not known where none is
        # similar.
        near = similar(port, inputs)
        self.connected |= {(full, each) for each in ([near] if near else inputs)}
        entry = self.network.entries.get(full)
        relative = relative_with(entry.cls, port) if entry is not None else ""
        other = f"; its inputs: {', '.join(inputs) or 'none'}"
        if relative:
            inputs, other = [], f"; the block with this input is a {relative}"
        text = f"part '{full}'" if name in scope.parts else f"'{full}'"
        text += f" has no input '{port}'"
        self.problems.add(node.key, address, misspelt("unknown-input", text, port, inputs, other))

    def port(self, entry: NetworkEntry, port: str, node: Node, address: str) -> None:
        if not entry.cls.spec.inputs[port].variadic:
            self.wire(entry, port, None, node, address)
        elif node.value is None or node.is_map:
            message = f"expected a list of producer.output, got {node.describe()}"
            self.problems.add(node.where, address, message)
        else:
            items = node.value if node.is_list else [node]
            self.terms[entry.name, port] = tuple(
                self.wire(entry, port, i, item, f"{address}[{i}]" if node.is_list else address)
                for i, item in enumerate(items)
            )

    def wire(
        self, entry: NetworkEntry, port: str, term: int | None, node: Node, address: str
    ) -> bool:
        """Add one wire; returns whether something is now connected."""
        try:
            target = self.source(entry.scope, node, address)
        except UnwiredError as error:
            # A part's input that must be wired is reported itself; one that may be open leaves this
            # input without a source, which is then what has to be reported.
            self.open_for[entry.name, port] = str(error)
            if not is_optional(error.scope.inputs[error.port]):
                self.connected.add((entry.name, port))
            return False
        self.connected.add((entry.name, port))
        if target is not None:
            place = (node.where, address, target.via, node.value)
            self.wires.append(Wire(target.end, entry.name, port, term, *place))
        return target is not None

    def part_port(self, scope: Scope, name: str, port: str, node: Node, address: str) -> None:
        full = scope.prefix + name
        try:
            target = self.source(scope, node, address)
        except UnwiredError as error:
            self.open_for[full, port] = str(error)
            if not is_optional(error.scope.inputs[error.port]):
                self.connected.add((full, port))
            return
        self.connected.add((full, port))
        if target is not None:
            place = (node.where, address, target.via, node.value)
            self.part_wires.append(Wire(target.end, full, port, None, *place))

    def check_source(self, scope: Scope, node: Node, address: str) -> None:
        try:
            self.source(scope, node, address)
        except UnwiredError:
            return

    def source(self, scope: Scope, node: Node, address: str) -> ResolvedAddress | None:
        """Where a wire comes from; None if that is wrong, or the block's type is unknown.

        Raises
        ------
        UnwiredError : it comes through an open input of a part.
        """
        if not isinstance(node.value, str):
            message = f"expected one producer.output, got {node.describe()}"
            if isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
                message += "; a number comes from a block {type: Constant, value: ...}"
            elif node.is_list and len(node.value) > 1:
                message += "; to add signals, wire them to a Sum: {terms: [a.out, b.out]}"
            self.problems.add(node.where, address, message)
            return None
        try:
            target = find(scope, node.value)
        except UnwiredError:
            raise
        except ReportedError:
            return None
        except AddressError as error:
            self.problems.add(*(error.location or (node.where, address)), error.message)
            return None
        wrong = check_output(self.network, target.end)
        if wrong:
            self.problems.add(*(target.location or (node.where, address)), wrong)
            return None
        return target if target.end.block in self.network.entries else None
