"""Signal types of generic ports, and lengths of arrays, inferred along the wires.

In: a network with its wires. Out: the type of each port and the lengths of each block, as far as
blocks and wires determine them; wires that contradict them are reported::

    wires: {total: {terms: [lqr.command]}}      lqr.command is a Twist, total.terms a Same("T")
    ->  total.terms and total.out are Twists; so is what total.out is wired to, and so on

A type variable or length is bound once and never changed, so the propagation ends.
"""

from __future__ import annotations

from collections import defaultdict, deque
from dataclasses import dataclass, field, replace

from blocks.core import BlockSpec, PortType, Same, Scalar, SignalType, Vector
from runtime.errors import NOWHERE, Problems
from runtime.network.addresses import relative
from runtime.network.components import component_type, pass_misses, unknown_component
from runtime.network.network import Network, Wire

Variable = tuple[str, str]


@dataclass
class _Bindings:
    """The type variables and length symbols of a block that are known, and from which wire."""

    types: dict[str, SignalType]
    lengths: dict[str, int]
    why: dict[str, str] = field(default_factory=dict)


MOST_FITTING = 4  # outputs that an error message names


def infer_types(
    network: Network, problems: Problems
) -> tuple[dict[tuple[str, str], SignalType], dict[str, dict[str, int]]]:
    """The types of ports, and each block's lengths by symbol, as far as blocks and wires determine
    them; reports contradictions.
    """
    bindings = {
        name: _Bindings(dict(entry.block.variables), dict(entry.block.sizes()))
        for name, entry in network.entries.items()
        if entry.block_or_none is not None
    }
    inference = _Inference(network, bindings, problems)
    inference.infer()
    inference.report()
    types = {}
    for name, binding in bindings.items():
        block = network.entries[name].block
        for port in block.spec.ports:
            kind = _concrete(_resolve(block.port_type(port), binding))
            if kind is not None:
                types[name, port] = kind
    reading = [
        ((wire.source.block, wire.source.port), [(wire.block, port) for port in cls.spec.outputs])
        for wire in inference.wires
        if (cls := network.entries[wire.block].cls).passes_misses
    ]
    pass_misses(types, reading)
    return types, {name: block.lengths for name, block in bindings.items()}


def report_open(network: Network, problems: Problems) -> None:
    """Report ports whose type is not determined, block by block."""
    for name, entry in network.entries.items():
        spec = entry.cls.spec
        ports = [p for p in (*spec.inputs, *spec.outputs) if (name, p) not in network.types]
        if ports and not network.waits(name):
            where = entry.node.key
            published = frozenset(port for port, _ in network.publications(name))
            reason = "" if entry.block_or_none is None else entry.block.why_open(published)
            message = reason or _open(network, name, ports[0], entry.cls.spec)
            problems.add(where, entry.address if where == NOWHERE else "", message, "open-type")


def _open(network: Network, block: str, port: str, spec: BlockSpec) -> str:
    """What to do about a port whose type or length is not determined."""
    kind = spec.ports[port].type
    if isinstance(kind, Same):
        message = f"the signal type of '{block}.{port}' is open; wire a typed signal to it"
        return message + (", or write its type, as in 'signal: Scalar'" if spec.generic else "")
    spread = [name for name, declared in spec.inputs.items() if declared.spread == kind.symbol]
    if spread:
        return (
            f"the length of '{block}.{port}' is open; wire typed signals to '{block}.{spread[0]}'"
        )
    alike = [name for name, declared in spec.inputs.items() if declared.type == kind]
    inputs = " or ".join(f"'{block}.{name}'" for name in alike or [port])
    wired = {wire.port for wire in network.into.get(block, ())}
    message = f"the length of '{block}.{port}' ({kind}) is open"
    if port in spec.inputs and not wired & {*alike}:
        message = f"'{block}.{port}' is not connected, and its length ({kind}) is open"
    return f"{message}; wire a {kind.name} to {inputs}"


def compatible(source: SignalType, target: SignalType, fills: bool = False) -> bool:
    """Whether a wire may join the two: equal types, a scalar and a Vector(1), or a number and a
    vector whose input it ``fills``."""
    if source == target or {str(source), str(target)} == {"Scalar", "Vector(1)"}:
        return True
    return fills and is_number(source) and target.name == "Vector"


