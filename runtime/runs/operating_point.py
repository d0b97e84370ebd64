"""Where a graph is linearized, or brought to rest: its states, inputs and outputs at one time.

In: a network, addresses, a time. Out: a :class:`runtime.engine.Point`, with the numbers there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from blocks.core import FloatArray, Vector, hint, state_shape
from runtime.engine import Engine, Offsets, Point, Program, Watched, labels
from runtime.errors import UsageError
from runtime.network import AddressError, Endpoint, Network, check_output, columns, find
from runtime.observation import Observation
from runtime.plan import Port
from runtime.runs.sampling import structure_of

WRONG = (ArithmeticError, ValueError, LookupError)  # outside of a function's domain


class OperatingPoint:
    """A graph at a time, with numbers that are added to some signals.

    ``columns`` are the states and held signals, ``u`` the inputs: 0, and at a cut the signal
    itself. ``inputs`` and ``outputs`` are labels, ``driven`` those of the inputs that are wanted.
    """

    def __init__(
        self,
        network: Network,
        inputs: Sequence[str],
        outputs: Sequence[str],
        at: float,
        states: Mapping[str, Any],
        opened: str = "",
    ) -> None:
        self.network = network
        cut = _signal_at_cut(network, opened) if opened else None
        if cut is not None and not (inputs or outputs):
            outputs = [opened]
        watched = [_watch(network, text) for text in outputs]
        ends = [each for each, _ in watched]
        first = self._first(inputs)
        components = () if cut is None else self._cut_loop(cut, first, bool(inputs))
        self.outputs = tuple(name for _, names in watched for name in names)
        self.structure = structure_of(network, first.keys(), {each.end.block for each in ends})
        engine, tick = _engine(network, at, max(1, self.structure.period))
        offsets = Offsets(first, None if cut is None else (cut.end.block, cut.end.port), components)
        self.engine, self.tick, self.states = engine, tick, states
        self.u = np.zeros(len(self.inputs))
        if cut is not None:
            # What readers get at the cut while the loop is closed.
            value = self.value_of(Watched(cut.end))
            start = first[cut.end.block, cut.end.port]
            self.u[[start + i for i in components]] = value[list(components)]
        self.point = Point(engine, tick, self.structure.sampled, offsets, ends)
        self.columns = self._columns(self.point, states)
        self._check(self.point)

    def _first(self, inputs: Sequence[str]) -> dict[Port, int]:
        """The number of the first label of each input."""
        first: dict[Port, int] = {}
        self.inputs: tuple[str, ...] = ()
        driven: list[str] = []
        for text in inputs:
            port, whole, component = _input_at(self.network, text)
            names = labels(whole, self.network.types[port])
            if port not in first:
                first[port] = len(self.inputs)
                self.inputs += tuple(names)
            known = self.inputs[first[port] : first[port] + len(names)]
            driven += [known[i] for i in _numbers(self.network, port, component, text)]
        self.driven = frozenset(driven)
        return first

    def _cut_loop(self, cut: Watched, first: dict[Port, int], others: bool) -> tuple[int, ...]:
        """Add the signal at the cut to the inputs; its components at which readers are cut off."""
        key = cut.end.block, cut.end.port
        every = labels(f"{cut.end.block}.{cut.end.port}", self.network.types[key])
        inside = tuple(range(len(every))) if cut.numbers is None else cut.numbers
        if key not in first:
            first[key] = len(self.inputs)
            self.inputs += tuple(every)
        if not others:
            self.driven = frozenset(self.inputs[first[key] + i] for i in inside)
        return inside

    def value_of(self, watched: Watched) -> FloatArray:
        """The numbers of a signal, with nothing added and nothing cut."""
        closed = Point(self.engine, self.tick, self.structure.sampled, Offsets(), [watched])
        return closed.tick(0, self._columns(closed, self.states), np.zeros(0))[1]

    def _columns(self, point: Point, states: Mapping[str, Any]) -> FloatArray:
        """The numbers at the point, with the outputs of a tick there."""
        columns = point.values()
        known = point.columns[: sum(point.sizes[:2])]
        for address, value in states.items():
            place = [i for i, name in enumerate(known) if name.startswith(f"{address}.")]
            place = [i for i, name in enumerate(known) if name == address] or place
            if not place:
                near = hint(address, known) or f"; the states are {', '.join(known) or 'none'}"
                raise UsageError(f"no state '{address}'{near}")
            array = np.asarray(value, dtype=np.float64)
            if array.size not in (1, len(place)):
                raise UsageError(f"'{address}' has {len(place)} numbers, got {array.size}")
            columns[place] = array.ravel()
        u = self.u if len(point.offsets.first) else np.zeros(0)
        held = sum(point.sizes[:2])
        try:
            columns[held:] = point.tick(0, columns, u)[0][held:]
            rates = point.flow(columns, u)[0]
        except WRONG as error:
            message = f"a block has no value at the operating point: {error}; choose another with "
            raise UsageError(message + "--at or --state") from None
        for i in np.flatnonzero(~np.isfinite(rates)):
            message = f"the rate of change of {known[i]} has no value at the operating point"
            raise UsageError(f"{message}; choose another with --at or --state")
        return columns

    def _check(self, point: Point) -> None:
        drawing = point.drawing(self.columns, self.u)
        if drawing:
            names = ", ".join(f"'{name}'" for name in drawing)
            one = len(drawing) == 1
            raise UsageError(
                f"{names} draw{'s' * one} random numbers, of which there is no derivative; leave "
                f"{'it' if one else 'them'} out with --without or --bypass {','.join(drawing)}"
            )


def _engine(network: Network, at: float, period: int) -> tuple[Engine, int]:
    """An engine that has run up to a time at which all sampled blocks act, and its tick."""
    tick = math.ceil(round(at / network.dt) / period) * period
    network = replace(network, until=tick * network.dt) if tick else network
    engine = Engine(Program(network, Observation()), network.seed)
    if not tick:
        engine.prepare()
        return engine, 0
    outcome = engine.run()
    if outcome.error is not None:
        raise outcome.error
    return engine, outcome.ticks


def _input_at(network: Network, text: str) -> tuple[Port, str, str]:
    """The input or output of a block to which an offset is added: its address, and a component."""
    for whole, component in ((text, ""), (text.rpartition(".")[0], text.rpartition(".")[2])):
        if whole in network.inputs:
            end = network.inputs[whole].end
            return (end.block, end.port), whole, component
        block, _, port = whole.rpartition(".")
        entry = network.entries.get(block)
        if entry is not None and port in entry.cls.spec.inputs:
            if entry.cls.spec.inputs[port].variadic:
                raise UsageError(f"'{whole}' takes many wires; name the output that drives it")
            return (block, port), whole, component
    end = output_at(network, text)
    if end.port in network.entries[end.block].cls.spec.states:
        raise UsageError(f"'{text}': expected an input or output of a block, or a component of one")
    return (end.block, end.port), _whole(text, end), end.component


def _signal_at_cut(network: Network, text: str) -> Watched:
    watched, _ = _watch(network, text)
    if watched.is_state:
        raise UsageError(f"'{text}': expected an output of a block, at which the loop is cut")
    return watched


def _watch(network: Network, text: str) -> tuple[Watched, list[str]]:
    """What is read at an address, and the addresses of its numbers."""
    end = output_at(network, text)
    port = end.block, end.port
    names, whole = _names(network, port), _whole(text, end)
    labelled = [f"{whole}.{name}" if name else whole for name in names]
    is_state = end.port in network.entries[end.block].cls.spec.states
    if not end.component:
        return Watched(end, is_state), labelled
    numbers = _numbers(network, port, end.component, text)
    return Watched(replace(end, component=""), is_state, numbers), [labelled[i] for i in numbers]


def _whole(text: str, end: Endpoint) -> str:
    """An address without its component."""
    if not end.component:
        return text
    return text.rpartition("[" if text.endswith("]") else ".")[0]


def _names(network: Network, port: Port) -> list[str]:
    """The components of a signal or a state, number by number; [''] if it is a number."""
    entry = network.entries[port[0]]
    spec = entry.cls.spec
    if port[1] not in spec.states:
        return [each[1:] for each in labels("", network.types[port])]
    shape = state_shape(entry.block, spec.states[port[1]], network.context(port[0]))
    named = entry.block.state_names.get(port[1], ())
    return list(named or map(str, range(math.prod(shape)))) if shape else [""]


def _numbers(network: Network, port: Port, component: str, text: str) -> tuple[int, ...]:
    """Which numbers of a signal or a state a component is: by name, by number, or a range."""
    names = _names(network, port)
    if not component:
        return tuple(range(len(names)))
    if component in names:
        return (names.index(component),)
    found = None if names == [""] else columns(Vector(len(names)), component)
    if found is None:
        has = hint(component, names) or f"; it has {', '.join(filter(None, names)) or 'none'}"
        raise UsageError(f"'{text}': there is no component '{component}'{has}")
    return tuple(range(len(names))[found]) if isinstance(found, slice) else (found,)


def output_at(network: Network, text: str) -> Endpoint:
    """The output or state of a block at an address.

    Raises
    ------
    UsageError : there is none.
    """
    try:
        end = find(network.scope, text).end
    except AddressError as error:
        raise UsageError(str(error)) from None
    message = check_output(network, end, states=True)
    if message or end.block not in network.entries:
        raise UsageError(message or f"'{end.block}' is removed")
    return end
