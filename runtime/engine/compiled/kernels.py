"""The blocks of a graph that compile, and the reasons why others are called from Python.

In go a network and its states after ``start``; out comes a kernel for each block that has
something to do in a tick, or the reason why it has none:

    make_kernels(network, states)   Kernels(compiled={"lqr": Kernel(...)}, refused={"own": "..."})
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from blocks.core import Block, BlockState, SignalType, has_kernels
from runtime.compiler import Kernel, NotCompilableError, Records, calls_of, make_kernel
from runtime.network import Network
from runtime.plan import continuous_row


@dataclass
class Kernels:
    """The blocks of a graph: those that compile, and the reasons why others do not.

    ``broken`` are those of the others that declare kernels.
    """

    compiled: dict[str, Kernel] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)

    def refuse(self, name: str, cls: type[Block], reason: str) -> None:
        """Store why a block is not compiled."""
        self.compiled.pop(name, None)
        self.refused[name] = reason
        if has_kernels(cls):
            self.broken.add(name)


def make_kernels(
    network: Network,
    states: Mapping[str, BlockState],
    checked: bool = False,
    begin: Callable[[Kernel], None] = lambda _: None,
    typed: bool = False,
) -> Kernels:
    """Write every block that is evaluated or updated in a tick.

    Parameters
    ----------
    states : after ``start``.
    checked : with a check of every index that may be outside of its array.
    begin : called with each block that was written and not read from the cache.
    typed : with the functions of each block in the typed form.
    """
    kernels, records = Kernels(), Records(typed)
    # Sorted by block once: a search of the whole network per block is quadratic.
    shapes: defaultdict[str, list[tuple[int, ...]]] = defaultdict(list)
    for slot in continuous_row(network).slots:
        shapes[slot.block].append(slot.shape)
    kinds: defaultdict[str, dict[str, SignalType]] = defaultdict(dict)
    for (block, port), kind in network.types.items():
        kinds[block][port] = kind
    wires = Counter((wire.block, wire.port) for wire in network.driving)
    moves = bool(shapes)
    for name, entry in sorted(network.entries.items()):
        spec = entry.cls.spec
        is_guarded = moves and spec.guards is not None and network.is_located(name)
        guards = len(entry.block.crossings(network.context(name))) if is_guarded else 0
        calls = calls_of(spec, entry.evaluations, guards)
        if not calls:
            continue
        terms = {p: wires[name, p] for p, declared in spec.inputs.items() if declared.variadic}
        try:
            kernel = kernels.compiled[name] = make_kernel(
                entry.block,
                states[name],
                terms,
                kinds[name],
                calls,
                checked=checked,
                rates=shapes[name],
                records=records,
                guards=guards,
            )
            if kernel.is_new:
                begin(kernel)
        except NotCompilableError as error:
            kernels.refuse(name, entry.cls, str(error))
    return kernels
