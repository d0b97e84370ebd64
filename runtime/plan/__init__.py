"""What a tick does, as ordered operations: data that printers write as Python and as C.

``building`` makes a plan of a network and its observation, ``order`` sorts its evaluations, and
``moving`` says what a solver computes again between two ticks. ``operations`` is the form; a line
of it is ``call      error.out: Scalar = error.output(t, (reference.out, plant.y))``. ``passes`` go
over operations, ``stacking`` makes one call of equal ones, and ``c_text`` has what printers of C
share.
"""

from runtime.plan.building import make_plan
from runtime.plan.c_text import CText, numbers_in
from runtime.plan.moving import continuous_row
from runtime.plan.operations import (
    ALWAYS,
    Call,
    Gate,
    Integrate,
    Load,
    Operation,
    Plan,
    Record,
    Restore,
    Solve,
    Stop,
    Store,
    Test,
    Zero,
    calls_in,
)
from runtime.plan.passes import exchanged, signals_of
from runtime.plan.stacking import Stack, Stacking, Step
from runtime.plan.values import Argument, GuardSlot, Port, Signal, Slot, Source, StateArray
