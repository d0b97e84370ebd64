"""Names in the text of a plan: those of blocks and signals, which are none of its own.

In goes a plan, out come names that Python and C accept: of the block ``part.plant``, the name
``part_plant``, ``part_plant_s`` of its state, and ``part_plant_pose`` of its output; of the block
``run``, ``run_``.
"""

from __future__ import annotations

import keyword
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

from blocks.core import BlockState
from runtime.plan import Plan, Port, Signal

# What an engine gives every block's state, and what cannot change.
GIVEN = frozenset(("_declared", "context", "dt", "seed", "is_seed_read", "published", "rng"))

GLOBALS = tuple(
    """
    isfinite isnan vdot array full concatenate zeros checked sealed not_finite floats several
""".split()
)
# Names used by the loop around a compiled plan.
DRIVER_NAMES = ("drive", "due", "read", "store")
# Names used by the text of a graph with continuous states, or that may stop early.
CONTINUOUS_NAMES = tuple(
    """
    states start slopes nodes weights table stage blend joined rates bad_slope keep first_bad
    move_states i0 i1 sum done h substep control accept_step errors unreached reject_step
    ArithmeticError ValueError stop beyond search sides directions guards fired edges found opened
    proposed decided restless reached which noted log count min
""".split()
)


@dataclass(frozen=True)
class Names:
    """Python names of blocks, outputs and states: ``plant``, ``plant_pose``, ``plant_s``.

    initial : of the copies of the states of blocks that are reset, as they were after ``start``.
    """

    blocks: Mapping[str, str]
    signals: Mapping[Port, str]
    states: Mapping[str, str]
    initial: Mapping[str, str]

    def of(self, signal: Signal) -> str:
        return self.signals[signal.key]


def names_of(plan: Plan) -> Names:
    """The names in the text of a plan."""
    taken = {*keyword.kwlist, *GLOBALS, *DRIVER_NAMES, "run", "first", "last", "held", "k", "t"}
    taken |= {"range", "float", "__builtins__", "clock", "spent", "began"}
    if plan.integration is not None or plan.can_stop:
        taken |= set(CONTINUOUS_NAMES)

    for loop in plan.loops:
        own = ("loop_{}", "loop_{}_control", "unsolved_{}")
        taken |= {"going", "begun", "newton", *(each.format(loop.number) for each in own)}

    def fresh(name: str) -> str:
        plain = name.replace(".", "_")
        while plain in taken or plain.startswith(("probe_", "stack_")):
            plain = f"{plain}_" if plain in taken else f"_{plain}"
        taken.add(plain)
        return plain

    ports = defaultdict[str, list[str]](list)
    for call in plan.evaluations:
        ports[call.block] += [signal.port for signal in call.outputs]
    blocks = {name: fresh(name) for name in sorted(plan.states)}
    signals, states = {}, {}
    for name, plain in blocks.items():
        for port in ports[name]:
            signals[name, port] = fresh(f"{plain}_{port}")
        states[name] = fresh(f"{plain}_s")
    initial = {name: fresh(f"{blocks[name]}_s0") for name in blocks if name in plan.restored}
    return Names(blocks, signals, states, initial)


def undeclared(state: BlockState) -> set[str]:
    """The attributes of a block's state that nothing declares."""
    held = vars(state)
    declared: frozenset[str] = held["_declared"]
    return held.keys() - declared - GIVEN
