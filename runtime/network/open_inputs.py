"""Required inputs that are not connected, each with outputs that fit.

In: a network after removal and inference. Out: problems and notes::

    line.yaml:23:3: input 'lqr.error' (TrackingState) is not connected; outputs of that type:
    error.state
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from blocks.core import PortType, SignalType
from blocks.messages import AddEntry, BypassBlock, Fix, Message, Note
from runtime.errors import NOWHERE, Problems, Where
from runtime.network.addresses import AddressError, find
from runtime.network.inference import compatible
from runtime.network.network import Network, Wire
from runtime.network.removal import missing_block
from runtime.network.scope import Scope, has_default, is_optional
from runtime.network.wiring import Wiring

MAX_SUGGESTED = 6


@dataclass(frozen=True)
class _Open:
    """An open input: its graph, its consumer, and where that is written."""

    scope: Scope
    consumer: str
    port: str
    kind: PortType | None
    where: Where

    @property
    def address(self) -> str:
        return f"{self.scope.path('wires', self.consumer)}.{self.port}"

    @property
    def at(self) -> tuple[str, str]:
        return self.scope.prefix + self.consumer, self.port

    @property
    def name(self) -> str:
        """What a message calls it: one that all copies of a part have is open once."""
        return f"{self.scope.plain_prefix}{self.consumer}.{self.port}"


def report_open_inputs(network: Network, wiring: Wiring, problems: Problems) -> None:
    """Report every open input, after removal and type inference."""
    removed = {(wire.block, wire.port): wire for wire in network.removed_wires}
    for open_input in (*_of_blocks(network), *_of_parts(network)):
        # First: 'not connected without adaptive' tells more than 'not connected'.
        if open_input.at in removed:
            _report_removed(network, open_input, removed[open_input.at], problems)
        elif open_input.at not in wiring.connected and "wires" not in open_input.scope.unread:
            wires = open_input.scope.wires.get(open_input.consumer)
            why = wiring.open_for.get(open_input.at)
            text = f"input '{open_input.name}'{_type_text(open_input.kind)} is not connected"
            text += f", since {why}" if why else ""
            where = open_input.where if wires is None else wires.key
            address = open_input.address if where == NOWHERE else ""
            problems.add(where, address, _message(network, open_input, text))


def open_notes(network: Network) -> list[Note]:
    """A note for each block that moves though nothing is wired to it: a plant without a command."""
    notes = []
    for name, entry in network.entries.items():
        spec = entry.cls.spec
        open_ = {key: port for key, port in spec.inputs.items() if port.default is not None}
        if network.into.get(name) or not open_ or not (spec.update or spec.derivative):
            continue
        values = [f"{key} is {port.default:g} {port.unit}".rstrip() for key, port in open_.items()]
        text = f"nothing is wired to it: {' and '.join(values)} throughout"
        notes.append(Note(text, "not-wired", entry.address, name))
    return notes


def _of_blocks(network: Network) -> Iterator[_Open]:
    wired = {(wire.block, wire.port) for wire in network.wires}
    for entry in network.entries.values():
        for name, port in entry.cls.spec.inputs.items():
            if not port.optional and (entry.name, name) not in wired:
                kind = network.types.get((entry.name, name), port.type)
                yield _Open(entry.scope, entry.short, name, kind, entry.node.key)


def _of_parts(network: Network) -> Iterator[_Open]:
    """Inputs of parts; those that are connected are among the settled ones."""
    alive: set[str] = set()  # the parts with blocks that are left
    for part in network.entries:
        while (part := part.rpartition(".")[0]) and part not in alive:
            alive.add(part)
    for scope in network.scope.walk():
        if scope.parent is not None and scope.prefix[:-1] in alive:
            for name, node in scope.inputs.items():
                if not (is_optional(node) or has_default(node)):
                    kind = network.part_inputs.get(scope.prefix + name)
                    yield _Open(scope.parent, scope.name, name, kind, scope.where)


def _report_removed(network: Network, open_input: _Open, wire: Wire, problems: Problems) -> None:
    block = missing_block(network, wire.source)
    removed = network.removed_entries.values()
    is_of_copy = any(each.name != each.plain_name and each.name == block for each in removed)
    target = wire.target if is_of_copy else open_input.name
    text = f"input '{target}'{_type_text(open_input.kind)} is not connected without '{block}'"
    entry = next((each for each in removed if block in (each.name, each.plain_name)), None)
    fixes = []
    if entry is not None and entry.cls.spec.through is not None:
        text += f"; 'bypass: [{block}]' would connect through it"
        fixes.append(BypassBlock(block))
    problems.add(wire.where, wire.address, _message(network, open_input, text, fixes))


def _type_text(kind: PortType | None) -> str:
    return f" ({kind})" if isinstance(kind, SignalType) else ""


def _message(network: Network, open_input: _Open, text: str, fixes: Sequence[Fix] = ()) -> Message:
    """A message with the outputs that fit an input, by the names that its graph would use."""
    kind = open_input.kind
    if not isinstance(kind, SignalType):
        return Message(f"{text}; wire any output to it", "open-input", fixes)
    outputs = outputs_in(network, open_input.scope, open_input.consumer)
    fitting = [name for name, have in outputs if fits(have, kind)]
    if not fitting:
        text += f"; no output is a {kind.name}; add a block that has one"
        return Message(text, "open-input", fixes)
    more = ", ..." if len(fitting) > MAX_SUGGESTED else ""
    fitting = fitting[:MAX_SUGGESTED]
    path = ("wires", open_input.consumer)
    # An entry of the file's own wires; those of a part are elsewhere, and may serve many copies.
    wirings = [
        AddEntry(path, open_input.port, output, f"Wire '{open_input.name}' to {output}")
        for output in (fitting if not open_input.scope.prefix else ())
    ]
    text += f"; outputs of that type: {', '.join(fitting)}{more}"
    return Message(text, "open-input", [*fixes, *wirings])


def fits(have: SignalType | None, want: SignalType, fills: bool = False) -> bool:
    """Whether an output of one type may be wired to an input of another (of open length), which a
    number may fill."""
    if have is None:
        return False
    return compatible(have, want if not want.symbol else want.sized(have.length or 1), fills)


def outputs_in(
    network: Network, scope: Scope, consumer: str
) -> Iterator[tuple[str, SignalType | None]]:
    """What a graph can connect to one of its blocks, with its type."""
    for name in scope.inputs:
        yield f"inputs.{name}", network.part_inputs.get(scope.prefix + name)
    for name in scope.blocks:
        entry = network.entries.get(scope.prefix + name)
        if entry is not None and name != consumer:
            for output in entry.cls.spec.outputs:
                yield f"{name}.{output}", network.types.get((entry.name, output))
    for name, part in scope.parts.items():
        for output in part.outputs if name != consumer else ():
            try:
                end = find(scope, f"{name}.{output}").end
            except AddressError:
                continue
            if not end.component:
                yield f"{name}.{output}", network.types.get((end.block, end.port))
