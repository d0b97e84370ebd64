"""Units along the wires: units that contradict each other are refused.

In: a network with types. Out: problems and notes::

    total: {terms: [pose.theta, clock.t]}    expected rad as 'pose.theta' has, got s from 'clock.t'
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Mapping

from blocks.core import Input, Same, differ
from blocks.messages import Note
from runtime.errors import Problems
from runtime.network.addresses import Endpoint
from runtime.network.components import columns
from runtime.network.network import Network, Port, Wire

INTENDED = "; if that is intended, a Gain on this wire gives it another unit"


def check_units(network: Network, problems: Problems) -> tuple[list[Note], dict[Port, str]]:
    """Report wires that are joined with one of another unit.

    Returns notes about wires whose unit differs from the one that their input declares, which
    may be intended: a block may well take its factor as 1; and the units of type variables.

    Units are known where a port declares one and where a record's component has one. A generic
    block passes on the unit of its source, except for outputs with a unit of their own
    (``Same("T", own_unit=True)``, as a Gain's), which may be any.
    """
    units = _Units(network, problems)
    units.check_joined()
    return units.notes(), units.units


class _Units:
    """The units of groups of ports that share one: those of a block's type variable."""

    def __init__(self, network: Network, problems: Problems) -> None:
        self.network = network
        self.problems = problems
        self.joined: dict[tuple[str, str], list[Wire]] = defaultdict(list)
        self.units: dict[Port, str] = {}
        following: dict[str, list[tuple[tuple[str, str], Wire]]] = defaultdict(list)
        for wire in network.wires:
            port_type = self.port(wire).type
            if isinstance(port_type, Same) and not port_type.own_unit:
                key = (wire.block, port_type.variable)
                self.joined[key].append(wire)
                following[wire.source.block].append((key, wire))
        # A chain of generic blocks passes a unit on, so each wire is looked at again when a block
        # before it has learned its unit; a unit is never changed, so this ends.
        queue = deque((key, wire) for key, wires in self.joined.items() for wire in wires)
        while queue:
            key, wire = queue.popleft()
            unit = self.of(wire.source)
            if unit and key not in self.units:
                self.units[key] = unit
                queue.extend(following[wire.block])

    def port(self, wire: Wire) -> Input:
        return self.network.entries[wire.block].cls.spec.inputs[wire.port]

    def check_joined(self) -> None:
        for wires in self.joined.values():
            pairs = [(wire, unit) for wire in wires if (unit := self.of(wire.source))]
            for wire, unit in pairs[1:]:
                # All are compared with the first: which of two units is the wrong one cannot be
                # known.
                first, expected = pairs[0]
                if differ(unit, expected):
                    message = f"expected {expected} as '{first.source_text}' has, "
                    message += f"got {unit} from '{wire.source_text}'"
                    message += INTENDED
                    self.problems.add(wire.where, wire.address, message, "unit-mismatch")

    def notes(self) -> list[Note]:
        notes = []
        for wire in self.network.wires:
            expected, unit = self.port(wire).unit, self.of(wire.source)
            if differ(unit, expected):
                message = f"expected {expected}, got {unit} from '{wire.source_text}'{INTENDED}"
                notes.append(Note(message, "unit-mismatch", wire.address, wire.block))
        return notes

    def of(self, end: Endpoint) -> str:
        return unit_of(self.network, end, self.units)


def unit_of(network: Network, end: Endpoint, units: Mapping[Port, str]) -> str:
    """The unit of a signal; '' if it is not known or differs between components.

    ``units`` are those of type variables.
    """
    entry = network.entries[end.block]
    port = entry.cls.spec.outputs[end.port]
    unit = port.unit if entry.block_or_none is None else entry.block.port_unit(end.port)
    kind = network.types.get((end.block, end.port))
    if kind is not None and kind.form == "record":
        column = columns(kind, end.component) if end.component else None
        return kind.units[column] if isinstance(column, int) else ""
    own = not (isinstance(port.type, Same) and port.type.own_unit) or _states_units(network, end)
    if kind is not None and kind.rows and own:
        column = columns(kind, end.component) if end.component else 0
        one = end.component or kind.form == "scalar"
        return kind.rows[column][1] if one and isinstance(column, int) else ""
    if unit or not isinstance(port.type, Same):
        return unit or (kind.units[0] if kind and len(kind.units) == 1 else "")
    return "" if port.type.own_unit else units.get((end.block, port.type.variable), "")


def _states_units(network: Network, end: Endpoint) -> bool:
    """Whether a block states the type of an output itself, with the units of its components."""
    block = network.entries[end.block].block_or_none
    return block is not None and any(kind.rows for kind in block.variables.values())
