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
from runtime.engine.schedule import INDENT, Emitter, Plan, RecordSlot
from runtime.engine.steps import Step
from runtime.network import Endpoint

Call = tuple[str, Evaluation]
_ITEM = re.compile(r"\.item\(([0-9]+)\)")
HEADER = """from math import isfinite

from numba import njit
from numpy import array, ascontiguousarray, full

from runtime.engine.compiled.primitives import all_finite, no_nan, overlap, seen
"""


@dataclass
class Item:
    """One item of a tick: an evaluation of a block, or a row of a recording."""

    every: int
    block: str = ""
    step: Step | None = None
    update: Evaluation | None = None
    recording: RecordSlot | None = None


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
        self, plan: Plan, recordings: list[RecordSlot], kernels: dict[str, Kernel]
    ) -> None:
        super().__init__(plan, recordings)
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
        for number, part in enumerate(parts):
            if cut:
                self.line(2, f"if low <= {number} < high:")
                self.line(3, "pass")
            self.rate = 0
            for item in part:
                self.item(item, held)
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
            '@njit(cache=True, error_model="python")',
            f"def run({head}):",
            *([f"{INDENT}{packed} = held"] if held else []),
            f"{INDENT}for k in range(first, last):",
            f"{INDENT * 2}at[1] = k",
            f"{INDENT * 2}t = k * dt",
            *body,
            f"{INDENT}return {packed}",
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
            *(Item(every, name, update=update) for name, every, update in self.updates()),
            *(Item(r.every, recording=r) for r in recordings if r.is_event),
        ]

    def is_python(self, item: Item) -> bool:
        """Whether the item belongs to a block that is not compiled."""
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

    def item(self, item: Item, held: list[str]) -> None:
        self.at(item.every)
        if item.recording is not None:
            self.recorded(item.recording)
            return
        evaluation = item.step.evaluation if item.step else item.update
        if evaluation is None:
            return
        self.code(f"at[0] = {len(self.calls)}")
        self.calls.append((item.block, evaluation))
        fields = self.take(fields_name(self.plan, item.block))
        arguments = [fields, "t", *self.arguments(item.block, evaluation)]
        call = f"{self.kernel(item.block, evaluation.method)}({', '.join(arguments)})"
        if item.step is None:
            self.code(call)
            return
        targets = [self.variable(item.block, port) for port in evaluation.outputs]
        self.code(f"{', '.join(targets)} = {call}")
        kinds = [self.network.types[item.block, port] for port in evaluation.outputs]
        kernel = self.kernels[item.block]
        for text in kernel.casts.get(evaluation.method, ()):
            self.code(text.format(*targets))
        for target, kind in zip(targets, kinds, strict=True):
            shared = [f"overlap({target}, {fields}{at})" for at in kernel.made.arrays]
            if kind.form == "array" and shared:
                self.code(f"if {' or '.join(shared)}:")
                self.code(f"{INDENT}{target} = {target}.copy()")
        self.test(dict(zip(targets, kinds, strict=True)), held)

    def test(self, signals: dict[str, SignalType], held: list[str]) -> None:
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
        for i, entry in enumerate(entries):
            self.code(f"{INDENT}report[{i}] = {entry}")
        self.code(f"{INDENT}at[2] = 1")
        self.code(f"{INDENT}return ({', '.join(held)},)" if held else f"{INDENT}return ()")

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
        items = [item for item in self.items() if self.is_python(item)]
        rates = sorted({item.every for item in items})
        packed = f"({', '.join(held)},)"
        self.line(0, "def drive(first, last, held):")
        self.line(1, "k = first")
        self.line(1, f"{packed} = held")
        self.line(1, "while k < last:")
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
            self.at(item.every)
            if item.step is not None:
                self.python_step(item.step)
            elif item.update is not None:
                Emitter.call(self, item.block, item.update, "")
        self.line(2, f"{packed} = run(k, k + 1, {len(items)}, {len(items) + 1}, {packed})")
        self.line(2, "k += 1")
        self.line(1, f"return {packed}")
        made.driver, made.lines = "\n".join(self.text) + "\n", self.lines

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
