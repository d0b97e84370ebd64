"""The Python loop around a compiled plan: it calls blocks that are not compiled between the parts.

In go the operations that Python does, each with its tests; out comes ``drive(first, last)``. Values
that such a block reads are read from the plan's struct, and its outputs stored there::

    run(k, k + 1, 0, 1)
    plant_pose = read('out_plant_pose')
    own_out = own.output(own_s, t, plant_pose)
    store('out_own_out', own_out)
"""

from __future__ import annotations

from collections.abc import Sequence

from runtime.engine.compiled.struct import Struct
from runtime.engine.naming import Names
from runtime.engine.python_text import PythonText
from runtime.plan import ALWAYS, Load, Operation, Plan, Signal, Store, exchanged


class DriverText(PythonText):
    """Writes operations between reading and storing.

    Parameters
    ----------
    struct : of the compiled plan.
    """

    def __init__(self, plan: Plan, names: Names, struct: Struct) -> None:
        super().__init__(plan, names)
        self.struct = struct
        self.printers |= {Load: self.load, Store: self.store}

    def loop(self, called: Sequence[Sequence[Operation]]) -> str:
        """The text.

        Parameters
        ----------
        called : what is done between each two parts.
        """
        gates = (operations[0].gate for operations in called)
        rates = sorted({(gate.every, gate.offset) for gate in gates})
        self.leave = "return"
        halted = " and not stop[0]" if self.plan.can_stop else ""
        self.line(0, "def drive(first, last):")
        self.line(1, "k = first")
        self.line(1, f"while k < last{halted}:")
        following = ", ".join(f"-(({o} - k) // {every}) * {every} + {o}" for every, o in rates)
        self.line(2, f"due = min(last, {following})")
        self.line(2, "if k < due:")
        self.line(3, f"run(k, due, 0, {len(called) + 1})")
        self.line(3, "k = due")
        self.line(3, "continue")
        self.line(2, f"t = k * {self.dt}")
        for number, operations in enumerate(called):
            self.line(2, f"run(k, k + 1, {number}, {number + 1})")
            if self.plan.can_stop:
                self.line(2, "if stop[0]:")
                self.line(3, self.leave)
            self.rate = ALWAYS
            self.operations(exchanged(operations))
        self.line(2, f"run(k, k + 1, {len(called)}, {len(called) + 1})")
        self.line(2, "k += 1")
        return "\n".join(self.text) + "\n"

    def load(self, load: Load) -> None:
        for signal in load.signals:
            if signal.key not in self.struct.outside:  # a name of the namespace
                self.code(f"{self.names.of(signal)} = read({self.member(signal)!r})")

    def store(self, store: Store) -> None:
        for signal in store.signals:
            self.code(f"store({self.member(signal)!r}, {self.names.of(signal)})")

    def member(self, signal: Signal) -> str:
        self.struct.signal(signal)
        return self.struct.signals[signal.key]
