"""The names that a place in the file can use: of the graph, or of the part that it is inside of.

In: a path of keys. Out: the scope that it leads into, and from there blocks, ports, outputs,
params. ("blocks", "arm", "wires", "pid") in a graph with the inline part "arm" leads into the
scope of "arm", with ("wires", "pid") left: the rest of this room need not know about parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from blocks.core import Block, PortType, SignalType
from blocks.library.registry import BLOCKS, BUILTIN
from runtime.document import PART_SECTIONS, Node
from runtime.language.model import Model
from runtime.language.offers import matches
from runtime.network import NetworkEntry, Scope, copy_name, fits, outputs_in

Steps = tuple[str, ...]


@dataclass(frozen=True)
class WireSource:
    """An output that a wire may come from: its address, its type, and the block's documentation."""

    address: str
    type: SignalType | None
    doc: str = ""


def scope_at(model: Model, path: Steps) -> tuple[Scope | None, Steps]:
    """The scope that a path leads into, and the rest of the path in it."""
    network = model.network
    if network is None:
        return None, path
    scope = network.scope
    # ("blocks", "arm", "blocks", "hand", "wires", "pid")  becomes  ("wires", "pid") in the scope
    # arm.hand
    while len(path) > 2 and path[0] == "blocks" and path[1] in scope.parts:
        if path[2] not in PART_SECTIONS or path[2] in ("graph", "params"):
            break
        scope, path = scope.parts[path[1]], path[2:]
        scope = scope.parts.get(copy_name(0), scope)  # all copies of a repeated part are alike
    return scope, path


def entry_of(model: Model, scope: Scope | None, name: str) -> NetworkEntry | None:
    """A block of the network by its name in a scope; removed ones, too. What all copies of a
    repeated part have is the first copy's."""
    network = model.network
    if network is None or scope is None:
        return None
    full = scope.prefix + name
    found = network.entries.get(full) or network.removed_entries.get(full)
    if found is not None or "." not in name:
        return found
    entries = (*network.entries.values(), *network.removed_entries.values())
    return next((entry for entry in entries if entry.plain_name == full), None)


def class_of(model: Model, scope: Scope | None, name: str) -> type[Block] | None:
    """The class of a block by its name in a scope."""
    entry = entry_of(model, scope, name)
    if entry is not None:
        return entry.cls
    node = scope.blocks.get(name) if scope is not None else None
    type_node = None if node is None else node.get("type")
    # A block that could not be constructed, as while its parameters are typed, still has a class.
    return BUILTIN.get(str(type_node.value)) if type_node is not None else None


def known_types(model: Model) -> dict[str, type[Block]]:
    """Block types that the file may name: the library's, installed ones, those of its modules."""
    network = model.network
    entries = network.entries.values() if network is not None else ()
    own = {entry.cls.__name__: entry.cls for entry in entries if entry.node.get("module")}
    return {**BLOCKS.usable(), **own}


def inputs_of(model: Model, scope: Scope | None, name: str) -> dict[str, PortType | None]:
    """The inputs of a block or part, each with its type where that is known."""
    network = model.network
    if scope is None or network is None:
        return {}
    full = scope.prefix + name
    if name in scope.parts:
        part = scope.parts[name]
        return {port: network.part_inputs.get(part.prefix + port) for port in part.inputs}
    cls = class_of(model, scope, name)
    ports = cls.spec.inputs if cls is not None else {}
    return {
        port: network.types.get((full, port), declaration.type)
        for port, declaration in ports.items()
    }


def is_optional(model: Model, scope: Scope | None, name: str, port: str) -> bool:
    """Whether an input may stay open."""
    if scope is not None and name in scope.parts:
        declaration = scope.parts[name].inputs.get(port)
        optional = declaration.get("optional") if declaration is not None else None
        return optional is not None and optional.value is True
    cls = class_of(model, scope, name)
    return cls is not None and port in cls.spec.inputs and cls.spec.inputs[port].optional


def outputs_for(
    model: Model,
    scope: Scope | None,
    consumer: str = "",
    prefix: str = "",
    components: bool = True,
) -> Iterator[WireSource]:
    """All that can be wired to a block of a scope, with the components of records.

    Left out is what does not match a prefix.
    """
    network = model.network
    if network is None or scope is None:
        return
    for address, kind in outputs_in(network, scope, consumer):
        if kind is not None and kind.form != "record" and not matches(prefix, address):
            continue
        name, _, port = address.partition(".")
        cls = class_of(model, scope, name)
        declaration = cls.spec.outputs.get(port) if cls is not None else None
        if kind is None and declaration is not None and isinstance(declaration.type, SignalType):
            kind = declaration.type
        if matches(prefix, address):
            yield WireSource(address, kind, declaration.doc if declaration is not None else "")
        if components and kind is not None and kind.form == "record":
            scalar = SignalType("Scalar", "scalar")
            for component, unit in zip(kind.components, kind.units, strict=False):
                yield WireSource(f"{address}.{component}", scalar, unit)


def fitting(
    model: Model, scope: Scope | None, name: str, port: str
) -> Callable[[WireSource], bool]:
    """Whether an output certainly may be wired to an input, as a function; never to an open one."""
    want, cls = inputs_of(model, scope, name).get(port), class_of(model, scope, name)
    fills = cls is not None and port in cls.spec.inputs and cls.spec.inputs[port].fills
    return lambda output: isinstance(want, SignalType) and fits(output.type, want, fills)


def params_in(model: Model, scope: Scope | None) -> dict[str, Node]:
    """The params that ``$names`` in a scope refer to."""
    document: Node | None = model.document
    for name in scope.prefix.split(".")[:-1] if scope is not None else ():
        blocks = document.get("blocks") if document is not None else None
        document = blocks.get(name) if blocks is not None else None
    params = document.get("params") if document is not None else None
    return dict(params.items()) if params is not None else {}
