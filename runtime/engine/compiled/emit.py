"""The plan in C: one call per block, cut where blocks are called from Python.

The items of a tick (outputs, probes, updates, events) keep the plan's order. Blocks that do not
compile cut it into parts: ``run(plan, ctx, first, last, low, high)`` runs the parts from ``low`` up
to ``high``, and a Python loop calls the blocks between them. If all blocks compile, or on ticks on
which none of the others is called, one call runs several ticks. All outputs are in one struct,
whose layout :class:`.structs.PlanText` states.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from blocks.core import Evaluation, SignalType
from runtime.engine.compiled.kernels import PROJECT
from runtime.engine.compiled.plan_text import RUN, literal, sizes
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
from runtime.engine.schedule import Emitter, RecordSlot
from runtime.engine.solvers import METHODS
from runtime.engine.steps import Step
from runtime.network import Endpoint
from runtime.observation import StopTest

# What ``run`` returns: an output is not finite, a block failed, a rate of change is not finite, or
# the tolerance of the solver is not met, or the run's condition to stop holds.
FINISHED, NOT_FINITE, FAILED, BAD_SLOPE, UNREACHED, STOPPED = range(6)
SOLVER = ("states", "start", "slopes", "table", "errors", "control")


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
            self.drive()
        used = {e for kernel in self.kernels.values() for e in kernel.prototypes} | self.own
        self.made.text = "\n".join(
            [
                "struct plan {",
                *self.declared,
                *([] if self.declared else ["    int64_t none;"]),
                "};",
                "",
                *sorted(f"{prototype};" for prototype in used),
                RUN.replace("@dt@", repr(self.network.dt)),
                "        const double t = (double)k * dt;",
                "        (void)t;",
                "        ctx->tick = k;",
                *body,
                "    }",
                f"    return {FINISHED};",
                "}",
                "",
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
        evaluation = item.step.evaluation if item.step else item.update
        if evaluation is None:
            return
        outputs = [self.signal(item.block, port) for port in evaluation.outputs]
        self.called(
            item.block,
            evaluation,
            [text for name, kind in outputs for text in self.place(name, kind)],
        )
        if outputs:
            self.code(f"if (!({' && '.join(self.tests(outputs))})) return {NOT_FINITE};")

    def place(self, name: str, kind: SignalType) -> list[str]:
        """The address of an output, and the sizes that no text tells."""
        pointer = f"&plan->{name}" if kind.form == "scalar" else f"plan->{name}"
        return [pointer, *sizes(kind)]

    def called(self, block: str, evaluation: Evaluation, outputs: list[str]) -> None:
        """Call a block's method; ``outputs`` are the places that it writes to."""
        self.code(f"ctx->at = {len(self.made.calls)};")
        self.made.calls.append((block, evaluation))
        fields = self.pointer(f"fields_{self.plan.names[block]}", ("fields", block, ""))
        time = [] if evaluation is PROJECT else ["t"]
        arguments = ["ctx", fields, *time, *self.inputs(block, evaluation), *outputs]
        self.code(f"{self.kernels[block].symbols[evaluation.method]}({', '.join(arguments)});")

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
        method = METHODS[self.network.solver.name]
        self.made.solver, prototypes = solver_unit(part, method, searched)
        self.own |= set(prototypes)
        self.member("report", 2)
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
            self.item(Item(1, step.block, step=step))
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
        method = METHODS[name]
        arrays = [self.solver(each) for each in SOLVER]
        self.codes(before_stage(method, arrays, name, span))
        inner = 2 + bool(method.errors)
        self.depth += inner
        for step in part.steps:
            self.item(Item(1, step.block, step=step))
        for block, derivative in part.derivatives:
            places = rates(part.slots_of(block), arrays[2], part.size)
            self.called(block, derivative, places)
        self.depth -= inner
        self.codes(after_stage(method, arrays, (BAD_SLOPE, UNREACHED), span))
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
        return [f"isfinite({' + '.join(numbers)})", *tests] if numbers else tests

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

    # The loop in Python

    def drive(self) -> None:
        """Write the Python loop that calls blocks that are not compiled between the parts."""
        self.text, self.lines, self.rate, self.depth = [], {}, 0, 2
        items = [item for item in self.items() if self.is_python(item)]
        rates = sorted({item.every for item in items})
        self.leave = "return"
        halted = "" if self.stop is None else " and not stop[2]"
        self.line(0, "def drive(first, last):")
        self.line(1, "k = first")
        self.line(1, f"while k < last{halted}:")
        following = ", ".join(f"-(-k // {every}) * {every}" for every in rates)
        self.line(2, f"due = min(last, {following})")
        self.line(2, "if k < due:")
        self.line(3, f"run(k, due, 0, {len(items) + 1})")
        self.line(3, "k = due")
        self.line(3, "continue")
        self.line(2, f"t = k * {self.network.dt!r}")
        for number, item in enumerate(items):
            self.line(2, f"run(k, k + 1, {number}, {number + 1})")
            if self.stop is not None:
                self.line(2, "if stop[2]:")
                self.line(3, self.leave)
            self.rate = 0
            Emitter.at(self, item.every)
            self.call_python(item)
        self.line(2, f"run(k, k + 1, {len(items)}, {len(items) + 1})")
        self.line(2, "k += 1")
        self.made.driver, self.made.lines = "\n".join(self.text) + "\n", self.lines

    def call_python(self, item: Item) -> None:
        """Read what a block needs, call it, and store its outputs."""
        if item.continuous is not None:
            part = item.continuous
            steps = [(s.block, s.evaluation) for s in (*part.steps, *self.watched(part))]
            for block, called in (*steps, *part.derivatives):
                self.needed(block, called)
            self.search(part, self.integrate)
        elif item.step is not None:
            self.needed(item.block, item.step.evaluation)
            self.again(item.step)
        elif item.update is not None:
            self.needed(item.block, item.update)
            Emitter.call(self, item.block, item.update, "")

    def needed(self, block: str, evaluation: Evaluation) -> None:
        """Read what a block needs."""
        declared = self.network.entries[block].cls.spec.inputs
        for port in evaluation.needs:
            ends = [wire.source for wire in self.wires.get((block, port), [])]
            for end in ends if port in declared else [Endpoint(block, port)]:
                name, _ = self.signal(end.block, end.port)
                self.code(f"{self.variable(end.block, end.port)} = read({name!r})")

    def again(self, step: Step) -> None:
        """Call a block, and store its outputs."""
        self.step(step)
        for port in step.evaluation.outputs:
            name, _ = self.signal(step.block, port)
            self.code(f"store({name!r}, {self.variable(step.block, port)})")
