"""A plan made of a network and of what is observed of it.

In goes a checked network, out comes a :class:`.operations.Plan`. A tick is

1. outputs, producers before consumers, each tested for NaN and infinity,
2. rows of the probes, and the condition that ends the run,
3. updates of states, from the outputs of this tick,
4. states of parts that are off and reset, set back,
5. the continuous states, integrated to the next tick,
6. rows of events, such as spikes, which the updates have written.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace

from blocks.core import Evaluation
from blocks.library.registry import is_built_in
from runtime.network import Endpoint, Network, Wire, enables_of, resets
from runtime.observation import Observation
from runtime.plan.coupling import Coupling
from runtime.plan.crossings import (
    MOST_EVENTS,
    changing,
    directions,
    edges_between,
    is_momentary,
    meets,
    padded,
)
from runtime.plan.moving import Evaluated, again, continuous_row, declared_states, read_by
from runtime.plan.operations import (
    Call,
    Crossing,
    Gate,
    Integrate,
    Operation,
    Plan,
    Record,
    Restore,
    Solve,
    Stop,
    Test,
    Zero,
    calls_in,
)
from runtime.plan.order import ordered
from runtime.plan.passes import coupled
from runtime.plan.values import (
    Argument,
    GuardSlot,
    Port,
    Signal,
    Source,
    StateArray,
    Target,
)
from runtime.solvers import SOLVERS


def make_plan(
    network: Network, observation: Observation, buffers: Mapping[str, int] | None = None
) -> Plan:
    """The plan of a network.

    Parameters
    ----------
    buffers : by probe, the rows of the buffer that ticks fill again and again; 0 or absent for an
        array of the whole run.

    Raises
    ------
    GraphError : naming every algebraic loop.
    """
    return _Builder(network, observation, buffers or {}).plan()


class _Builder:
    """The parts of a plan, in the order of a tick."""

    def __init__(
        self, network: Network, observation: Observation, buffers: Mapping[str, int]
    ) -> None:
        self.network, self.observation, self.buffers = network, observation, buffers
        self.wires = defaultdict[Port, list[Wire]](list)
        for wire in network.driving:
            self.wires[wire.block, wire.port].append(wire)
        # One object per signal: what is equal is found by its key, and shares memory.
        self.signals = {key: Signal(*key, kind) for key, kind in network.types.items()}
        self.states = {name: declared_states(network, name) for name in network.entries}
        self.switches = {
            name: tuple(self.signals[switch, "on"] for switch in switches)
            for name, switches in enables_of(network).items()
        }
        self.row = continuous_row(network)
        self.located: frozenset[str] = frozenset()
        if self.row.size:
            self.find_events()

    def find_events(self) -> None:
        """Which blocks have events between ticks, at which times sources jump, what may change."""
        network, switches = self.network, self.switches
        adaptive = SOLVERS[network.solver].is_adaptive
        guarded = {name: directions(network, name, adaptive) for name in network.entries}
        self.directions = {name: found for name, found in guarded.items() if found}
        self.edges = edges_between(network, network.entries)
        changed = changing(network, self.wires, switches, self.directions, {*self.edges})
        self.changing = changed
        self.located = frozenset(
            name for name in self.directions if meets(network, self.wires, name, changed)
        )

    def plan(self) -> Plan:
        """All operations, in order."""
        network = self.network
        evaluations = [
            (each, tuple(test for call in calls_in([each]) for test in self.after(call)))
            for each in self.evaluations()
        ]
        records = list(self.records())
        stop = self.stop()
        operations: list[Operation] = [op for call, rest in evaluations for op in (call, *rest)]
        operations += [record for record, is_event in records if not is_event]
        operations += [] if stop is None or self.is_located(stop) else [stop]
        operations += self.updates()
        operations += self.restores()
        operations += [self.integration(evaluations, stop)] if self.row.size else []
        operations += [record for record, is_event in records if is_event]
        return Plan(
            network.title,
            network.dt,
            network.time_unit,
            network.solver,
            tuple(operations),
            self.states,
        )

    def evaluations(self) -> list[Call | Solve]:
        """The calls that compute outputs, and loops of them, in order."""
        calls = []
        for name, entry in self.network.entries.items():
            every, offset = entry.output_rate
            for evaluation in entry.evaluations:
                constant = entry.cls.spec.is_constant(evaluation)
                # What depends on states alone needs no switch: they hold.
                timed = evaluation.timed and not entry.block.recalls
                varies = bool(evaluation.needs) or timed
                switches = self.switches.get(name, ()) if varies and not constant else ()
                outputs = tuple(self.signals[name, port] for port in evaluation.outputs)
                gate = Gate(every, switches, False, constant, offset, starts=offset > 0)
                calls.append(self.call(name, evaluation, outputs, gate))
        return ordered(calls, self.wires, self.network.loops == "solve")

    def call(
        self, name: str, evaluation: Evaluation, writes: tuple[Target, ...], gate: Gate
    ) -> Call:
        arguments = tuple(self.argument(name, port) for port in evaluation.needs)
        is_own = not is_built_in(self.network.entries[name].cls)
        return Call(name, evaluation.method, arguments, writes, gate, is_own=is_own)

    def argument(self, name: str, port: str) -> Argument:
        """What an input, or an output of the block itself, gives to a method."""
        kind = self.network.types[name, port]
        declared = self.network.entries[name].cls.spec.inputs.get(port)
        if declared is None:
            return Argument(name, port, kind, (Source(self.signals[name, port]),))
        sources = tuple(self.source(wire.source) for wire in self.wires.get((name, port), ()))
        default = float(declared.default or 0.0)
        is_variadic = bool(declared.variadic)
        return Argument(name, port, kind, sources, is_variadic, default, declared.fills)

    def source(self, end: Endpoint) -> Source:
        return Source(self.signals[end.block, end.port], end.component)

    def observed(self, end: Endpoint, is_state: bool) -> Source:
        """An output, or a state, that is recorded or that ends the run."""
        if not is_state:
            return self.source(end)
        states = {state.name: state for state in self.states[end.block]}
        return Source(states[end.port], end.component)

    def after(self, call: Call) -> Iterator[Operation]:
        """What follows the call of an evaluation."""
        gate, outputs = call.gate, call.outputs
        if gate.once:
            return
        yield Test(call.block, call.method, outputs, gate)
        resetting = tuple(s for s in gate.switches if resets(self.network, s.block))
        if resetting:
            yield Zero(call.block, outputs, replace(gate.rate, switches=resetting, is_off=True))

    def updates(self) -> Iterator[Operation]:
        """The updates of states by rate, then by name; no event happens in a part that is off."""
        for name, entry in sorted(self.network.entries.items(), key=lambda e: (e[1].every, e[0])):
            spec = entry.cls.spec
            if spec.update is None:
                continue
            # What a block with continuous states does in place of events that are located.
            if spec.continuous and spec.event is not None and self.network.is_located(name):
                continue
            gate = Gate(entry.every, self.switches.get(name, ()), offset=entry.offset)
            yield self.call(name, spec.update, self.states[name], gate)
            events = tuple(s for s in self.states[name] if spec.states[s.name].event)
            if gate.switches and events:
                yield Zero(name, events, replace(gate, is_off=True))

    def restores(self) -> Iterator[Restore]:
        """The parts that are reset while they are off."""
        switches = dict.fromkeys(s for above in self.switches.values() for s in above)
        for switch in switches:
            inside = [name for name, above in self.switches.items() if switch in above]
            states = tuple(state for name in inside for state in self.states[name])
            if resets(self.network, switch.block) and states:
                entry = self.network.entries[switch.block]
                gate = Gate(entry.every, (switch,), is_off=True, offset=entry.offset)
                yield Restore(switch.block, states, gate)

    def integration(self, evaluations: list[Evaluated], stop: Stop | None) -> Integrate:
        """The continuous states from this tick to the next one."""
        network = self.network
        specs = {name: network.entries[name].cls.spec for name in self.row.by_block}
        derivatives = [
            self.call(name, method, self.row.of(name), self.gate_of(name))
            for name, spec in specs.items()
            if (method := spec.derivative)
        ]
        stage = list(again(read_by(derivatives), evaluations, network.moving))
        for call in derivatives:
            stage.append(call)
            if call.gate.switches:
                off = Gate(1, call.gate.switches, is_off=True)
                stage.append(Zero(call.block, call.writes, off))
        projections = tuple(
            Call(name, "project", (), self.states[name], takes_time=False)
            for name, spec in specs.items()
            if spec.projects
        )
        part = Integrate(
            row=self.row,
            solver=network.solver,
            stage=tuple(stage),
            projections=projections,
            time_unit=network.time_unit,
        )
        if SOLVERS[part.solver].is_implicit:
            contexts = {name: network.context(name) for name in specs}
            own = {name: network.entries[name].block.couplings(contexts[name]) for name in specs}
            part = replace(part, coupling=Coupling.of(coupled(self.row, stage, own)))
        return self.with_events(part, evaluations, stop)

    def gate_of(self, name: str) -> Gate:
        """When a block takes part between ticks."""
        return Gate(1, self.switches.get(name, ()))

    def with_events(
        self, part: Integrate, evaluations: list[Evaluated], stop: Stop | None
    ) -> Integrate:
        """Integration whose steps end at events, and at edges of the sources that it reads."""
        network = self.network
        crossings: list[Crossing] = []
        for name in sorted(self.located):
            spec, found = network.entries[name].cls.spec, self.directions[name]
            start = crossings[-1].stop if crossings else 0
            slot = GuardSlot(name, "guards", (len(found),), start)
            event = None
            if spec.guards is None:
                continue
            if spec.event is not None:
                event = self.call(name, spec.event, self.states[name], self.gate_of(name))
                event = replace(event, takes_which=True)
            guards = self.call(name, spec.guards, (slot,), self.gate_of(name))
            crossings.append(Crossing(guards, start, found, event))
        if stop is not None and self.is_located(stop):
            start = crossings[-1].stop if crossings else 0
            crossings.append(Crossing(stop, start, (stop.direction,)))
        met = [each for c in crossings for each in (c.guards, c.event) if each is not None]
        momentary = {name for name in self.located if is_momentary(network, name)}
        calls = [call for call, _ in evaluations if isinstance(call, Call)]
        parts = [c for c in calls if {switch.block for switch in c.gate.switches} & momentary]
        inside = [signal.key for call in parts for signal in call.outputs]
        wanted = [*read_by(met), *read_by(part.stage), *inside]
        every = again(wanted, evaluations, network.types)
        blocks = {each.block for each in every if isinstance(each, Call)}
        edges = [times for name, times in self.edges.items() if name in blocks]
        is_left = any(network.entries[name].block.jumps for name in blocks & network.entries.keys())
        is_left = is_left and network.events == "located"
        if not (crossings or edges or is_left):
            return part
        return replace(
            part,
            crossings=tuple(crossings),
            watch=again(read_by(met), evaluations, network.moving),
            after=(*again(wanted, evaluations, self.changing), *self.triggered(evaluations)),
            edges=padded(edges),
            log=MOST_EVENTS if self.observation.events else 0,
            is_left=is_left,
        )

    def triggered(self, evaluations: list[Evaluated]) -> Iterator[Operation]:
        """What follows an event that triggers parts: their updates, and they are off again."""
        for name in sorted(self.located):
            entry = self.network.entries[name]
            if not is_momentary(self.network, name) or entry.cls.spec.update is None:
                continue
            for other, above in sorted(self.switches.items()):
                spec, switches = self.network.entries[other].cls.spec, [s.block for s in above]
                if name in switches and spec.update is not None:
                    yield self.call(other, spec.update, self.states[other], self.gate_of(other))
            yield self.call(name, entry.cls.spec.update, self.states[name], self.gate_of(name))
            yield from again([(name, "on")], evaluations, {(name, "on")})

    def is_located(self, stop: Stop) -> bool:
        """Whether the condition that ends the run may be met between two ticks."""
        whole = stop.source.whole
        if not self.row.size or self.network.events == "ticks":
            return False
        return (
            whole.key in self.changing if isinstance(whole, Signal) else self.is_continuous(whole)
        )

    def is_continuous(self, whole: StateArray) -> bool:
        """Whether it is a state that a solver integrates."""
        return any(slot.name == whole.name for slot in self.row.of(whole.block))

    def stop(self) -> Stop | None:
        test = self.observation.stop
        if test is None:
            return None
        source = self.observed(test.signal.end, test.signal.is_state)
        return Stop(
            test.direction, test.level, source, Gate(math.gcd(test.signal.every, test.signal.first))
        )

    def records(self) -> Iterator[tuple[Record, bool]]:
        """The rows, or columns, that a tick fills, and whether they show events."""
        for number, probe in enumerate(self.observation.probes.values()):
            (every, first), start, width = probe.inputs, 0, math.prod(probe.shape)
            for signal in probe.signals:
                stop = start + signal.width
                record = Record(
                    probe.name,
                    number,
                    self.observed(signal.end, signal.is_state),
                    width,
                    slice(start, stop) if len(probe.signals) > 1 else None,
                    self.buffers.get(probe.name, 0),
                    signal.publisher,
                    Gate(every, once=probe.constant, offset=first),
                )
                start = stop
                yield record, signal.is_event
