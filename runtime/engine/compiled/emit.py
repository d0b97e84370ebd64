"""The compiled plan: a straight-line function over compiled blocks, cut where others are called.

The items of a tick (outputs, probes, updates, events) keep the plan's order. Blocks that do not
compile cut it into parts: ``run(first, last, low, high, ...)`` runs the parts from ``low`` up to
``high``, and a Python loop calls the blocks between them. If all blocks compile, or on ticks on
which none of the others is called, one call runs several ticks.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from blocks.core import Evaluation, SignalType
from runtime.engine.compiled.kernels import Kernel
from runtime.engine.compiled.stages import assigned, source_of
from runtime.engine.continuous import Continuous
from runtime.engine.schedule import INDENT, Emitter, Plan, RecordSlot
from runtime.engine.solvers import METHODS, first_bad, judged, keep, moved, narrowed, substep
from runtime.engine.steps import Step
from runtime.network import Endpoint
from runtime.observation import StopTest

Call = tuple[str, Evaluation]
# What ``at[2]`` says: an output or a rate of change is not finite, or the tolerance is not met.
BAD_OUTPUT, BAD_SLOPE, UNREACHED = 1, 2, 3
_ITEM = re.compile(r"\.item\(([0-9]+)\)")
HEADER = """from math import isfinite

from numba import njit
from numpy import array, ascontiguousarray, full

