"""Ports of a whole graph: what may be written to it from outside, and what it offers to others.

In: the sections ``inputs`` and ``outputs``, as a part has them. Out: declarations, and a block for
each input that nothing is wired to::

    inputs:  {push: {type: Scalar, unit: N, min: -10, max: 10, default: 0}}
    outputs: {angle: {of: plant.theta, min: -3.2, max: 3.2}}
    wires:   {plant: {force: inputs.push}}
    ->  network.inputs["push"].end     inputs.push.out, of a GraphInput
        network.outputs["angle"].end   plant.theta
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, cast

import numpy as np

from blocks.core import FloatArray, GraphInput, Options, SignalType, differ, misspelt, param
from blocks.messages import Note
from runtime.document import Node
from runtime.errors import Problems
from runtime.network.addresses import AddressError, Endpoint, find
from runtime.network.components import component_type
from runtime.network.declared_port import PortDeclaration
from runtime.network.network import Network
from runtime.network.removal import follow, missing_block
from runtime.network.scope import INPUTS, Scope, has_default, is_optional, output_address
from runtime.network.units import unit_of


class GraphOutput(Options):
    """The keys of an entry of ``outputs``."""

    of: str = param(doc="the address of the signal")
    unit: str = param("", doc="its unit, where the signal has none")
    low: FloatArray | None = param(None, name="min", finite=False, doc="its smallest value")
    high: FloatArray | None = param(None, name="max", finite=False, doc="its largest value")
    doc: str = param("", doc="one line of documentation")


def input_entries(scope: Scope) -> Iterator[tuple[str, Node]]:
    """The inputs of a graph or part, as blocks are written: a name, and a mapping."""
    for name, node in scope.inputs.items():
        short = {} if node.value is None else {"type": node}
        yield INPUTS + name, node if node.is_map else Node(short, node.where, node.key)


def with_ports(network: Network, problems: Problems) -> Network:
    """The network with the ports of the graph; reports what is wrong with their declarations."""
    for scope in network.scope.walk():
        for name, node in scope.outputs.items():
            _check_output(node, scope.path("outputs", name), problems)
    if problems.items:
        return network
    inputs, outputs, notes = {}, {}, list(network.notes)
    for name in network.scope.inputs:
        entry, end = network.entries.get(INPUTS + name), Endpoint(INPUTS + name, "out")
        if entry is not None:
            block = cast("GraphInput", entry.block)
            unit = unit_of(network, end, network.units)
            declared = {"min": block.low, "max": block.high, "doc": block.doc}
            kind = network.types[end.block, end.port]
            inputs[name] = _port(name, kind, unit, block.default, declared, end)
    for name, node in network.scope.outputs.items():
        port = _output(network, name, node, problems)
        if isinstance(port, Note):
            notes.append(port)
        elif port is not None:
            outputs[name] = port
    read = {wire.source.block for wire in network.wires}
    read |= {port.end.block for port in outputs.values()}
    unread = (name for name, port in inputs.items() if port.end.block not in read)
    notes += [Note("nothing reads it", "not-used", f"inputs.{name}") for name in unread]
    return network.changed(inputs=inputs, outputs=outputs, notes=tuple(notes))


def check_defaults(network: Network, problems: Problems) -> None:
    """Report, as one problem, the inputs that are needed and that nothing gives a value."""
    inputs = network.scope.inputs.items() if network.scope.is_graph else ()
    lacking = {n: node for n, node in inputs if not (has_default(node) or is_optional(node))}
    if lacking:
        first = next(iter(lacking.values()))
        written = first.get("type") if first.is_map else first
        known = written is not None and isinstance(written.value, str)
        kind = written.value if written is not None and known else "Scalar"
        verb = "have no defaults" if len(lacking) > 1 else "has no default"
        message = f"{', '.join(lacking)} {verb}, which a graph that runs by itself needs: "
        message += f"{{type: {kind}, default: 0.0}}; a part inside of a graph, "
        problems.add(first.key, "inputs", message + "{name: {graph: FILE}}, needs none")


def _check_output(node: Node, address: str, problems: Problems) -> None:
    """Report what is wrong with the keys of an output."""
    if not node.is_map:
        return
    known = GraphOutput.declared
    for key, item in node.items():
        if key not in known:
            other = f"; expected {', '.join(known)}"
            message = misspelt("unknown-key", "unknown key", key, known, other)
            problems.add(item.key, f"{address}.{key}", message)
    for key, text in GraphOutput.check(node.plain()):
        written = node.get(key)
        if key != "of" or written is None:  # an address is reported with the wires
            where = node.key if written is None else written.where
            problems.add(where, f"{address}.{key}", text)


def _output(
    network: Network, name: str, node: Node, problems: Problems
) -> PortDeclaration | Note | None:
    """An output of the graph; a note if its block is removed; None if something is wrong."""
    address = f"outputs.{name}"
    try:
        written = find(network.scope, str(output_address(node).value)).end
    except AddressError:
        return None  # reported with the wires
    end = follow(network, written)
    if end is None:
        block = missing_block(network, written)
        return Note(f"left out, since block '{block}' is removed", "not-used", address, block)
    whole = network.types.get((end.block, end.port))
    kind = None if whole is None else component_type(whole, end)
    if kind is None:
        return None
    declared = GraphOutput.read(node.plain()) if node.is_map else {}
    unit = unit_of(network, end, network.units) or ("" if end.component else ", ".join(kind.units))
    for key in ("min", "max"):
        bound = declared.get(key)
        if bound is not None and bound.shape not in ((), kind.shape):
            message = f"expected {kind.numbers} for {kind}, got {bound.tolist()}"
            problems.add(node.value[key].where, f"{address}.{key}", message)
            return None
    if differ(declared.get("unit", ""), unit):
        message = f"expected {unit} as '{output_address(node).value}' has, got {declared['unit']}"
        problems.add(node.value["unit"].where, f"{address}.unit", message)
        return None
    return _port(name, kind, unit or declared.get("unit", ""), None, declared, end)


def _port(
    name: str,
    kind: SignalType,
    unit: str,
    default: FloatArray | None,
    declared: Mapping[str, Any],
    end: Endpoint,
) -> PortDeclaration:
    def sized(value: FloatArray | None, absent: float) -> FloatArray:
        return np.broadcast_to(absent if value is None else value, kind.shape).astype(float)

    low, high = sized(declared.get("min"), -np.inf), sized(declared.get("max"), np.inf)
    start = None if default is None else sized(default, 0.0)
    unit = unit or ", ".join(kind.units)
    return PortDeclaration(name, kind, unit, low, high, start, declared.get("doc", ""), end)
