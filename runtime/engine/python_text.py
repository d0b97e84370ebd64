"""The printer of a plan as Python: one straight-line function, with a line for each call.

In go operations and the names of their values, out comes text, and which block each line calls.
``call b.out: Scalar = b.output(t, a.out)  [every 10]``, with its test, becomes::

    if k % 10 == 0:
        b_out = b.output(b_s, t, a_out)
        isfinite(b_out) or not_finite('b', 'output', b_out)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from blocks.core import SignalType
from runtime.engine.naming import Names
from runtime.engine.python_values import absent, finite_test
from runtime.plan import (
    ALWAYS,
    Argument,
    Call,
    Gate,
    GuardSlot,
    Integrate,
    Operation,
    Plan,
    Record,
    Restore,
    Signal,
    Slot,
    Solve,
    Source,
    Step,
    Stop,
    Test,
    Zero,
)
from runtime.solvers import Method, method_of

INDENT = "    "
# How much before an edge, in ticks, a source shows what it is before: more than its tolerance.
EARLIER = 4e-9
# The operations of a piece at least: Python's compiler takes a hundred times a text's memory.
PIECE = 1000
# When a run stops at a tick, by direction: conditions on the distance ``beyond`` of a signal from
# the level and that of the last tick, NaN on the first one. The compiled plan has them in C.
CONDITIONS = {
    1.0: "stop[1] <= 0.0 and beyond > 0.0",
    -1.0: "stop[1] >= 0.0 and beyond < 0.0",
    0.0: "(stop[1] < 0.0 and beyond >= 0.0) or (stop[1] > 0.0 and beyond <= 0.0)",
}


class PythonText:
    """Writes operations line by line; ``lines`` maps lines to the blocks they call.

    Parameters
    ----------
    checked : with checks of every value's form, as on the first tick.
    profiled : with a clock around each call.
    """

    def __init__(
        self, plan: Plan, names: Names, checked: bool = False, profiled: bool = False
    ) -> None:
        self.plan, self.names = plan, names
        self.checked, self.profiled = checked, profiled
        self.dt = repr(plan.dt)
        self.leave = ""
        self.text: list[str] = []
        self.lines: dict[int, str] = {}
        self.rate = ALWAYS
        self.depth = 2
        self.between_ticks = False
        self.printers: dict[type[Any], Callable[[Any], None]] = {
            Call: self.call,
            Solve: self.solve,
            Test: self.test,
            Zero: self.zero,
            Restore: self.restore,
            Record: self.record,
            Stop: self.stop_at_tick,
            Integrate: self.integrate,
        }

    def function(
        self, operations: Sequence[Step], incoming: Sequence[str], outgoing: Sequence[str]
    ) -> str:
        """``run(first, last, held)``, which takes and returns the variables that outlive a tick."""
        self.leave = f"return ({', '.join(outgoing)},)" if outgoing else "return ()"
        self.line(0, "def run(first, last, held):")
        # The title is user text: it must not end the docstring or continue a line.
        title = "".join(c for c in self.plan.title if c.isprintable() and c not in '"\\')
        self.line(1, f'"""{title}: base step {self.dt} {self.plan.time_unit}."""')
        if incoming:
            self.line(1, f"({', '.join(incoming)},) = held")
        self.line(1, "for k in range(first, last):")
        self.line(2, f"t = k * {self.dt}")
        self.operations(operations)
        self.line(1, self.leave)
        return "\n".join(self.text) + "\n"

    def pieces(self, operations: Sequence[Operation]) -> Iterator[str]:
        """The statements of one tick as texts that are executed one after the other.

        A piece ends where the run may. Lines are numbered through all of them.
        """
        self.depth, self.leave = 0, "pass"
        first, last = 0, len(operations) - 1
        for i, each in enumerate(operations):
            if i - first < PIECE and i < last and not isinstance(each, (Stop, Integrate)):
                continue
            begin = len(self.text)
            self.rate = ALWAYS
            self.operations(operations[first : i + 1])
            yield "\n" * begin + "\n".join(self.text[begin:]) + "\n"
            first = i + 1

    def line(self, depth: int, text: str, block: str = "") -> None:
        self.text.append(INDENT * depth + text)
        if block:
            self.lines[len(self.text)] = block

    def code(self, text: str, block: str = "") -> None:
        self.line(self.depth + (self.rate.every > 1), text, block)

    # Gates

    def operations(self, operations: Sequence[Step]) -> None:
        """Write operations in order, each under its gate; those done once are left out."""
        before: Step | None = None
        for each in operations:
            if each.gate.once:
                continue
            self.at(each.gate.rate)
            # A call with its tests is under one condition, and each call has its own.
            if not self.continues(before, each) and each.gate.switches:
                self.code(self.condition(before, each.gate))
            self.depth += bool(each.gate.switches)
            self.printers[type(each)](each)
            self.depth -= bool(each.gate.switches)
            before = each

    def at(self, rate: Gate) -> None:
        """Set the rate: the code that follows runs on the ticks on which it is due."""
        if rate != self.rate and rate.every > 1:
            self.line(self.depth, f"if {rate.due('k').format('or')}:")
        self.rate = rate

    def continues(self, before: Step | None, each: Step) -> bool:
        """Whether an operation is under the condition of the one before it."""
        return (
            before is not None
            and not isinstance(each, Call)
            and (before.gate, before.block) == (each.gate, each.block)
        )

    def condition(self, before: Step | None, gate: Gate) -> str:
        """The line that opens what is done while switches are on, or while one is off."""
        if gate.is_off and before is not None and before.gate == replace(gate, is_off=False):
            return "else:"
        on = " and ".join(map(self.names.of, gate.switches))
        on = f"({on})" if gate.is_off and len(gate.switches) > 1 else on
        return f"if {'not ' * gate.is_off}{on}:"

    # Calls

    def call(self, call: Call) -> None:
        """Call a method, and bring what it returns into the form of signals."""
        targets, around = list(map(self.names.of, call.outputs)), "{}"
        if call.outputs and self.checked and not self.between_ticks:
            ports = tuple(signal.port for signal in call.outputs)
            around = f"checked({call.block!r}, {ports!r}, {{}})"
        elif call.rates:
            targets, around = self.slopes(call)
        given = [self.names.states[call.block], *["t"] * call.takes_time]
        given += ["float(which)"] * call.takes_which
        given += map(self.argument, call.arguments)
        text = f"{self.names.blocks[call.block]}.{call.method}({', '.join(given)})"
        if call.is_own and len(call.outputs) > 1 and around == "{}":
            ports = tuple(signal.port for signal in call.outputs)
            around = f"several({ports!r}, {{}})"
        equals = f"{', '.join(targets)} = " if targets else ""
        profiled = self.profiled and call.takes_time
        if profiled:
            self.code("began = clock()")
        self.code(equals + around.format(text), call.block)
        if profiled:
            self.code(f"spent({call.block!r}, began)")
        for signal in call.outputs:
            target = self.names.of(signal)
            if call.is_own:
                place = f"{call.block!r}, {signal.port!r}"
                self.code(f"{target} = floats({place}, {target})", call.block)
            if signal.kind.form == "array":
                self.code(f"{target} = sealed({target})", call.block)

    def slopes(self, call: Call) -> tuple[list[str], str]:
        """Where rates of change are written in the row of the stage, and what makes them fit."""
        if isinstance(call.rates[0], GuardSlot):
            return [f"guards[{_place(call.rates[0])}]"], "{}"
        targets, around = [f"slopes[stage, {_place(slot)}]" for slot in call.rates], "{}"
        if any(len(slot.shape) > 1 for slot in call.rates):
            targets, around = [_whole(call.rates)], "joined({})"
        # An array of another shape may fit by being repeated.
        if self.checked or (call.is_own and any(slot.shape for slot in call.rates)):
            around = around.format(f"rates({call.block!r}, {{}})")
        return targets, around

    def argument(self, argument: Argument) -> str:
        """The expression that a method gets."""
        values = [self.source(source, argument.kind) for source in argument.sources]
        if argument.is_variadic:
            return f"({', '.join(values)},)" if values else "()"
        return values[0] if values else absent(argument.kind, argument.default)

    def source(self, source: Source, target: SignalType | None = None) -> str:
        """A signal, or a component of it, in the form of the target; or a state."""
        whole = source.whole
        if not isinstance(whole, Signal):
            item = f"[{source.component}]" if source.component else ""
            return f"{self.names.states[whole.block]}.{whole.name}{item}"
        text, kind = self.names.of(whole), whole.kind
        if source.component:
            column = source.columns
            if isinstance(column, slice):
                text = f"{text}[{column.start}:{column.stop}]"
                text = f"array({text})" if kind.form == "record" else text
            else:
                text = f"{text}.item({column})" if kind.form == "array" else f"{text}[{column}]"
            kind = source.kind
        if target is None or target.form == kind.form != "array" or target.shape == kind.shape:
            return text
        if target.form != "array":
            return f"{text}.item(0)"
        return f"array(({text},))" if target.shape == (1,) else f"full({target.shape!r}, {text})"

    def test(self, test: Test) -> None:
        """Test what a call returned; ``not_finite`` looks again, and raises the error."""
        values = {self.names.of(signal): signal.kind for signal in test.outputs}
        given = ", ".join([repr(test.block), repr(test.method), *values])
        self.code(f"{finite_test(values)} or not_finite({given})", test.block)

    def solve(self, solve: Solve) -> None:
        """Try values of the unknowns, until the calls compute the same."""
        memory = f"loop_{solve.number}"
        control = f"{memory}_control"
        self.code(f"going = begun({memory}, {control})")
        self.code("while going > 0.0:")
        self.depth += 1
        for signal, start, stop in solve.slots:
            name, values = self.names.of(signal), f"{memory}[0, {start}:{stop}]"
            forms = {
                "scalar": f"{memory}.item(0, {start})",
                "record": f"tuple({values}.tolist())",
                "array": f"sealed({values}.reshape({signal.kind.shape!r}).copy())",
            }
            self.code(f"{name} = {forms[signal.kind.form]}")
        for call in solve.calls:
            self.call(call)
        for signal, start, stop in solve.slots:
            flat = ".ravel()" if signal.kind.form == "array" else ""
            self.code(f"{memory}[1, {start}:{stop}] = {self.names.of(signal)}{flat}")
        self.code(f"going = newton({memory}, {control})")
        self.depth -= 1
        self.code(f"going == 0.0 or unsolved_{solve.number}(going, t)")

    # States and recordings

    def zero(self, zero: Zero) -> None:
        rates = [target for target in zero.targets if isinstance(target, Slot)]
        if rates:
            self.code(f"{_whole(rates)} = 0.0")
            return
        for target in zero.targets:
            if isinstance(target, Signal):
                self.code(f"{self.names.of(target)} = {absent(target.kind, 0.0)}")
            else:
                self.code(f"{self.source(Source(target))}[...] = 0.0")

    def restore(self, restore: Restore) -> None:
        for state in restore.states:
            initial = f"{self.names.initial[state.block]}.{state.name}"
            self.code(f"{self.source(Source(state))}[...] = {initial}")

    def record(self, record: Record) -> None:
        """One row of one recording."""
        place = row(record)
        if record.columns is not None:
            place += f", {record.columns.start}:{record.columns.stop}"
        self.code(f"probe_{record.number}[{place}] = {self.source(record.source)}")

    def stop_at_tick(self, stop: Stop) -> None:
        """End the run at a tick at which the condition holds."""
        self.code(f"beyond = {self.tested(stop)}")
        self.code(f"if {CONDITIONS[stop.direction]}:")
        self.code(f"{INDENT}stop[0], stop[2], stop[3] = 1.0, k, t")
        self.code(INDENT + self.leave)
        self.code("stop[1] = beyond")

    def tested(self, stop: Stop) -> str:
        """The distance of the signal that may end the run from the level."""
        is_whole_state = not (isinstance(stop.source.whole, Signal) or stop.source.component)
        return f"{self.source(stop.source)}{'[()]' * is_whole_state} - {stop.level!r}"

    # The continuous part

    def integrate(self, part: Integrate) -> None:
        """Integrate to the next tick, or to the time in between at which the run stops."""
        self.between_ticks = True  # the form of outputs was checked at the tick
        method = method_of(part.solver, part.colours)
        if method.errors:
            self.code(f"control[8] = k * {self.dt}")
        if part.ends_steps:
            self.located(part, method)
        elif method.errors:
            self.code("done = 0.0")
            self.code(f"while done < {self.dt}:")
            self.depth += 1
            self.code(f"h = substep(control, done, {self.dt})")
            self.code("start[:] = states")
            self.attempt(part, method)
            given = (
                f"states, start, slopes, errors, control, {method.exponent!r}, done, h, {self.dt}"
            )
            self.code(f"done = accept_step({given})")
            self.code("done >= 0.0 or unreached(done, t)")
            self.operations(part.projections)
            self.depth -= 1
        else:
            self.code("start[:] = states")
            self.stages(part, method, self.dt, f"nodes[stage] * {self.dt}")
            self.operations(part.projections)
        self.between_ticks = False

    def stages(self, part: Integrate, method: Method, h: str, since: str) -> None:
        """The stages of one step of the solver."""
        self.code(f"for stage in range({method.stages}):  # {part.solver}")
        self.depth += 1
        last = f", k * {self.dt} + search.item(2) - {EARLIER * self.plan.dt!r})"
        time = f"k * {self.dt} + {since}"
        self.code(f"t = min({time}{last}" if part.is_left else f"t = {time}")
        self.operations(part.stage)
        self.code("isfinite(sum(slopes[stage].tolist())) or bad_slope(stage, t)")
        self.code(f"blend(states, start, slopes, weights, stage, {h})")
        self.depth -= 1

    def attempt(self, part: Integrate, method: Method, undo: str = "") -> None:
        """A step that is too long where a stage is beyond what a rate of change is defined for."""
        self.code("try:")
        self.depth += 1
        self.stages(part, method, "h", "(done + nodes[stage] * h)")
        self.depth -= 1
        self.code("except (ArithmeticError, ValueError):")
        self.code(f"{INDENT}if reject_step(states, start, control, h) < 0.0:")
        self.code(f"{INDENT * 2}raise")
        if undo:
            self.code(f"{INDENT}{undo}")
        self.code(f"{INDENT}continue")

    def located(self, part: Integrate, method: Method) -> None:
        """Integrate in steps that end at edges and events; see ``engine/events.py``."""
        dt = self.dt
        self.code(f"opened(search, edges, k * {dt}, {dt})")
        self.code("while search[0] > 0.0:")
        self.depth += 1
        self.code("done = search.item(1)")
        self.code(f"h = proposed(search, sides, edges, k * {dt}, {dt})")
        self.code("if h > 0.0:")
        self.depth += 1
        self.ending_step(part, method)
        self.depth -= 1
        self.code(f"t = k * {dt} + (done + h)")
        self.operations(part.watch)
        for crossing in part.crossings:
            if isinstance(crossing.guards, Stop):
                self.code(f"guards[{crossing.start}] = {self.tested(crossing.guards)}")
            else:
                self.operations([crossing.guards])
        self.code(f"found = decided(search, sides, directions, guards, fired, h, {dt})")
        self.code("if found == 1.0:")
        self.code(f"{INDENT}continue")
        self.code("found < 4.0 or restless(t)")
        self.operations(part.projections)
        self.code("if found > 1.0:")
        self.depth += 1
        self.happened(part)
        self.depth -= 2
        if self.plan.can_stop:
            self.code("if stop[0] > 0.0:")
            self.code(INDENT + self.leave)

    def ending_step(self, part: Integrate, method: Method) -> None:
        """A step, or a shorter one from the same start."""
        self.code("if search[0] == 2.0:")
        if method.errors:
            self.code(f"{INDENT}h = substep(control, done, done + h)")
        self.code(f"{INDENT}start[:] = states")
        self.code("else:")
        self.code(f"{INDENT}states[:] = start")
        if not method.errors:
            self.stages(part, method, "h", "(done + nodes[stage] * h)")
            return
        self.attempt(part, method, "search[0] = 2.0")
        self.code("if search[0] == 2.0:")
        given = f"states, start, slopes, errors, control, {method.exponent!r}, done, h, search[2]"
        self.code(f"{INDENT}reached = accept_step({given})")
        self.code(f"{INDENT}reached >= 0.0 or unreached(reached, t)")
        self.code(f"{INDENT}if reached == done:")
        self.code(f"{INDENT * 2}continue")

    def happened(self, part: Integrate) -> None:
        """What follows at the time of an event or an edge."""
        self.code(f"t = k * {self.dt} + search.item(1)")
        if part.log:
            self.code("noted(log, count, fired, t)")
        for crossing in part.crossings:
            if isinstance(crossing.guards, Stop):
                self.code(f"if fired[{crossing.start}] > 0.0:")
                self.code(f"{INDENT}stop[0], stop[2], stop[3], search[0] = 1.0, k, t, 0.0")
            elif crossing.event is not None:
                self.code(f"for which in range({len(crossing.directions)}):")
                self.code(f"{INDENT}if fired[{crossing.start} + which] > 0.0:")
                self.depth += 2
                self.operations([crossing.event])
                self.depth -= 2
        self.operations(part.after)


def row(record: Record) -> str:
    """The row that tick k fills, as an expression."""
    every = record.gate.every
    number = "k" if every == 1 else f"k // {every}"
    return f"{number} % {record.rows}" if record.rows else number


def _place(slot: Slot) -> str:
    """The subscript of a state in a row."""
    return f"{slot.start}:{slot.stop}" if slot.shape else str(slot.start)


def _whole(slots: Sequence[Slot]) -> str:
    """All numbers of one block in the row of a stage."""
    return f"slopes[stage, {slots[0].start}:{slots[-1].stop}]"
