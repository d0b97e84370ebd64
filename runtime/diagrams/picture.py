"""The block diagram of a network as data, independent of the format in which it is drawn.

In: a checked network. Out: a :class:`Picture`. The graph ``wires: {g: {input: u.out}}`` has the
boxes "u" and "g" and one net from ("u", "out") to ("g", "input"); nothing has a position yet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

from blocks.core import SignalType, hint
from blocks.generic import Sum
from runtime.diagrams.values import value_text
from runtime.document import rate_text
from runtime.errors import UsageError
from runtime.network import Endpoint, Network, NetworkEntry, Wire, component_type
from runtime.observation import Probe

CONSTANT, CONTINUOUS = "constant", "continuous"
MINUS = "−"
FATES = {"without": "removed", "bypass": "bypassed"}
# What a diagram can show beside names and wires: types of blocks, types of signals, ...
DETAILS = ("blocks", "types", "rates", "ports", "values", "probes")


@dataclass
class Box:
    """A block in a diagram; ``period`` is its step, 0 if it is evaluated only once.

    ``rate`` says how often: a frequency, "constant", or "continuous" for a block that a solver
    evaluates between ticks. ``fate`` is "removed" or "bypassed" for a block that does not run, else
    empty; ``part`` is the full name of the part that it belongs to. ``inputs`` and ``outputs`` are
    the wired ports, the inputs in ``open``, which keep their default, and the outputs in
    ``probed``, which a probe records. ``signs`` are those of the terms of a Sum, which is drawn as
    a circle. ``value`` is what ``values.py`` says of it.
    """

    name: str
    title: str
    type: str
    period: float
    rate: str
    part: str
    fate: str
    about: str
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    signs: dict[str, str] = field(default_factory=dict)
    open: list[str] = field(default_factory=list)
    value: str = ""
    probed: list[str] = field(default_factory=list)

    @property
    def is_sum(self) -> bool:
        return bool(self.signs)


@dataclass(frozen=True)
class Net:
    """An output with all its wires; ``is_ghost`` if they belong to a removed block.

    ``needs`` are the block's inputs that the output depends on in the same tick: none for an
    output without direct feedthrough.
    """

    source: tuple[str, str]
    targets: tuple[tuple[str, str], ...]
    type: str
    is_ghost: bool
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Part:
    """A subgraph, which is drawn as a frame around its blocks."""

    name: str
    title: str
    parent: str


@dataclass
class Picture:
    """All that a diagram shows: of ``DETAILS``, what is in ``detail``."""

    title: str
    boxes: dict[str, Box]
    parts: dict[str, Part]
    nets: list[Net]
    detail: frozenset[str] = frozenset(DETAILS)

    def only(self, detail: Iterable[str]) -> Picture:
        """The same diagram with less detail.

        Raises
        ------
        UsageError : no detail has such a name.
        """
        shown = frozenset(detail)
        for name in sorted(shown - set(DETAILS)):
            known = hint(name, DETAILS) or f", expected {', '.join(DETAILS)}"
            raise UsageError(f"no detail '{name}'{known}")
        wired = {net.source for net in self.nets}
        boxes = {}
        for name, box in self.boxes.items():
            outputs = box.outputs
            # An end that nothing is wired to says nothing without its name.
            if not {"probes", "ports"} <= shown:
                outputs = [port for port in outputs if (name, port) in wired]
            boxes[name] = replace(
                box,
                type=box.type if "blocks" in shown else "",
                rate=box.rate if "rates" in shown else "",
                value=box.value if "values" in shown else "",
                inputs=[p for p in box.inputs if "ports" in shown or p not in box.open],
                open=box.open if "ports" in shown else [],
                outputs=outputs,
                probed=[p for p in box.probed if "probes" in shown and p in outputs],
            )
        return replace(self, boxes=boxes, detail=shown)

    @cached_property
    def drivers(self) -> dict[tuple[str, str], list[Net]]:
        """The nets that drive each input; those of a variadic input together."""
        drivers: dict[tuple[str, str], list[Net]] = {}
        for net in self.nets:
            for name, port in net.targets:
                drivers.setdefault((name, port.partition("[")[0]), []).append(net)
        return drivers

    def label(self, net: Net) -> str:
        """The type of a net, where it is not that of a wire into the same block."""
        if "types" not in self.detail:
            return ""
        name = net.source[0]
        before = {
            each.type for (block, _), nets in self.drivers.items() if block == name for each in nets
        }
        return "" if net.type in before else net.type

    def breaks_loop(self, net: Net, part: str = "") -> bool:
        """Whether an output has no direct feedthrough, so that a loop is best opened there.

        With a part, whether no input of that part reaches the output in the same tick, by any
        path inside the part.
        """
        if not part:
            return not net.needs
        # Backwards from the output, through what each output needs in the same tick, until a wire
        # comes from outside of the part.
        visited = {net.source}
        waiting = [net]
        while waiting:
            current = waiting.pop()
            for port in current.needs:
                for before in self.drivers.get((current.source[0], port), ()):
                    if not f"{self.boxes[before.source[0]].part}.".startswith(f"{part}."):
                        return False
                    if before.source not in visited:
                        visited.add(before.source)
                        waiting.append(before)
        return True

    def is_out(self, part: str) -> bool:
        """Whether all blocks of a part are removed or bypassed."""
        inside = (box for box in self.boxes.values() if f"{box.part}.".startswith(f"{part}."))
        return all(box.fate for box in inside)


def picture_of(network: Network, probes: Iterable[Probe] = ()) -> Picture:
    """Collect what a network's diagram shows; removed blocks keep their position in the order.

    The outputs that ``probes`` record are marked, and drawn also where nothing is wired to them.
    """
    entries = {**network.entries, **network.removed_entries}
    scopes = list(network.scope.walk())
    # In the order in which the author wrote the blocks, removed ones included: the layout breaks
    # ties by this order, so that a diagram with and without a block looks alike.
    names = [scope.prefix + name for scope in scopes for name in scope.block_names()]
    boxes = {name: _box(network, entries[name]) for name in names if name in entries}
    parts = {
        scope.prefix[:-1]: Part(
            scope.prefix[:-1], scope.name, scope.parent.prefix[:-1] if scope.parent else ""
        )
        for scope in scopes
        if scope.prefix
    }
    nets = [
        *_nets(network, entries, network.wires, is_ghost=False),
        *_nets(network, entries, network.removed_wires, is_ghost=True),
    ]
    for net in nets:
        _add_port(boxes[net.source[0]].outputs, net.source[1])
        for name, port in net.targets:
            _add_port(boxes[name].inputs, port)
    _mark_probes(boxes, probes)
    for name, box in boxes.items():
        spec = entries[name].cls.spec
        if not box.fate:
            defaults = [name for name, port in spec.inputs.items() if port.default is not None]
            # An input that keeps its default is drawn, since one could wire it.
            box.open = [port for port in defaults if port not in box.inputs]
            box.inputs += box.open
        box.inputs.sort(key=_declaration_order(spec.inputs))
        box.signs = _signs(entries[name], box)
        box.outputs.sort(key=_declaration_order(spec.outputs))
    return Picture(network.title, boxes, parts, nets)


def _mark_probes(boxes: dict[str, Box], probes: Iterable[Probe]) -> None:
    """Mark the outputs that are recorded; states and the tuning of neurons are not outputs."""
    for probe in probes:
        for signal in probe.signals:
            end = signal.end
            if signal.is_state or signal.is_event or signal.publisher or end.block not in boxes:
                continue
            box = boxes[end.block]
            component = f"{end.port}.{end.component}"
            port = component if component in box.outputs else end.port
            _add_port(box.outputs, port)
            _add_port(box.probed, port)


def _box(network: Network, entry: NetworkEntry) -> Box:
    spec = entry.cls.spec
    is_constant = bool(spec.outputs) and all(port.constant for port in spec.outputs.values())
    period = 0.0 if is_constant and spec.update is None else entry.every * network.dt
    fate = FATES[network.removed[entry.name]] if entry.name in network.removed else ""
    values = entry.block.parameters() if entry.block_or_none is not None else {}
    rate = CONSTANT
    if _is_continuous(network, entry):
        rate = CONTINUOUS
    elif period:
        rate = rate_text(period, network.time_unit)
    solver = f", {network.solver}" if spec.continuous else ""
    facts = [f"{entry.name}: {entry.cls.__name__}, {fate or rate + solver}"]
    facts += [f"{name} = {_short(repr(value))}" for name, value in values.items()]
    part = entry.scope.prefix[:-1]
    box = Box(
        name=entry.name,
        title=entry.short,
        type=entry.cls.__name__,
        period=period,
        rate=rate,
        part=part,
        fate=fate,
        about="\n".join(facts),
    )
    box.value = value_text(box.type, values)
    return box


def _is_continuous(network: Network, entry: NetworkEntry) -> bool:
    """Whether a solver evaluates a block between ticks."""
    if entry.cls.spec.continuous:
        return True
    # Memoryless blocks between integrators are evaluated at the solver's stages, too.
    return network.is_continuous and any(
        (entry.name, port) in network.moving for port in entry.cls.spec.outputs
    )


def _signs(entry: NetworkEntry, box: Box) -> dict[str, str]:
    """The signs of the wired terms of a Sum; {} for any other block."""
    if entry.cls is not Sum or not isinstance(entry.block_or_none, Sum):
        return {}
    signs = entry.block_or_none.signs
    return {
        port: MINUS if signs is not None and signs[_term(port)] < 0.0 else "+"
        for port in box.inputs
    }


def _term(port: str) -> int:
    """The number of a term in the name of its port."""
    number = port.partition("[")[2].rstrip("]")
    return int(number) if number.isdigit() else 0


def _nets(
    network: Network, entries: dict[str, NetworkEntry], wires: Iterable[Wire], is_ghost: bool
) -> list[Net]:
    """The wires, grouped by output, in the order in which they were written."""
    by_output: dict[Endpoint, list[Wire]] = {}
    for wire in wires:
        by_output.setdefault(wire.source, []).append(wire)
    nets = []
    for end, out in by_output.items():
        port = f"{end.port}.{end.component}" if end.component else end.port
        calls = entries[end.block].evaluations
        evaluation = next((e for e in calls if end.port in e.outputs), None)
        targets = tuple((wire.block, wire.target.removeprefix(f"{wire.block}.")) for wire in out)
        needs = evaluation.needs if evaluation is not None else ()
        kind = _type_text(network, entries, end, out)
        nets.append(Net((end.block, port), targets, kind, is_ghost, needs))
    return nets


def _type_text(
    network: Network, entries: dict[str, NetworkEntry], end: Endpoint, wires: list[Wire]
) -> str:
    """The type of a wire; for a removed block, that of the port that it was wired to."""
    kind = network.types.get((end.block, end.port))
    if kind is not None:
        return str(component_type(kind, end) or kind)
    for wire in wires:
        if (wire.block, wire.port) in network.types:
            return str(network.types[wire.block, wire.port])
    port_type = entries[end.block].cls.spec.outputs[end.port].type
    return port_type.name if isinstance(port_type, SignalType) and not end.component else ""


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


def _add_port(ports: list[str], port: str) -> None:
    if port not in ports:
        ports.append(port)


def _declaration_order(ports: Iterable[str]) -> Callable[[str], tuple[int, int]]:
    order = {name: i for i, name in enumerate(ports)}

    def position(port: str) -> tuple[int, int]:
        base, _, term = port.replace(".", "[").partition("[")
        number = term.rstrip("]")
        return order[base], int(number) if number.isdigit() else 0

    return position
