"""Names in the text of a plan: those of blocks and signals, which are none of its own."""

from __future__ import annotations

import keyword
from collections.abc import Iterable

from runtime.network import Network

GLOBALS = (
    *("isfinite", "isnan", "vdot", "array", "full"),
    *("checked", "sealed", "not_finite", "floats"),
)
# Names used by the loop around a compiled plan.
DRIVER_NAMES = ("drive", "due", "read", "store")
# Names used by the text of a graph with continuous states, or that may stop early.
CONTINUOUS_NAMES = (
    *("states", "start", "slopes", "nodes", "weights", "table", "stage"),
    *("blend", "joined", "rates", "bad_slope", "keep", "first_bad", "moved", "i0", "i1"),
    *("sum", "done", "h", "substep", "control", "judged", "errors", "unreached"),
    *("stop", "origin", "span", "beyond", "narrowed"),
)


def identifiers(
    network: Network, reserved: Iterable[str], enables: Iterable[str]
) -> tuple[dict[str, str], dict[tuple[str, str], str]]:
    """Python names for blocks, outputs and states: ``plant``, ``plant_pose``, ``plant_s``."""
    taken = {*keyword.kwlist, *GLOBALS, *DRIVER_NAMES, "run", "first", "last", "held", "k", "t"}
    taken |= {"range", "float", "__builtins__", "clock", "spent", "began"}
    taken |= set(reserved)

    def fresh(name: str) -> str:
        plain = name.replace(".", "_")
        while plain in taken or plain.startswith("probe_"):
            plain = f"{plain}_" if not plain.startswith("probe_") else f"_{plain}"
        taken.add(plain)
        return plain

    names = {name: fresh(name) for name in sorted(network.entries)}
    variables = {}
    for name in names:
        for port in network.entries[name].cls.spec.outputs:
            variables[name, port] = fresh(f"{names[name]}_{port}")
        variables[name, ""] = fresh(f"{names[name]}_s")
    for name in enables:
        variables[name, "0"] = fresh(f"{names[name]}_s0")
    return names, variables
