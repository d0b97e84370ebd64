"""The plan: a graph's evaluations in a fixed order, written as one straight-line function."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from blocks.core import Evaluation, Input, SignalType
from blocks.registry import is_built_in
from runtime.engine.continuous import Continuous, continuous_part, needed
from runtime.engine.naming import CONTINUOUS_NAMES, identifiers
from runtime.engine.order import ordered_steps
from runtime.engine.solvers import method_of
from runtime.engine.steps import Step, drivers
from runtime.engine.terms import absent_value, finite_test
from runtime.network import Endpoint, Network, columns, component_type, enables_of, resets
from runtime.observation import StopTest

INDENT = "    "
# When a run stops: conditions on the distance ``beyond`` of a signal from the level. The compiled
# plan has the same, in C.
CONDITIONS = {
    "above": "beyond > 0.0",
    "below": "beyond < 0.0",
    "crosses": "(stop[3] < 0.0 and beyond >= 0.0) or (stop[3] > 0.0 and beyond <= 0.0)",
}


@dataclass(frozen=True)
class RecordSlot:
    """One recorded column group: the rows of an array that a tick fills.

    ``array`` names the array in the function; ``columns`` is the slice it fills, None for all.
    With ``rows``, the array is a buffer of that many, filled again and again. ``publisher`` is the
    method of the block that describes what is recorded, once.
    """

    array: str
    end: Endpoint
    every: int
    columns: slice | None = None
    is_state: bool = False
    is_event: bool = False
    constant: bool = False
    rows: int = 0
    publisher: str = ""

    @property
    def row(self) -> str:
        """The row that tick k fills, as an expression."""
        row = "k" if self.every == 1 else f"k // {self.every}"
        return f"{row} % {self.rows}" if self.rows else row


@dataclass
class Plan:
    """The order of a graph's evaluations, and their names in the function.

    ``names`` maps blocks to their names, ``variables`` (block, port) to the names of outputs and
    (block, "") to those of states. ``continuous`` is what a solver integrates between two ticks.
    ``enables`` has, of each block in a part that runs only at times, the blocks that switch it;
    ``variables`` (block, "0") names the copies of its states as they were after ``start``.
    """

    network: Network
    steps: list[Step]
    names: dict[str, str]
    variables: dict[tuple[str, str], str]
    continuous: Continuous | None = None
    enables: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def make_plan(network: Network) -> Plan:
    """Order a network's evaluations.

    Raises
    ------
    GraphError : naming every algebraic loop.
    """
    enables = enables_of(network)
    order = ordered_steps(network, enables)
    continuous = continuous_part(network, order, drivers(network))
    reserved = CONTINUOUS_NAMES if continuous is not None or network.stop is not None else ()
    return Plan(network, order, *identifiers(network, reserved, enables), continuous, enables)


class Emitter:
    """Writes the function of a plan line by line; ``lines`` maps lines to the blocks they call.

    An emitter is for one text and one thread: runs share the plan and finished texts.
    """

    def __init__(
        self, plan: Plan, recordings: list[RecordSlot], stop: StopTest | None = None
    ) -> None:
        self.plan = plan
        self.stop = stop
        self.dt = repr(plan.network.dt)
        self.leave = ""
        self.network = plan.network
        self.recordings = recordings
        self.wires = drivers(plan.network)
        self.text: list[str] = []
        self.lines: dict[int, str] = {}
        self.rate = 0
        self.depth = 2

    def emit(self, checked: bool = False, held: Sequence[str] | None = None) -> str:
        """The source; ``checked`` adds checks of every value's form, as on the first tick.

        ``held`` are the variables that are returned; by default :meth:`held`.
        """
        incoming = self.held()
        held = incoming if held is None else held
        self.leave = f"return ({', '.join(held)},)" if held else "return ()"
        self.line(0, "def run(first, last, held):")
        # The title is user text: it must not end the docstring or continue a line.
        title = "".join(c for c in self.network.title if c.isprintable() and c not in '"\\')
        self.line(1, f'"""{title}: base step {self.network.dt!r} {self.network.time_unit}."""')
        if incoming:
            self.line(1, f"({', '.join(incoming)},) = held")
        self.line(1, "for k in range(first, last):")
        self.line(2, f"t = k * {self.network.dt!r}")
        for step in self.plan.steps:
            if not step.constant:
                self.step(step, checked)
        self.record(events=False)
        if self.stop is not None:
            self.stop_at_tick(self.stop)
        for name, every, update in self.updates():
            self.at(every)
            self.update(name, update)
        for name in self.resetting():
            self.reset(name)
        if self.plan.continuous is not None:
            self.at(1)
            self.search(self.plan.continuous, self.integrate, checked)
        self.record(events=True)
        self.line(1, self.leave)
        return "\n".join(self.text) + "\n"

    def stop_at_tick(self, stop: StopTest) -> None:
        """End the run at a tick at which the condition holds."""
        self.at(stop.signal.every)
        self.code(f"beyond = {self.tested(stop)} - {stop.level!r}")
        self.code(f"if {CONDITIONS[stop.kind]}:")
        self.code(f"{INDENT}stop[2], stop[4], stop[5] = 1.0, k, t")
        self.code(INDENT + self.leave)
        self.code("stop[3] = beyond")

    def tested(self, stop: StopTest) -> str:
        """The signal that may end the run, as an expression."""
        signal = stop.signal
        if not signal.is_state:
            return self.value(signal.end)
        return self.state_value(signal.end) + ("" if signal.end.component else "[()]")

    def is_searched(self, part: Continuous) -> bool:
        """Whether the signal that may end the run changes between ticks."""
        if self.stop is None:
            return False
        end = self.stop.signal.end
        states = {(slot.block, slot.state) for slot in part.slots}
        return (end.block, end.port) in part.moving | states

    def watched(self, part: Continuous) -> tuple[Step, ...]:
        """The evaluations that compute the signal that may end the run, between ticks."""
        if self.stop is None or self.stop.signal.is_state:
            return ()
        end = self.stop.signal.end
        return needed([(end.block, end.port)], self.plan.steps, self.wires, part.moving)

    def search(self, part: Continuous, integrate: Callable[..., None], *given: Any) -> None:
        """Integrate to the next tick, or to the time in between at which the run stops."""
        dt = self.dt
        if self.stop is None or not self.is_searched(part):
            integrate(part, dt, *given)
            return
        self.copied("origin", "states")
        self.code(f"stop[0], stop[1], span = 0.0, {dt}, {dt}")
        self.code("while span > 0.0:")
        self.depth += 1
        self.copied("states", "origin")
        integrate(part, "span", *given)
        self.code(f"t = k * {dt} + span")
        for step in self.watched(part):
            self.again(step)
        self.code(f"beyond = {self.tested(self.stop)} - {self.stop.level!r}")
        self.code(f"span = narrowed(stop, {CONDITIONS[self.stop.kind]}, span, {dt})")
        self.depth -= 1
        self.code("if stop[2] > 0.0:")
        self.code(f"{INDENT}stop[4], stop[5] = k, k * {dt} + stop[1]")
        self.code(INDENT + self.leave)

    def copied(self, target: str, source: str) -> None:
        """Copy one row of states into another."""
        self.code(f"{target}[:] = {source}")

    def integrate(self, part: Continuous, span: str, checked: bool = False) -> None:
        """Integrate the continuous states over a span from the tick."""
        name, dt = self.network.solver.name, self.dt
        method = method_of(name, part.size)
        h, since = span, f"nodes[stage] * {span}"
        if method.errors:
            h, since = "h", "(done + nodes[stage] * h)"
            self.code("done = 0.0")
            self.code(f"while done < {span}:")
            self.depth += 1
            self.code(f"h = substep(control, done, {span})")
        self.copied("start", "states")
        self.code(f"for stage in range({method.stages}):  # {name}")
        self.depth += 1
        self.code(f"t = k * {dt} + {since}")
        for step in part.steps:
            self.again(step)
        for block, derivative in part.derivatives:
            self.slope(part, block, derivative, checked)
        self.code("isfinite(sum(slopes[stage].tolist())) or bad_slope(stage, t)")
        self.code(f"blend(states, start, slopes, weights, stage, {h})")
        self.depth -= 1
        if method.errors:
            self.code(f"done = judged(states, start, slopes, errors, control, done, h, {span})")
            self.code("done >= 0.0 or unreached(done, t)")
        for block in part.projected:
            self.code(f"{self.plan.names[block]}.project({self.state(block)})", block)
        self.depth -= bool(method.errors)

    def again(self, step: Step) -> None:
        """Call an evaluation at a stage of the solver."""
        self.step(step)

    def slope(self, part: Continuous, block: str, derivative: Evaluation, checked: bool) -> None:
        """Write the rates of change of a block's states into the row of the stage."""
        slots = part.slots_of(block)
        targets = ", ".join(f"slopes[stage, {slot.place}]" for slot in slots)
        around = "{}"
        if any(len(slot.shape) > 1 for slot in slots):
            targets, around = f"slopes[stage, {slots[0].start}:{slots[-1].stop}]", "joined({})"
        if checked:
            around = around.format(f"rates({block!r}, {{}})")
        enables = self.plan.enables.get(block, ())
        with self.enabled(enables):
            self.call(block, derivative, f"{targets} = ", around=around)
        if enables:
            self.code("else:")
            self.code(f"{INDENT}slopes[stage, {slots[0].start}:{slots[-1].stop}] = 0.0")

    def update(self, name: str, update: Evaluation) -> None:
        """Call an update; no event happens in a part that is off."""
        enables, states = (
            self.plan.enables.get(name, ()),
            self.network.entries[name].cls.spec.states,
        )
        with self.enabled(enables):
            self.updated(name, update)
        events = [state for state, declared in states.items() if declared.event]
        if enables and events:
            self.code("else:")
            for event in events:
                self.code(f"{INDENT}{self.state_value(Endpoint(name, event))}[...] = 0.0")

    def updated(self, name: str, update: Evaluation) -> None:
        self.call(name, update, "")

    @contextmanager
    def enabled(self, enables: Sequence[str]) -> Iterator[None]:
        """Write what follows under the condition that the parts around a block run."""
        if enables:
            self.code(f"if {self.all_on(enables)}:")
        self.depth += bool(enables)
        yield
        self.depth -= bool(enables)

    def all_on(self, enables: Sequence[str]) -> str:
        return " and ".join(self.variable(name, "on") for name in enables)

    def resetting(self) -> list[str]:
        """The blocks that reset the part that they are in while it is off."""
        found = dict.fromkeys(name for names in self.plan.enables.values() for name in names)
        return [name for name in found if resets(self.network, name)]

    def reset(self, enable: str) -> None:
        """Bring the states of a part that is off back to what they were after ``start``."""
        self.at(self.network.entries[enable].every)
        states = self.switched_states(enable)
        if states:
            self.code(f"if not {self.variable(enable, 'on')}:")
        for name, state in states:
            initial = self.initial_state(name, state)
            self.code(f"{INDENT}{self.state_value(Endpoint(name, state))}[...] = {initial}")

    def switched_states(self, enable: str) -> list[tuple[str, str]]:
        """The states, by block and name, of the part that a block switches."""
        switched = [name for name, above in self.plan.enables.items() if enable in above]
        return [(n, s) for n in switched for s in self.network.entries[n].cls.spec.states]

    def initial_state(self, block: str, state: str) -> str:
        return f"{self.plan.variables[block, '0']}.{state}"

    def held(self) -> list[str]:
        """The variables that outlive a call: outputs of blocks that are slow, or switched."""
        kept = [s for s in self.plan.steps if (s.every > 1 or s.enables) and not s.constant]
        return [self.variable(s.block, port) for s in kept for port in s.evaluation.outputs]

    def updates(self) -> list[tuple[str, int, Evaluation]]:
        """Every block with an update, in the order in which they are updated."""
        entries = sorted(self.network.entries.items(), key=lambda e: (e[1].every, e[0]))
        specs = [(name, entry.every, entry.cls.spec.update) for name, entry in entries]
        return [(name, every, update) for name, every, update in specs if update is not None]

    def variable(self, block: str, port: str) -> str:
        return self.plan.variables[block, port]

    def state(self, block: str) -> str:
        return self.plan.variables[block, ""]

    def line(self, depth: int, text: str, block: str = "") -> None:
        self.text.append(INDENT * depth + text)
        if block:
            self.lines[len(self.text)] = block

    def at(self, every: int) -> None:
        """Set the rate: the code that follows runs on every ``every``-th tick."""
        if every != self.rate and every > 1:
            self.line(self.depth, f"if k % {every} == 0:")
        self.rate = every

    def code(self, text: str, block: str = "") -> None:
        self.line(self.depth + (self.rate > 1), text, block)

    def step(self, step: Step, checked: bool = False) -> None:
        """Call an evaluation, and check its outputs."""
        self.at(step.every)
        with self.enabled(step.enables):
            self.evaluation(step, checked)
        self.zeroed(step)

    def zeroed(self, step: Step) -> None:
        """Set the outputs of a part that is off to zero, if it is reset."""
        resetting = [name for name in step.enables if resets(self.network, name)]
        if resetting:
            same = len(resetting) == len(step.enables)
            self.code("else:" if same else f"if not ({self.all_on(resetting)}):")
            for port in step.evaluation.outputs:
                zero = absent_value(self.network.types[step.block, port], 0.0)
                self.code(f"{INDENT}{self.variable(step.block, port)} = {zero}")

    def evaluation(self, step: Step, checked: bool) -> None:
        targets = [self.variable(step.block, port) for port in step.evaluation.outputs]
        around = f"checked({step.block!r}, {step.evaluation.outputs!r}, {{}})" if checked else "{}"
        self.call(step.block, step.evaluation, ", ".join(targets) + " = ", around)
        kinds = [self.network.types[step.block, port] for port in step.evaluation.outputs]
        own = not is_built_in(self.network.entries[step.block].cls)
        for target, kind in zip(targets, kinds, strict=True):
            if own:
                self.code(f"{target} = floats({target})", step.block)
            if kind.form == "array":
                self.code(f"{target} = sealed({target})", step.block)
        test = finite_test(dict(zip(targets, kinds, strict=True)))
        which = ", ".join(map(repr, (step.block, step.evaluation.method)))
        self.code(f"{test} or not_finite({which}, {', '.join(targets)})", step.block)

    def call(self, block: str, evaluation: Evaluation, targets: str, around: str = "{}") -> None:
        """Call a method; ``around`` is what the call is wrapped in."""
        name = self.plan.names[block]
        arguments = [self.state(block), "t", *self.arguments(block, evaluation)]
        call = f"{name}.{evaluation.method}({', '.join(arguments)})"
        self.code(targets + around.format(call), block)

    def arguments(self, block: str, evaluation: Evaluation) -> list[str]:
        """An evaluation's arguments as expressions: inputs, and outputs of the block itself."""
        inputs = self.network.entries[block].cls.spec.inputs
        return [
            self.argument(block, port, inputs[port])
            if port in inputs
            else self.variable(block, port)
            for port in evaluation.needs
        ]

    def argument(self, block: str, port: str, declared: Input) -> str:
        """The expression that an input port reads."""
        wires = self.wires.get((block, port), [])
        target = self.network.types[block, port]
        values = [self.value(wire.source, target) for wire in wires]
        if declared.variadic:
            return f"({', '.join(values)},)" if values else "()"
        return values[0] if values else absent_value(target, declared.default)

    def value(self, end: Endpoint, target: SignalType | None = None) -> str:
        """A signal, or a component of it, in the form of the target."""
        kind = self.network.types[end.block, end.port]
        text = self.variable(end.block, end.port)
        if end.component:
            column = columns(kind, end.component)
            if isinstance(column, slice):
                text = f"{text}[{column.start}:{column.stop}]"
                text = f"array({text})" if kind.form == "record" else text
            else:
                text = f"{text}.item({column})" if kind.form == "array" else f"{text}[{column}]"
            kind = component_type(kind, end) or kind
        if target is not None and target.form != kind.form:
            return f"array(({text},))" if target.form == "array" else f"{text}.item(0)"
        return text

    def state_value(self, end: Endpoint) -> str:
        item = f"[{end.component}]" if end.component else ""
        return f"{self.state(end.block)}.{end.port}{item}"

    def record(self, events: bool) -> None:
        for recording in self.recordings:
            if recording.is_event != events or recording.constant:
                continue
            self.at(recording.every)
            self.recorded(recording)

    def recorded(self, recording: RecordSlot) -> None:
        """One row of one recording."""
        row = recording.row
        if recording.columns is not None:
            row += f", {recording.columns.start}:{recording.columns.stop}"
        end = recording.end
        value = self.state_value(end) if recording.is_state else self.value(end)
        self.code(f"{recording.array}[{row}] = {value}")
