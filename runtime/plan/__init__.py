"""What a tick does, as ordered operations: data that printers write as Python and as C.

``building`` makes a plan of a network and its observation, ``order`` sorts its evaluations, and
``moving`` says what a solver computes again between two ticks. ``operations`` is the form; a line
of it is ``call      error.out: Scalar = error.output(t, (reference.out, plant.y))``. ``passes`` go
over operations, and ``c_text`` has what printers of C share.
"""

from runtime.plan.building import make_plan
from runtime.plan.c_text import CText, numbers_in
from runtime.plan.moving import continuous_row
from runtime.plan.operations import (
    Call,
    Crossing,
    Integrate,
    Load,
    Operation,
    Plan,
    Record,
    Restore,
    Stop,
    Store,
    Test,
    Zero,
)
from runtime.plan.passes import exchanged, signals_of
from runtime.plan.values import (
    Argument,
    Gate,
    GuardSlot,
    Port,
    Row,
    Signal,
    Slot,
    Source,
    StateArray,
)

__all__ = [
    "Argument",
    "CText",
    "Call",
    "Crossing",
    "Gate",
    "GuardSlot",
    "Integrate",
    "Load",
    "Operation",
    "Plan",
    "Port",
    "Record",
    "Restore",
    "Row",
    "Signal",
    "Slot",
    "Source",
    "StateArray",
    "Stop",
    "Store",
    "Test",
    "Zero",
    "continuous_row",
    "exchanged",
    "make_plan",
    "numbers_in",
    "signals_of",
]
