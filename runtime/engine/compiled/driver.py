"""The Python loop around a compiled plan: it calls blocks that are not compiled between the parts.

Values that such a block reads are read from the plan's struct, and its outputs stored there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from blocks.core import Evaluation
from runtime.engine.compiled.structs import StructEmitter
from runtime.engine.continuous import Continuous
from runtime.engine.schedule import Emitter, RecordSlot
from runtime.engine.steps import Step
from runtime.network import Endpoint
from runtime.observation import StopTest


@dataclass
class Item:
    """One item of a tick: an evaluation, a row of a recording, the continuous part, or a reset."""

    every: int
    block: str = ""
    step: Step | None = None
    update: Evaluation | None = None
    recording: RecordSlot | None = None
    continuous: Continuous | None = None
    stop: StopTest | None = None
    reset: str = ""


class Driver(Emitter):
    """Writes ``drive(first, last)``.

    Parameters
    ----------
    plan_text : knows the members of the struct.
    items : those that call blocks which are not compiled, in order.
    """

    def __init__(self, plan_text: StructEmitter, items: Sequence[Item]) -> None:
        super().__init__(plan_text.plan, [], plan_text.stop)
        self.members, self.python_items = plan_text, items

    def written(self) -> str:
        """The text."""
        items = self.python_items
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
            self.at(item.every)
            self.item(item)
        self.line(2, f"run(k, k + 1, {len(items)}, {len(items) + 1})")
        self.line(2, "k += 1")
        return "\n".join(self.text) + "\n"

    def item(self, item: Item) -> None:
        """Read what a block needs, call it, and store its outputs."""
        if item.continuous is not None:
            part = item.continuous
            for step in (*part.steps, *self.watched(part)):
                self.read_step(step)
            for block, derivative in part.derivatives:
                self.read_inputs(block, derivative)
                self.read_ports((name, "on") for name in self.plan.enables.get(block, ()))
            self.search(part, self.integrate)
        elif item.step is not None:
            self.read_step(item.step)
            self.again(item.step)
        elif item.update is not None:
            self.read_inputs(item.block, item.update)
            self.read_ports((name, "on") for name in self.plan.enables.get(item.block, ()))
            self.update(item.block, item.update)

    def read_step(self, step: Step) -> None:
        """Read what an evaluation needs; its outputs, too, if it may be left out."""
        self.read_inputs(step.block, step.evaluation)
        self.read_ports((name, "on") for name in step.enables)
        if step.enables:
            self.read_ports((step.block, port) for port in step.evaluation.outputs)

    def read_inputs(self, block: str, evaluation: Evaluation) -> None:
        declared = self.network.entries[block].cls.spec.inputs
        for port in evaluation.needs:
            ends = [wire.source for wire in self.wires.get((block, port), [])]
            own = [] if port in declared else [Endpoint(block, port)]
            self.read_ports((end.block, end.port) for end in [*ends, *own])

    def read_ports(self, ports: Iterable[tuple[str, str]]) -> None:
        for block, port in ports:
            name, _ = self.members.signal(block, port)
            self.code(f"{self.variable(block, port)} = read({name!r})")

    def again(self, step: Step) -> None:
        """Call a block, and store its outputs."""
        self.step(step)
        for port in step.evaluation.outputs:
            name, _ = self.members.signal(step.block, port)
            self.code(f"store({name!r}, {self.variable(step.block, port)})")
