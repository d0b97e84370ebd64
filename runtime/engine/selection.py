"""Which engine a run takes, and what it would cost in Python."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.util import find_spec

from blocks.core import Same
from runtime.errors import MissingExtraError
from runtime.network import Network, state_shape

# Rough costs in Python (s), as measured on case A: a call of a block, and each number that an
# update may move; and on case C: each number of an array that a block works out from its inputs
# (the LiDAR's ranges, the fitter's path). Generic blocks hand arrays on at next to no cost.
CALL, NUMBER, WORKED_OUT = 1.2e-6, 1.5e-8, 2e-6
# What the Python engine has to take (s) for all runs together before they are compiled: from its
# cache the compiled engine is ready after 1 s and takes a twentieth of the time per tick in cases
# A and C (docs/performance.md), so such runs end three times sooner and each later one gains again.
# The plan's compilation grows faster than the plan: 2,000 evaluations are not worth waiting for.
REPAID, REPAID_PER_SQUARE = 5.0, 1e-3
EXTRA = "fast"


def take_compiled(network: Network, runs: int, note: Callable[[str], None]) -> bool:
    """Whether to compile a graph that is run this many times.

    ``auto`` looks at nothing but the graph and the number of runs, so that the same command takes
    the same engine every time. ``note`` is told where it would compile but cannot.

    Raises
    ------
    MissingExtraError : the compiled engine is asked for and not installed.
    """
    if network.engine == "python":
        return False
    installed = find_spec("numba") is not None
    if network.engine == "compiled":
        if not installed:
            raise MissingExtraError("the compiled engine", EXTRA)
        return True
    calls = sum(len(entry.cls.spec.evaluations) for entry in network.entries.values())
    wanted = runs * python_seconds(network) > REPAID + REPAID_PER_SQUARE * calls**2
    if wanted and not installed:
        note(f"faster with the compiled engine: pip install 'spikeblocks[{EXTRA}]'")
    return wanted and installed


def python_seconds(network: Network) -> float:
    """What one run costs under the Python engine, roughly (s)."""
    each_tick = 0.0
    for name, entry in network.entries.items():
        spec = entry.cls.spec
        calls = [e for e in spec.evaluations if not spec.is_constant(e)]
        cost = CALL * (len(calls) + (spec.update is not None))
        for call in calls:
            cost += WORKED_OUT * sum(_worked_out(network, name, port) for port in call.outputs)
        if spec.update is not None:
            context, sizes = network.context(name), entry.made.sizes()
            for declared in spec.states.values():
                length = 1
                for side in state_shape(sizes, declared, context, spec):
                    length *= side
                cost += NUMBER * length
        each_tick += cost / entry.every
    return each_tick * network.ticks


def _worked_out(network: Network, block: str, port: str) -> int:
    """How many numbers of an array a block works out at once; 0 for what it remembers."""
    spec, kind = network.entries[block].cls.spec, network.types[block, port]
    (call,) = [call for call in spec.evaluations if port in call.outputs]
    if kind.form != "array" or not call.needs or isinstance(spec.outputs[port].type, Same):
        return 0
    return math.prod(kind.shape)