def is_number(kind: SignalType) -> bool:
    """Whether a signal is one number: a scalar or a Vector(1)."""
    return kind.form == "scalar" or str(kind) == "Vector(1)"


def _resolve(port_type: PortType, block: _Bindings) -> SignalType | None:
    if isinstance(port_type, Same):
        return block.types.get(port_type.variable)
    if port_type.symbol and port_type.symbol in block.lengths:
        return port_type.sized(block.lengths[port_type.symbol])
    return port_type


def _concrete(kind: SignalType | None) -> SignalType | None:
    return None if kind is None or kind.symbol else kind


class _Inference:
    """Propagates types along the wires until nothing changes."""

    def __init__(
        self, network: Network, bindings: dict[str, _Bindings], problems: Problems
    ) -> None:
        self.network = network
        self.bindings = bindings
        self.problems = problems
        self.outer = {wire.target: wire for wire in network.part_wires}
        self.wires = [
            wire
            for wire in network.wires
            if wire.block in bindings and wire.source.block in bindings and self.has_component(wire)
        ]
        # Of each input that takes components of any signals: the wires that are not counted yet,
        # and the components of the others.
        self.unread: dict[tuple[str, str], tuple[deque[Wire], int]] = {}

    def has_component(self, wire: Wire) -> bool:
        kind = _resolve(self.out(wire), self.bindings[wire.source.block])
        return kind is None or component_type(kind, wire.source) is not None

    def out(self, wire: Wire) -> PortType:
        return self.network.entries[wire.source.block].block.port_type(wire.source.port)

    def into(self, wire: Wire) -> PortType:
        return self.network.entries[wire.block].block.port_type(wire.port)

    def spread(self, wire: Wire) -> str:
        """The length symbol of an input that takes components of any signals; '' for others."""
        return self.network.entries[wire.block].cls.spec.inputs[wire.port].spread

    def fills(self, wire: Wire) -> bool:
        """Whether an input takes one number for all its components."""
        # The wire to a part ends at the part, which is no block.
        entry = self.network.entries.get(wire.block)
        return entry is not None and entry.cls.spec.inputs[wire.port].fills

    def width(self, wire: Wire) -> int:
        """The number of components that arrive at such an input; 0 if it is not known yet."""
        key = wire.block, wire.port
        if key not in self.unread:
            into = self.network.into[wire.block]
            self.unread[key] = deque(w for w in into if w.port == wire.port), 0
        # What is known stays known: counting starts where it ended, or each of a thousand wires
        # would count all of them.
        others, total = self.unread[key]
        while others:
            is_valid = others[0].source.block in self.bindings
            kind = _concrete(self.arriving(others[0])) if is_valid else None
            if kind is None or len(kind.shape) > 1:
                break
            others.popleft()
            total += kind.shape[0] if kind.shape else 1
        self.unread[key] = others, total
        return 0 if others else total

    def declared_by_part(self, wire: Wire) -> SignalType | None:
        """The type that the outermost part on a wire's way declares for its source."""
        part_types = [
            self.network.part_inputs[name] for name in wire.via if name in self.network.part_inputs
        ]
        return part_types[-1] if part_types and not wire.source.component else None

    def arriving(self, wire: Wire) -> SignalType | None:
        """The type that arrives at a wire's end."""
        if not wire.via or wire.via[0] not in self.outer:
            kind = _resolve(self.out(wire), self.bindings[wire.source.block])
            return None if kind is None else component_type(kind, wire.source)
        # Through a part's input: what the part declares for it counts, not what the source is, so
        # that a wrong wire to the part is reported there and not at each block inside.
        outer = self.outer[wire.via[0]]
        kind = self.network.part_inputs.get(outer.target) or self.arriving(outer)
        inner = relative(outer.source.component, wire.source.component)
        own = replace(wire.source, component=inner)
        return None if kind is None else component_type(kind, own)

    def infer(self) -> None:
        for name in self.bindings:
            self.derive(name)
        # Before the propagation, in which the first wire to arrive would decide.
        self.vote()
        touching: dict[str, list[Wire]] = defaultdict(list)
        for wire in self.wires:
            touching[wire.block].append(wire)
            touching[wire.source.block].append(wire)
        # A wire is looked at again only after a block at one of its ends has learned something.
        # An input that takes one number for all types its source only where nothing else does.
        for last in (False, True) if any(map(self.fills, self.wires)) else (False,):
            queue = deque(self.wires)
            while queue:
                wire = queue.popleft()
                for name in self.propagate(wire, last):
                    queue.extend(touching[name])

    def vote(self) -> None:
        """Give connected generic ports the type that most of their wires have.

        A single wrong wire is then the one that is reported, wherever it is written.
        """
        # Union-find: variables that are wired to each other have one type, and vote together.
        groups: dict[Variable, Variable] = {}

        def root(variable: Variable) -> Variable:
            while (above := groups.setdefault(variable, variable)) != variable:
                groups[variable] = groups[above]
                variable = above
            return variable

        votes: list[tuple[Variable, SignalType, str]] = []
        for wire in self.wires:
            if self.spread(wire) or self.fills(wire):
                continue
            source = self.variable(wire.source.block, self.out(wire))
            target = self.variable(wire.block, self.into(wire))
            coming = _concrete(self.arriving(wire))
            expected = _concrete(_resolve(self.into(wire), self.bindings[wire.block]))
            expected = self.declared_by_part(wire) or expected
            if target is not None and coming is not None:
                votes.append((target, coming, wire.source_text))
            if source is not None and not wire.source.component:
                if expected is not None:
                    votes.append((source, expected, wire.target))
                elif target is not None:
                    groups[root(source)] = root(target)
        cast: dict[Variable, dict[SignalType, list[str]]] = defaultdict(lambda: defaultdict(list))
        for voter, kind, why in votes:
            cast[root(voter)][kind].append(why)
        for variable in list(groups):
            kinds = cast[root(variable)]
            # They fit each other, and which lengths are known by now may depend on what was
            # checked before: [join.out, a.value] is Scalar whether join.out is a Vector(n) as yet
            # or the Vector(1) that it turns out to be.
            if Scalar in kinds:
                kinds[Scalar] += kinds.pop(Vector(1), [])
            if kinds:
                # Of equals, max returns the first: the wire that is written first.
                winner = max(kinds, key=lambda kind: len(kinds[kind]))
                block = self.bindings[variable[0]]
                block.types[variable[1]] = winner
                block.why[variable[1]] = kinds[winner][0]

    def variable(self, block: str, port_type: PortType) -> Variable | None:
        """A port's type variable, if the block's parameters do not determine it."""
        if isinstance(port_type, Same) and port_type.variable not in self.bindings[block].types:
            return block, port_type.variable
        return None

    def propagate(self, wire: Wire, last: bool) -> list[str]:
        """Propagate types along one wire, both ways; returns the blocks that changed."""
        changed = []
        source, target = self.bindings[wire.source.block], self.bindings[wire.block]
        spread = self.spread(wire)
        if spread:
            width = 0 if spread in target.lengths else self.width(wire)
            if width:
                target.lengths[spread] = width
                changed.append(wire.block)
                self.derive(wire.block)
            return changed
        coming = _concrete(self.arriving(wire))
        number = self.fills(wire) and (coming is None or is_number(coming))
        if (
            coming is not None
            and not (number and not last)
            and _bind(self.into(wire), target, coming, wire.source_text)
        ):
            changed.append(wire.block)
        expected = _concrete(_resolve(self.into(wire), target))
        expected = self.declared_by_part(wire) or expected
        whole = expected if not wire.source.component and (last or not number) else None
        if whole is not None and _bind(self.out(wire), source, whole, wire.target):
            changed.append(wire.source.block)
        if not wire.source.component and self.carry(wire) and wire.block not in changed:
            changed.append(wire.block)
        for name in changed:
            self.derive(name)
        return changed

    def carry(self, wire: Wire) -> bool:
        """Pass on the lengths that travel with a signal; returns whether one was new."""
        source, target = self.bindings[wire.source.block], self.bindings[wire.block]
        port = self.network.entries[wire.source.block].cls.spec.outputs[wire.source.port]
        new = {s: source.lengths[s] for s in port.carries if s in source.lengths}
        new = {symbol: length for symbol, length in new.items() if symbol not in target.lengths}
        target.lengths.update(new)
        target.why.update(dict.fromkeys(new, wire.source_text))
        return bool(new)

    def derive(self, name: str) -> None:
        """Let a block derive lengths from those that are known."""
        block = self.bindings[name]
        derived = self.network.entries[name].block.infer(dict(block.lengths))
        block.lengths.update({s: n for s, n in derived.items() if s not in block.lengths})

    def report(self) -> None:
        """Report wires whose ends have different types, and components that do not exist."""
        for wire in (*self.network.wires, *self.network.part_wires):
            if wire.source.block not in self.bindings:
                continue
            source = _resolve(self.out(wire), self.bindings[wire.source.block])
            outer = self.outer.get(wire.via[0]) if wire.via else None
            inherited = outer is not None and outer.source.component
            if source and not inherited and component_type(source, wire.source) is None:
                message = unknown_component(source, wire.source)
                self.problems.add(wire.where, wire.address, message, "unknown-name")
        for wire in self.network.part_wires:
            target = self.network.part_inputs.get(wire.target)
            coming = self.arriving(wire) if wire.source.block in self.bindings else None
            if target is not None and coming is not None:
                self.check(wire, coming, target, "")
        for wire in self.wires:
            target = _resolve(self.into(wire), self.bindings[wire.block])
            coming = self.arriving(wire)
            if self.spread(wire):
                if coming is not None and coming.form == "array" and coming.components:
                    message = f"expected a number, a record or a vector, got {coming} from "
                    message += f"'{wire.source_text}'"
                    self.problems.add(wire.where, wire.address, message, "type-mismatch")
            elif target is not None and coming is not None:
                port_type = self.into(wire)
                symbol = port_type.variable if isinstance(port_type, Same) else port_type.symbol
                self.check(
                    wire, coming, target, self.bindings[wire.block].why.get(symbol or "", "")
                )

    def check(self, wire: Wire, coming: SignalType, target: SignalType, why: str) -> None:
        # A length is open: the kinds alone can be compared as yet.
        if target.symbol or coming.symbol:
            if coming.name == target.name or {coming.name, target.name} == {"Scalar", "Vector"}:
                return
        elif compatible(coming, target, self.fills(wire)):
            return
        if wire.via and not any(name in self.network.part_inputs for name in wire.via):
            # The part takes any type, so the wire to it is the one that does not fit inside.
            wire = self.outer.get(wire.via[-1], wire)
        because = f" (as '{why}' is)" if why and why != wire.source_text else ""
        message = f"expected {target}{because}, got {coming} from '{wire.source_text}'"
        if target.form == "scalar" and coming.form == "record":
            fitting = ", ".join(f"{wire.source_text}.{c}" for c in coming.components)
            message += f"; one of its components fits: {fitting}"
        elif coming.form == "scalar" and target.name == "Vector" and len(target.shape) == 1:
            message += "; a Broadcast makes a vector of the number, as long as is expected"
        else:
            entries = map(self.network.entries.get, (wire.source.block, wire.block))
            if not target.symbol:  # a length that is open may be the right one
                message += "".join(entry.block.instead(target) for entry in entries if entry)
            message += "" if because else self.fitting(wire, target)
        self.problems.add(wire.where, wire.address, message, "type-mismatch")

    def fitting(self, wire: Wire, target: SignalType) -> str:
        """The outputs beside a block that have the type of its input, if the type is a rare one."""
        scope = wire.block.rpartition(".")[0]
        names = [
            f"{name.removeprefix(f'{scope}.')}.{key}"
            for name, entry in self.network.entries.items()
            if name != wire.block and name.rpartition(".")[0] == scope
            for key, port in entry.cls.spec.outputs.items()
            if name in self.bindings
            and (kind := _resolve(port.type, self.bindings[name])) is not None
            and kind.name == target.name
        ]
        is_rare = target.name not in ("Scalar", "Vector") and len(names) <= MOST_FITTING
        return f"; outputs of that type: {', '.join(names)}" if names and is_rare else ""


def _bind(port_type: PortType, block: _Bindings, kind: SignalType, why: str) -> bool:
    """Bind the open variable or length of a declared type; returns whether it was open."""
    if isinstance(port_type, Same):
        if port_type.variable in block.types:
            return False
        block.types[port_type.variable] = kind
        block.why[port_type.variable] = why
        return True
    symbol = port_type.symbol
    if not symbol or symbol in block.lengths:
        return False
    # A scalar may be wired to a vector of one number (see compatible).
    length = 1 if kind == Scalar and port_type.name == "Vector" else kind.length
    if not isinstance(length, int) or kind.name not in (port_type.name, "Scalar"):
        return False
    block.lengths[symbol] = length
    block.why[symbol] = why
    return True
