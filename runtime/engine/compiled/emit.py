"""The plan in C: one call per block, cut where blocks are called from Python.

The items of a tick (outputs, probes, updates, events) keep the plan's order. Blocks that do not
compile cut it into parts: ``run(plan, ctx, first, last, low, high)`` runs the parts from ``low`` up
to ``high``, and a Python loop calls the blocks between them. If all blocks compile, or on ticks on
which none of the others is called, one call runs several ticks. All outputs are in one struct,
whose layout :class:`.structs.PlanText` states.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

from blocks.core import Evaluation, SignalType
from runtime.compiler import PROJECT
from runtime.engine.compiled.driver import Driver, Item
from runtime.engine.compiled.plan_text import RUN, count, literal, sizes
from runtime.engine.compiled.stages import (
    after_stage,
    around_search,
    before_stage,
    condition,
    rates,
    solver_unit,
)
from runtime.engine.compiled.structs import PlanText, StructEmitter
from runtime.engine.continuous import Continuous
from runtime.engine.schedule import RecordSlot
from runtime.engine.solvers import method_of
from runtime.engine.steps import Step
from runtime.network import Endpoint, resets
from runtime.observation import StopTest

# What ``run`` returns: an output is not finite, a block failed, the solver cannot integrate (a rate
# of change is not finite, or its tolerance is not met), or the run's condition to stop holds.
FINISHED, NOT_FINITE, FAILED, NOT_INTEGRATED, STOPPED = range(5)
SOLVER = ("states", "start", "slopes", "table", "errors", "control")


class CompiledEmitter(StructEmitter):
    """Writes the plan of a graph in C."""

    def compiled(self) -> PlanText:
        """The whole text."""
        self.made, self.declared = PlanText(), []
        self.text, self.lines, self.rate = [], {}, 0
        parts = self.parts()
        cut = len(parts) > 1
        self.made.parts = len(parts)
        for number, part in enumerate(parts):
            self.depth = 2
            if cut:
                self.line(2, f"if (low <= {number} && {number} < high) {{")
                self.depth = 3
            self.rate = 0
            for item in part:
                self.item(item)
            self.at(0)
            if cut:
                self.line(2, "}")
        body, self.text = self.text, []
        if cut:
            items = [item for item in self.items() if self.is_python(item)]
            driver = Driver(self, items)
            self.made.driver, self.made.lines = driver.written(), driver.lines
        used = {e for kernel in self.kernels.values() for e in kernel.prototypes} | self.own
        self.made.text = "\n".join(
            [
                "struct plan {",
                *self.declared,
                *([] if self.declared else ["    int64_t none;"]),
                "};",
                "",
                *sorted(f"{prototype};" for prototype in used),
                RUN.replace("@dt@", repr(self.network.dt)).replace("@body@", "\n".join(body)),
            ]
        )
        return self.made

    # The tick

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
            part = item.continuous
            searched = {step.block for step in self.watched(part)}
            return not self.kernels.keys() >= part.blocks | searched
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

    def at(self, every: int) -> None:
        """Set the rate: the code that follows runs on every ``every``-th tick."""
        if every == self.rate:
            return
        if self.rate > 1:
            self.line(self.depth, "}")
        if every > 1:
            self.line(self.depth, f"if (k % {every} == 0) {{")
        self.rate = every

    def item(self, item: Item) -> None:
        self.at(item.every)
        if item.recording is not None:
            self.row(item.recording)
            return
        if item.stop is not None:
            self.stop_at_tick(item.stop)
            return
        if item.continuous is not None:
            self.continue_states(item.continuous)
            return
        if item.reset:
            self.reset(item.reset)
        elif item.update is not None:
            self.update(item.block, item.update)
        elif item.step is not None:
            self.step(item.step)

    def step(self, step: Step, checked: bool = False) -> None:
        """Call an evaluation, and check its outputs; those of a part that is reset are zero."""
        outputs = [self.signal(step.block, port) for port in step.evaluation.outputs]
        places = [text for name, kind in outputs for text in self.place(name, kind)]
        with self.enabled(step.enables):
            number = self.called(step.block, step.evaluation, places)
            wrong = f"ctx->at = {number}; return {NOT_FINITE};"
            self.code(f"if (!({' && '.join(self.tests(outputs))})) {{ {wrong} }}")
        resetting = [name for name in step.enables if resets(self.network, name)]
        if resetting:
            self.code(f"if (!({self.all_on(resetting)})) {{")
            for name, kind in outputs:
                self.code(f"    set_zero({self.place(name, kind)[0]}, {count(kind)});")
            self.code("}")

    def updated(self, name: str, update: Evaluation) -> None:
        self.called(name, update, [])

    @contextmanager
    def enabled(self, enables: Sequence[str]) -> Iterator[None]:
        if enables:
            self.code(f"if ({self.all_on(enables)}) {{")
        self.depth += bool(enables)
        yield
        self.depth -= bool(enables)
        if enables:
            self.code("}")

    def all_on(self, enables: Sequence[str]) -> str:
        return " && ".join(f"plan->{self.signal(name, 'on')[0]} != 0.0" for name in enables)

    def update(self, name: str, update: Evaluation) -> None:
        enables = self.plan.enables.get(name, ())
        with self.enabled(enables):
            self.updated(name, update)
        states = self.network.entries[name].cls.spec.states
        events = [state for state, declared in states.items() if declared.event]
        if enables and events:
            self.code(f"if (!({self.all_on(enables)})) {{")
            for event in events:
                place = self.address(Endpoint(name, event), is_state=True)
                self.code(f"    set_zero({place}, {self.state_size(name, event)});")
            self.code("}")

    def reset(self, enable: str) -> None:
        states = self.switched_states(enable)
        if states:
            self.code(f"if (!({self.all_on([enable])})) {{")
            for name, state in states:
                place = self.address(Endpoint(name, state), is_state=True)
                member = f"initial_{self.plan.names[name]}_{state}"
                initial = self.pointer(member, ("initial", name, state))
                size = self.state_size(name, state)
                self.code(f"    copy_numbers({place}, {initial}, {size});")
            self.code("}")

    def place(self, name: str, kind: SignalType) -> list[str]:
        """The address of an output, and the sizes that no text tells."""
        pointer = f"&plan->{name}" if kind.form == "scalar" else f"plan->{name}"
        return [pointer, *sizes(kind)]

    def called(self, block: str, evaluation: Evaluation, outputs: list[str]) -> int:
        """Call a block's method; returns the number of the call.

        ``outputs`` are the places that it writes to. A block that cannot fail leaves no number.
        """
        number = len(self.made.calls)
        if self.kernels[block].failures:
            self.code(f"ctx->at = {number};")
        self.made.calls.append((block, evaluation))
        fields = self.pointer(f"fields_{self.plan.names[block]}", ("fields", block, ""))
        time = [] if evaluation is PROJECT else ["t"]
        arguments = ["ctx", fields, *time, *self.inputs(block, evaluation), *outputs]
        self.code(f"{self.kernels[block].symbols[evaluation.method]}({', '.join(arguments)});")
        return number

    def stop_at_tick(self, stop: StopTest) -> None:
        place = self.pointer("stop", ("array", "stop", ""))
        self.code("{")
        self.code(f"    double *const stop = {place};")
        self.code(f"    const double beyond = {self.distance(stop)};")
        self.code(f"    if ({condition(stop.kind)}) {{")
        self.code("        stop[2] = 1.0, stop[4] = (double)k, stop[5] = t;")
        self.code(f"        return {STOPPED};")
        self.code("    }")
        self.code("    stop[3] = beyond;")
        self.code("}")

    def distance(self, stop: StopTest) -> str:
        """The distance of the signal that may end the run from the level."""
        place = self.address(stop.signal.end, stop.signal.is_state)
        return f"({place})[0] - {literal(stop.level)}"

    def continue_states(self, part: Continuous) -> None:
        """Integrate to the next tick, or to the time in between at which the run stops."""
        searched = self.is_searched(part)
        method = method_of(self.network.solver.name, part.size)
        self.made.solver, prototypes = solver_unit(part, method, searched)
        self.own |= set(prototypes)
        if self.stop is None or not searched:
            self.stages(part, "dt")
            return
        arrays = (self.solver("states"), self.solver("origin"))
        place = self.pointer("stop", ("array", "stop", ""))
        before, after = around_search(*arrays, place, STOPPED)
        self.codes(before)
        self.depth += 2
        self.stages(part, "span")
        self.code("const double t = (double)k * dt + span;")
        for step in self.watched(part):
            self.step(step)
        self.code(f"beyond = {self.distance(self.stop)};")
        met = condition(self.stop.kind)
        self.code(f"solver_narrowed(ctx, NULL, stop, {met}, span, dt, &span);")
        self.depth -= 2
        self.codes(after)

    def codes(self, lines: Iterable[str]) -> None:
        for text in lines:
            self.code(text)

    def solver(self, array: str) -> str:
        """One of the solver's arrays."""
        return self.pointer(f"solver_{array}", ("array", array, ""))

    def stages(self, part: Continuous, span: str) -> None:
        """Integrate the continuous states over a span from the tick."""
        name = self.network.solver.name
        method = method_of(name, part.size)
        arrays = [self.solver(each) for each in SOLVER]
        self.codes(before_stage(method, arrays, name, span))
        inner = 2 + bool(method.errors)
        self.depth += inner
        for step in part.steps:
            self.step(step)
        for block, derivative in part.derivatives:
            enables, slots = self.plan.enables.get(block, ()), part.slots_of(block)
            if enables:
                first = f"{arrays[2]} + (stage * {part.size} + {slots[0].start})"
                self.code(f"set_zero({first}, {slots[-1].stop - slots[0].start});")
            with self.enabled(enables):
                self.called(block, derivative, rates(slots, arrays[2], part.size))
        self.depth -= inner
        self.codes(after_stage(method, arrays, NOT_INTEGRATED, span))
        for block in part.projected:
            self.called(block, PROJECT, [])
        if method.errors:
            self.code("}")

    def tests(self, outputs: list[tuple[str, SignalType]]) -> list[str]:
        """Expressions that are true while outputs hold only valid numbers."""
        numbers: list[str] = []
        tests: list[str] = []
        for name, kind in outputs:
            if kind.form == "array":
                test = "all_finite" if kind.finite else "no_nan"
                tests.append(f"{test}(plan->{name}, {math.prod(kind.shape)})")
            elif kind.form == "scalar":
                numbers.append(f"plan->{name}")
            else:
                numbers += [f"plan->{name}[{i}]" for i in range(len(kind.components))]
        if not numbers:
            return tests
        fast = f"isfinite({' + '.join(numbers)})"
        if len(numbers) > 1:  # the sum of large numbers may be infinite
            fast = f"({fast} || ({' && '.join(f'isfinite({number})' for number in numbers)}))"
        return [fast, *tests]

    # Recordings

    def row(self, recording: RecordSlot) -> None:
        """Record one row."""
        array = self.pointer(recording.array, ("array", recording.array, ""))
        width = self.widths[recording.array]
        columns = recording.columns or slice(0, width)
        row = recording.row.replace("//", "/")
        start = f"({row}) * {width}" if width != 1 else row
        target = f"{array} + {start}" + (f" + {columns.start}" if columns.start else "")
        source = self.address(recording.end, recording.is_state)
        self.code(f"copy_numbers({target}, {source}, {columns.stop - columns.start});")
