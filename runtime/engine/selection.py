"""Which engine a run uses, and the estimated run time of the Python engine.

In: a checked network and the number of runs. Out: whether to compile. One run of 20 s of case A
takes 0.8 s in Python and is not compiled; ten of them take longer than compiling and are.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from blocks.core import Same, state_shape
from runtime.network import Network
from runtime.plan import continuous_row
from runtime.solvers import method_of
from runtime.toolchain import available, find_compiler, install_command

# Rough costs in Python (s), measured on case A: a call of a block, and each number that an update
# may change; and on case C: each number of an array that a block computes from its inputs (the
# LiDAR's ranges, the fitter's path). Generic blocks pass arrays on at almost no cost.
CALL, NUMBER, COMPUTED = 1.2e-6, 1.5e-8, 2e-6
# A stage of a solver, in calls: the states moved, the rates tested.
STAGE = 5
# The time (s) of all runs together under the Python engine above which they are compiled: what
# compiling takes on an empty cache. In CPU time 0.3 s for two types of blocks, 1.6 s for the
# thirteen of case A, and 3.9 s for case C; and 2 ms for each evaluation of a long plan. It is not
# measured in the run itself: a busy machine would choose another engine, and with it other
# roundings, and what a block of a user has done in the first ticks cannot be undone.
PAYS_OFF, PAYS_OFF_PER_TYPE, PAYS_OFF_PER_CALL = 0.1, 0.12, 2e-3


def take_compiled(network: Network, runs: int, note: Callable[[str], None]) -> bool:
    """Whether to compile a graph that is run this many times.

    ``auto`` depends only on the graph and the number of runs, so that the same command uses the
    same engine every time. ``note`` is called if it would compile but there is no C compiler.

    Raises
    ------
    MissingCompilerError : the compiled engine is requested, and there is no C compiler.
    """
    if network.engine == "python":
        return False
    if network.engine in ("compiled", "checked"):
        find_compiler()
        return True
    calls = sum(len(entry.cls.spec.evaluations) for entry in network.entries.values())
    types = len({entry.cls for entry in network.entries.values()})
    pays_off = PAYS_OFF + PAYS_OFF_PER_TYPE * types + PAYS_OFF_PER_CALL * calls
    wanted = runs * python_seconds(network) > pays_off
    if wanted and not available():
        note(f"faster with the compiled engine, which needs a C compiler: {install_command()}")
        return False
    return wanted


def python_seconds(network: Network) -> float:
    """The estimated time (s) of one run under the Python engine."""
    each_tick = 0.0
    for name, entry in network.entries.items():
        spec = entry.cls.spec
        calls = [e for e in spec.evaluations if not spec.is_constant(e)]
        cost = CALL * (len(calls) + (spec.update is not None))
        for call in calls:
            cost += COMPUTED * sum(_computed(network, name, port) for port in call.outputs)
        if spec.update is not None:
            context = network.context(name)
            for declared in spec.states.values():
                length = 1
                for side in state_shape(entry.block, declared, context):
                    length *= side
                cost += NUMBER * length
        each_tick += cost / entry.every
    return (each_tick + _stages(network)) * network.ticks


def _stages(network: Network) -> float:
    """The estimated time (s) of the stages of a solver in one tick."""
    entries = network.entries.values()
    if not network.is_continuous:
        return 0.0
    again = [entry for entry in entries if entry.is_memoryless or entry.cls.spec.continuous]
    calls = sum(len(entry.evaluations) + len(entry.cls.spec.continuous) for entry in again)
    size = continuous_row(network).size
    return method_of(network.solver, size).stages * CALL * (STAGE + calls)


def _computed(network: Network, block: str, port: str) -> int:
    """How many numbers of an array a block computes from its inputs; 0 for a stored output."""
    spec, kind = network.entries[block].cls.spec, network.types[block, port]
    (call,) = [call for call in spec.evaluations if port in call.outputs]
    if kind.form != "array" or not call.needs or isinstance(spec.outputs[port].type, Same):
        return 0
    return math.prod(kind.shape)