from runtime.engine.compiled.primitives import all_finite, no_nan, overlap, seen
"""


@dataclass
class Item:
    """One item of a tick: an evaluation, a row of a recording, or the continuous part."""

    every: int
    block: str = ""
    step: Step | None = None
    update: Evaluation | None = None
    recording: RecordSlot | None = None
    continuous: Continuous | None = None
    stop: StopTest | None = None
    reset: str = ""


@dataclass
class CompiledText:
    """The text of a plan, and how to call it.

    ``arguments`` are the names of the arguments of ``run`` after ``held``: a block's fields (see
    :func:`fields_name`), a constant's variable, ``block_s.state`` for a recorded state, a probe's
    array. ``calls`` lists the evaluations by their number in ``at``. ``driver`` is the Python loop
    around it, empty if nothing is called between its ``parts``.
    """

    text: str
    arguments: list[str]
    calls: list[Call]
    held: list[str]
    driver: str = ""
    parts: int = 1
    lines: dict[int, str] = field(default_factory=dict)


class CompiledEmitter(Emitter):
    """Writes the plan of a graph for numba.

    Parameters
    ----------
    kernels : the blocks that are compiled, by name; the others are called from Python.
    """

    def __init__(
        self,
        plan: Plan,
        recordings: list[RecordSlot],
        kernels: dict[str, Kernel],
        stop: StopTest | None = None,
    ) -> None:
        super().__init__(plan, recordings, stop)
        self.kernels = kernels
        self.taken: dict[str, None] = {}
        self.calls: list[Call] = []
        self.constants = {
            self.variable(step.block, port)
            for step in plan.steps
            if step.constant
            for port in step.evaluation.outputs
        }

    def compiled(self) -> CompiledText:
        """The whole text."""
        self.text, self.lines, self.rate = [], {}, 0
        self.taken, self.calls = {}, []
        parts = self.parts()
        cut = len(parts) > 1
        self.depth = 3 if cut else 2
        held = self.crossing() if cut else self.held()
        self.dt, self.leave = "dt", f"return ({', '.join(held)},)" if held else "return ()"
        for number, part in enumerate(parts):
            if cut:
                self.line(2, f"if low <= {number} < high:")
                self.line(3, "pass")
            self.rate = 0
            for item in part:
                self.item(item)
        body, self.text = self.text, []
        arguments = list(self.taken)
        names = [name.replace(".", "__") for name in arguments]
        packed = f"({', '.join(held)},)" if held else "()"
        head = ", ".join(["first", "last", "low", "high", "dt", "at", "report", "held", *names])
        whole = "\n".join(body)
        imports = [
            f"from {kernel.module} import {function} as {self.kernel(name, method)}"
            for name, kernel in sorted(self.kernels.items())
            for method, function in kernel.methods.items()
            if f"{self.kernel(name, method)}(" in whole
        ]
        lines = [
            *(HEADER, *imports, "", ""),
            *([self.helpers()] if self.plan.continuous is not None else []),
            '@njit(cache=True, error_model="python")',
            f"def run({head}):",
            *([f"{INDENT}{packed} = held"] if held else []),
            f"{INDENT}for k in range(first, last):",
            f"{INDENT * 2}at[1] = k",
            f"{INDENT * 2}t = k * dt",
            *body,
            f"{INDENT}{self.leave}",
        ]
        text = "\n".join(lines) + "\n"
        made = CompiledText(text, arguments, self.calls, held, parts=len(parts))
        if cut:
            self.drive(made, held)
        return made

    def kernel(self, block: str, method: str) -> str:
        """The name of a block's function in the text."""
        return f"kernel__{self.plan.names[block]}__{method}"

    def items(self) -> list[Item]:
        """All items of a tick, in order."""
        recordings = [r for r in self.recordings if not r.constant]
        return [
            *(Item(s.every, s.block, step=s) for s in self.plan.steps if not s.constant),
            *(Item(r.every, recording=r) for r in recordings if not r.is_event),
            *([] if self.stop is None else [Item(self.stop.signal.every, stop=self.stop)]),
            *(Item(every, name, update=update) for name, every, update in self.updates()),
            *(Item(self.network.entries[n].every, reset=n) for n in self.resetting()),
            *([] if self.plan.continuous is None else [Item(1, continuous=self.plan.continuous)]),
            *(Item(r.every, recording=r) for r in recordings if r.is_event),
        ]

    def is_python(self, item: Item) -> bool:
        """Whether the item calls a block that is not compiled."""
        if item.continuous is not None:
            return not self.kernels.keys() >= item.continuous.blocks
        return bool(item.block) and item.block not in self.kernels

    def parts(self) -> list[list[Item]]:
        """The compiled items between the calls of blocks that are not compiled."""
        parts: list[list[Item]] = [[]]
        for item in self.items():
            if self.is_python(item):
                parts.append([])
            else:
                parts[-1].append(item)
        return parts

    def crossing(self) -> list[str]:
        """The variables of a plan that is cut: all outputs go in and out."""
        steps = [s for s in self.plan.steps if not s.constant]
        return [self.variable(s.block, port) for s in steps for port in s.evaluation.outputs]

    def helpers(self) -> str:
        """The functions that the continuous part calls."""
        adaptive = METHODS[self.network.solver.name].errors
        functions = (keep, first_bad, moved, *((substep, judged) if adaptive else ()))
        part = self.plan.continuous
        functions += (narrowed,) if part is not None and self.is_searched(part) else ()
        return "\n".join(source_of(each) for each in functions)

    def item(self, item: Item) -> None:
        self.at(item.every)
        if item.recording is not None:
            self.recorded(item.recording)
            return
        if item.stop is not None:
            self.take("stop")
            self.stop_at_tick(item.stop)
            return
        if item.continuous is not None:
            if self.is_searched(item.continuous):
                self.take("stop"), self.take("origin")
            self.search(item.continuous, self.stages)
            return
        if item.reset:
            self.reset(item.reset)
        elif item.update is not None:
            self.update(item.block, item.update)
        elif item.step is not None:
            with self.enabled(item.step.enables):
                self.compiled_step(item, item.step.evaluation)
            self.zeroed(item.step)

    def compiled_step(self, item: Item, evaluation: Evaluation) -> None:
        """Call an evaluation, and check its outputs."""
        call = self.called(item.block, evaluation)
        targets = [self.variable(item.block, port) for port in evaluation.outputs]
        self.code(f"{', '.join(targets)} = {call}")
        kinds = [self.network.types[item.block, port] for port in evaluation.outputs]
        kernel = self.kernels[item.block]
        for text in kernel.casts.get(evaluation.method, ()):
            self.code(text.format(*targets))
        for target, kind in zip(targets, kinds, strict=True):
            fields = self.take(fields_name(self.plan, item.block))
            shared = [f"overlap({target}, {fields}{at})" for at in kernel.made.arrays]
            if kind.form == "array" and shared:
                self.code(f"if {' or '.join(shared)}:")
                self.code(f"{INDENT}{target} = {target}.copy()")
        self.test(dict(zip(targets, kinds, strict=True)))

    def called(self, block: str, evaluation: Evaluation) -> str:
        """A call of a block's function; writes its number into ``at``."""
        self.code(f"at[0] = {len(self.calls)}")
        self.calls.append((block, evaluation))
        fields = self.take(fields_name(self.plan, block))
        arguments = [fields, "t", *self.arguments(block, evaluation)]
        return f"{self.kernel(block, evaluation.method)}({', '.join(arguments)})"

    def copied(self, target: str, source: str) -> None:
        if self.dt == "dt":
            self.code(f"keep({target}, {source})")
        else:
            super().copied(target, source)

    def stages(self, part: Continuous, span: str) -> None:
        """Integrate the continuous states over a span from the tick, in compiled text."""
        method = METHODS[self.network.solver.name]
        states, start, slopes, table = map(self.take, ("states", "start", "slopes", "table"))
        h, since = span, f"{table}[stage, {method.stages}] * {span}"
        if method.errors:
            h, since = "h", f"(done + {table}[stage, {method.stages}] * h)"
            control, errors = map(self.take, ("control", "errors"))
            self.code("done = 0.0")
            self.code(f"while done < {span}:")
            self.depth += 1
            self.code(f"h = substep({control}, done, {span})")
        self.copied(start, states)
        self.code(f"for stage in range({method.stages}):  # {self.network.solver.name}")
        self.depth += 1
        self.code(f"t = k * dt + {since}")
        for step in part.steps:
            self.again(step)
        for block, derivative in part.derivatives:
            enables, slots = self.plan.enables.get(block, ()), part.slots_of(block)
            if enables:
                self.code(f"{slopes}[stage, {slots[0].start}:{slots[-1].stop}] = 0.0")
            with self.enabled(enables):
                self.code(f"rates = {self.called(block, derivative)}")
                for text in assigned(slots):
                    self.code(text)
        self.code(f"if first_bad({slopes}, stage) >= 0:")
        self.end(BAD_SLOPE, "stage", "t")
        self.code(f"moved({states}, {start}, {slopes}, {table}, stage, {h})")
        self.depth -= 1
        if method.errors:
            given = f"{states}, {start}, {slopes}, {errors}, {control}, done, h, {span}"
            self.code(f"done = judged({given})")
            self.code("if done < 0.0:")
            self.end(UNREACHED, "done", "t")
        for block in part.projected:
            fields = self.take(fields_name(self.plan, block))
            self.code(f"{self.kernel(block, 'project')}({fields})")
        self.depth -= bool(method.errors)

    def end(self, why: int, *report: str) -> None:
        """End the call, in a branch; ``report`` are values for the message."""
        for i, value in enumerate(report):
            self.code(f"{INDENT}report[{i}] = {value}")
        self.code(f"{INDENT}at[2] = {why}")
        self.code(INDENT + self.leave)

    def test(self, signals: dict[str, SignalType]) -> None:
        """Stop where a value is not finite; ``report`` then holds the outputs."""
        entries: list[str] = []
        tests: list[str] = []
        numbers: list[str] = []
        for variable, kind in signals.items():
            if kind.form == "array":
                tests.append(f"{'all_finite' if kind.finite else 'no_nan'}({variable})")
                entries.append(f'0.0 if {tests[-1]} else float("nan")')
                continue
            parts = (
                [variable]
                if kind.form == "scalar"
                else [f"{variable}[{i}]" for i in range(len(kind.components))]
            )
            entries += parts
            numbers += parts
        if numbers:
            tests.insert(0, f"isfinite({' + '.join(numbers)})")
        self.code(f"if not ({' and '.join(tests)}):")
        self.end(BAD_OUTPUT, *entries)

    def take(self, name: str) -> str:
        """Add an argument of ``run``; returns its name in the text."""
        self.taken[name] = None
        return name.replace(".", "__")

    def variable(self, block: str, port: str) -> str:
        name = super().variable(block, port)
        if name in getattr(self, "constants", ()):
            self.taken[name] = None
        return name

    def value(self, end: Endpoint, target: SignalType | None = None) -> str:
        text = _subscripts(super().value(end, target))
        return f"seen({text})" if target is not None and target.form == "array" else text

    def arguments(self, block: str, evaluation: Evaluation) -> list[str]:
        inputs = self.network.entries[block].cls.spec.inputs
        return [
            text
            if port in inputs or self.network.types[block, port].form != "array"
            else f"seen({text})"
            for port, text in zip(
                evaluation.needs, super().arguments(block, evaluation), strict=True
            )
        ]

    def state_value(self, end: Endpoint) -> str:
        item = f"[{end.component}]" if end.component else ""
        return self.take(f"{self.state(end.block)}.{end.port}") + item

    def initial_state(self, block: str, state: str) -> str:
        return self.take(super().initial_state(block, state))

    def recorded(self, recording: RecordSlot) -> None:
        end = recording.end
        kind = self.network.types.get((end.block, end.port))
        array = self.take(recording.array)
        if recording.is_state or kind is None or kind.form != "record" or end.component:
            super().recorded(recording)
            return
        row = recording.row
        first = recording.columns.start if recording.columns is not None else 0
        value = self.value(end)
        for i in range(len(kind.components)):
            self.code(f"{array}[{row}, {first + i}] = {value}[{i}]")

    def drive(self, made: CompiledText, held: list[str]) -> None:
        """Write the Python loop that calls blocks that are not compiled between the parts."""
        self.text, self.lines, self.rate, self.depth = [], {}, 0, 2
        self.dt, self.leave = repr(self.network.dt), f"return ({', '.join(held)},)"
        items = [item for item in self.items() if self.is_python(item)]
        rates = sorted({item.every for item in items})
        packed = f"({', '.join(held)},)"
        self.line(0, "def drive(first, last, held):")
        self.line(1, "k = first")
        self.line(1, f"{packed} = held")
        halted = "" if self.stop is None else " and not stop[2]"
        self.line(1, f"while k < last{halted}:")
        following = ", ".join(f"-(-k // {every}) * {every}" for every in rates)
        self.line(2, f"due = min(last, {following})")
        self.line(2, "if k < due:")
        self.line(3, f"{packed} = run(k, due, 0, {len(items) + 1}, {packed})")
        self.line(3, "k = due")
        self.line(3, "continue")
        self.line(2, f"t = k * {self.network.dt!r}")
        for number, item in enumerate(items):
            self.rate = 0
            self.line(2, f"{packed} = run(k, k + 1, {number}, {number + 1}, {packed})")
            if self.stop is not None:
                self.line(2, "if stop[2]:")
                self.line(3, self.leave)
            self.at(item.every)
            if item.step is not None:
                self.python_step(item.step)
            elif item.update is not None:
                self.update(item.block, item.update)
            elif item.continuous is not None:
                self.search(item.continuous, self.integrate)
        self.line(2, f"{packed} = run(k, k + 1, {len(items)}, {len(items) + 1}, {packed})")
        self.line(2, "k += 1")
        self.line(1, f"return {packed}")
        made.driver, made.lines = "\n".join(self.text) + "\n", self.lines

    def updated(self, name: str, update: Evaluation) -> None:
        if self.dt == "dt":
            self.code(self.called(name, update))
        else:
            Emitter.call(self, name, update, "")

    def again(self, step: Step) -> None:
        if self.dt == "dt":
            self.item(Item(1, step.block, step=step))
        else:
            self.python_step(step)

    def python_step(self, step: Step) -> None:
        self.step(step)
        for port in step.evaluation.outputs:
            target = self.variable(step.block, port)
            self.code(f"{target} = {as_held(target, self.network.types[step.block, port])}")


def fields_name(plan: Plan, block: str) -> str:
    """The name in the text of a block's fields, the first argument of its functions."""
    return f"fields__{plan.names[block]}"


def as_held(variable: str, kind: SignalType) -> str:
    """An expression that gives a value exactly the form that compiled text expects."""
    if kind.form == "scalar":
        return f"float({variable})"
    if kind.form == "record":
        return f"({', '.join(f'float({variable}[{i}])' for i in range(len(kind.components)))},)"
    return f"own({variable})"


def _subscripts(text: str) -> str:
    """``x.item(3)`` as ``x[3]``, also inside ``array((x.item(3),))``."""
    return _ITEM.sub(r"[\1]", text)
