"""Parts that are repeated: the ports of the copies are joined to those of one part.

In: a part's entry with ``repeat``. Out: the scope of a part around the copies. An input becomes one
vector, of which each copy gets its share, and an output the vector of all copies' values; ``share``
names the inputs of which every copy gets the whole::

    arms: {graph: arm.yaml, repeat: 3}     arm.yaml: inputs {u: Vector(2)}, outputs {y: gain.out}
    ->  inputs:  {u: Vector(6)}            copy_1: {u: 'inputs.u[2:4]'}
        outputs: {y: gathered_y.out}       gathered_y: Concatenate of copy_0.y, copy_1.y, copy_2.y
"""

from __future__ import annotations

from collections.abc import Callable

from blocks.core import misspelt, signal_type
from runtime.document import INDEX, MAX_BLOCKS, Node, strings, uses_index
from runtime.errors import Problems
from runtime.network.scope import Scope

GATHERED = "gathered_"  # before the name of an output: the block that joins the copies' values
OpenPart = Callable[[Node, Scope, str], Scope]


def repeat_part(entry: Node, scope: Scope, problems: Problems, open_part: OpenPart) -> Scope:
    """The part that holds the copies of a part.

    Parameters
    ----------
    entry : of the part, with ``repeat``. scope : its own, empty.
    open_part : makes the scope of a copy from its entry, the scope around it, and its name.
    """
    count = _count(entry.value["repeat"], scope.address, problems)
    shared = _shared_inputs(entry, scope.address, problems)
    one = entry.with_item("repeat", None).with_item("share", None)
    params = one.get("params") or _at(entry, {})
    # Only where the part declares it or uses it: an unused param is an error.
    numbered = params.get(INDEX) is not None or uses_index(one)
    for i in range(count):
        if numbered:
            number = Node(i, params.where, params.key)
            one = one.with_item("params", params.with_item(INDEX, number))
        scope.parts[copy_name(i)] = open_part(one, scope, copy_name(i))
    # All copies have the same ports.
    first = scope.parts[copy_name(0)]
    scope.unread |= first.unread & {"inputs", "outputs"}
    wires: list[dict[str, Node]] = [{} for _ in range(count)]
    for port, node in first.inputs.items():
        width = 0 if port in shared else _width(node)
        if width == 0 and port not in shared:
            message = f"a repeated part divides a Scalar or a vector of known length; '{port}' is "
            message += f"{_type_text(node)}: declare its type, or give all copies the whole, "
            problems.add(entry.key, scope.address, f"{message}share: [{port}]")
            shared = {*shared, port}
        scope.inputs[port] = _with_length(node, width * count) if width else node
        for i, wire in enumerate(wires):
            # One number is a component; a range of one would be a vector.
            part = f"[{i * width}:{(i + 1) * width}]" if width > 1 else f"[{i}]"
            whole = count == 1 or port in shared
            wire[port] = _at(entry, f"inputs.{port}{'' if whole else part}")
    for i, wire in enumerate(wires):
        scope.wires[copy_name(i)] = _at(entry, wire)
    for port, node in first.outputs.items():
        gather = f"{GATHERED}{port}"
        terms = [_at(entry, f"{copy_name(i)}.{port}") for i in range(count)]
        scope.blocks[gather] = _at(entry, {"type": _at(entry, "Concatenate")})
        scope.wires[gather] = _at(entry, {"inputs": _at(entry, terms)})
        scope.outputs[port] = Node(f"{gather}.out", node.where, node.key)
    unknown = shared - first.inputs.keys()
    for port in sorted(unknown if "inputs" not in first.unread else ()):
        text, other = f"the part has no input '{port}'", ", ".join(first.inputs) or "none"
        message = misspelt("unknown-name", text, port, first.inputs, f"; it has {other}")
        problems.add(entry.value["share"].where, f"{scope.address}.share", message)
    return scope


def copy_name(i: int) -> str:
    """The name of the i-th copy inside the repeated part."""
    return f"copy_{i}"


def _count(node: Node, address: str, problems: Problems) -> int:
    value = node.value
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MAX_BLOCKS:
        return value
    message = f"expected how often the part is repeated, 1 to {MAX_BLOCKS}, got {node.describe()}"
    problems.add(node.where, f"{address}.repeat", message)
    return 1


def _shared_inputs(entry: Node, address: str, problems: Problems) -> set[str]:
    names = strings(entry.get("share"), f"{address}.share", "an input of the part", problems)
    return {str(item.value) for item, _ in names}


def _type_node(node: Node) -> Node | None:
    return node.get("type") if node.is_map else node


def _type_text(node: Node) -> str:
    type_node = _type_node(node)
    text = None if type_node is None else type_node.value
    return f"a {text}" if isinstance(text, str) else "of any type"


def _width(node: Node) -> int:
    """The numbers of one copy's input; 0 if it is no number or vector of known length."""
    type_node = _type_node(node)
    try:
        kind = signal_type(str(None if type_node is None else type_node.value))
    except ValueError:
        return 0
    if kind.form == "scalar":
        return 1
    return kind.length if kind.name == "Vector" and isinstance(kind.length, int) else 0


def _with_length(node: Node, length: int) -> Node:
    """The declaration of an input, as a vector of this length."""
    kind = Node(f"Vector({length})", node.where, node.key)
    return node.with_item("type", kind) if node.is_map else kind


def _at(entry: Node, value: object) -> Node:
    """A value that the text does not hold, with the position of the part's entry."""
    return Node(value, entry.where, entry.key)
