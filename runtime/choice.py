"""Which engine a run takes, and what it would cost in Python."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

from runtime.errors import MissingExtraError
from runtime.network import Network
from runtime.observe import state_shape

# Rough costs in Python (s), as measured on case A: a call of a block, and each number that an
# update may move.
CALL, NUMBER = 1.2e-6, 1.5e-8
# What the Python engine has to take (s) before a first compilation repays itself. The plan's
# compilation grows faster than the plan: 2,000 evaluations are not worth waiting for.
REPAID, REPAID_PER_SQUARE = 15.0, 1e-3
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
        if spec.update is not None:
            setting, sizes = network.setting(name), entry.made.sizes()
            for declared in spec.states.values():
                length = 1
                for side in state_shape(sizes, declared, setting, spec):
                    length *= side
                cost += NUMBER * length
        each_tick += cost / entry.every
    return each_tick * network.ticks
