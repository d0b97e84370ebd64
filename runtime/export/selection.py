"""What is exported: the blocks that were named, what they read from others, what others read."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from blocks.core import Block, hint
from runtime.errors import GraphError, Problem, UsageError
from runtime.network import Network, enables_of
from runtime.plan import (
    Call,
    Integrate,
    Operation,
    Plan,
    Port,
    Record,
    Restore,
    Signal,
    Solve,
    Source,
    Stop,
    Test,
    Zero,
    calls_in,
    numbers_in,
)


@dataclass(frozen=True)
class Selection:
    """Blocks of a graph, in the order of a tick, and the signals between them and the others.

    Parameters
    ----------
    plan : what they do, in order, and what resets the parts that they are in.
    inputs : outputs of other blocks that they read; of a whole graph, its section ``inputs``.
    outputs : their outputs that others read. Of a whole graph, its section ``outputs`` and what
        is recorded; without any, those that nobody reads.
    constants : constant outputs that they read.
    """

    network: Network
    plan: Plan
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    constants: tuple[Port, ...]

    @cached_property
    def calls(self) -> list[Call]:
        """All calls but those before the first tick."""
        found = [each for each in calls_in(self.plan.operations) if not each.gate.once]
        part = self.plan.integration
        return found + list(calls_in(part.between) if part else ())

    @cached_property
    def blocks(self) -> tuple[str, ...]:
        """Those that do something in a tick."""
        return tuple(sorted({call.block for call in self.calls}))

    @cached_property
    def signals(self) -> list[Port]:
        """The outputs that they compute."""
        return list(dict.fromkeys(s.key for call in self.calls for s in call.outputs))

    @cached_property
    def is_whole(self) -> bool:
        """Whether nothing is read from others."""
        return not self.inputs

    def every(self, port: Port) -> int:
        """How many base ticks an output holds."""
        return self.network.entries[port[0]].grid


def named_blocks(network: Network, names: Sequence[str], others: Sequence[str]) -> frozenset[str]:
    """The blocks of these names, or of parts of these names; without ``names``, all but ``others``
    and what stands for an input of the graph.

    Raises
    ------
    UsageError : there is no such block, or none is left.
    """
    found = _meant(network, names) if names else frozenset(network.entries) - _ports(network)
    left = found - _meant(network, others)
    if not left:
        raise UsageError("no block is left to export")
    return left


def _ports(network: Network) -> frozenset[str]:
    """The blocks that stand for inputs of the graph, which whoever calls the step gives."""
    return frozenset(port.end.block for port in network.inputs.values())


def _meant(network: Network, names: Iterable[str]) -> frozenset[str]:
    found: set[str] = set()
    parts = {name.rpartition(".")[0] for name in network.entries} - {""}
    for name in names:
        inside = {n for n in network.entries if n == name or n.startswith(f"{name}.")}
        if not inside:
            known = sorted({*network.entries, *parts})
            suggestion = hint(name, known) or f"; it has {', '.join(known)}"
            raise UsageError(f"'{network.title}' has no block or part '{name}'{suggestion}")
        found |= inside
    return frozenset(found)


def select(network: Network, plan: Plan, chosen: frozenset[str]) -> Selection:
    """The selection of these blocks.

    Raises
    ------
    UsageError : they have no output.
    GraphError : an input of theirs depends on an output of theirs in the same tick, or a solver
        needs blocks that are not among them.
    """
    for loop in plan.loops:
        if (blocks := sorted(loop.blocks & chosen)) and not loop.blocks <= chosen:
            raise UsageError(
                f"{', '.join(blocks)} are in an algebraic loop that only the whole of it solves "
                f"({loop.path}); export its other blocks, too, or break it with a UnitDelay"
            )
    _check_solver(network, plan, chosen)
    once = {s.key for call in plan.evaluations if call.gate.once for s in call.outputs}
    switches = _switches(network, sorted(chosen))
    sources = _wired(network, lambda block: block in chosen) | switches
    others = _switches(network, sorted(network.entries.keys() - chosen))
    read = _wired(network, lambda block: block not in chosen) | others
    inside = _wired(network, lambda block: True)
    ours = tuple(_without_log(each) for each in plan.operations if _is_ours(each, chosen, switches))
    found = Selection(
        network,
        replace(plan, operations=ours),
        tuple(p for p in sources if p[0] not in chosen and p not in once),
        (),
        tuple(p for p in sources if p in once),
    )
    made = found.signals
    recorded = [each.source.whole for each in plan.records if isinstance(each.source.whole, Signal)]
    if chosen | _ports(network) == network.entries.keys():
        ends = (port.end for port in network.outputs.values())
        read = dict.fromkeys((end.block, end.port) for end in ends)
        read |= dict.fromkeys(signal.key for signal in recorded)
    outputs = [port for port in made if port in read] or [p for p in made if p not in inside]
    if not made:
        names = ", ".join(sorted(chosen))
        raise UsageError(f"nothing to export: {names} computes no output that changes in a run")
    outputs = outputs or made
    recording = replace(found.plan, operations=_recording(ours, outputs))
    selection = replace(found, plan=recording, outputs=tuple(outputs))
    _check_order(selection, plan, chosen)
    return selection


def _recording(operations: Sequence[Operation], outputs: Sequence[Port]) -> tuple[Operation, ...]:
    """Operations that record each output as a probe does: before a solver computes it again."""
    signals: dict[Port, tuple[int, Signal]] = {}
    for at, operation in enumerate(operations):
        if isinstance(operation, (Call, Solve, Test, Zero)) and not operation.gate.once:
            signals |= {signal.key: (at, signal) for signal in operation.outputs}
    after: dict[int, list[Operation]] = {}
    for number, port in enumerate(outputs):
        at, signal = signals[port]
        record = Record("", number, Source(signal), numbers_in(signal.kind), rows=1)
        after.setdefault(at, []).append(record)
    found: list[Operation] = []
    for at, operation in enumerate(operations):
        found += [operation, *after.get(at, ())]
    return tuple(found)


def _without_log(operation: Operation) -> Operation:
    """The same operation, but for a list of events, which grows with time."""
    return replace(operation, log=0) if isinstance(operation, Integrate) else operation


def _is_ours(operation: Operation, chosen: frozenset[str], switches: Container[Port]) -> bool:
    """Whether a controller does an operation in its step; constants are needed by name only."""
    if isinstance(operation, Restore):
        return (operation.block, "on") in switches
    if isinstance(operation, Solve):
        return operation.blocks <= chosen
    if isinstance(operation, Integrate):
        return operation.row.by_block.keys() <= chosen
    if operation.gate.once:
        return isinstance(operation, Call)
    return isinstance(operation, (Call, Test, Zero, Stop)) and operation.block in chosen


def _wired(network: Network, reads: Callable[[str], bool]) -> dict[Port, None]:
    """The outputs that some blocks read."""
    ends = (wire.source for wire in network.driving if reads(wire.block))
    return {(end.block, end.port): None for end in ends}


def _switches(network: Network, blocks: Sequence[str]) -> dict[Port, None]:
    """The outputs that switch the parts that some blocks are in."""
    enables = enables_of(network)
    return {(name, "on"): None for block in blocks for name in enables.get(block, ())}


def _check_solver(network: Network, plan: Plan, chosen: frozenset[str]) -> None:
    """Check that all that the solver evaluates between two ticks is chosen, or nothing of it."""
    part = plan.integration
    continuous = part.row.by_block.keys() if part else frozenset[str]()
    ours = continuous & chosen
    missing = ((part.blocks if part else set()) | continuous) - chosen
    if not (ours and missing):
        return
    problems = []
    for name in sorted(ours):
        entry = network.entries[name]
        message = (
            f"'{name}' cannot be exported alone: its continuous states are integrated together "
            f"with what {', '.join(sorted(missing))} compute between two ticks; export these, too, "
            "or blocks that are sampled"
        )
        if type(entry.block).discretized is not Block.discretized:
            message += f", which --discretize tustin:{name} makes of it"
        problems.append(Problem(entry.node.where, entry.address, message))
    raise GraphError(problems)


def _check_order(selection: Selection, plan: Plan, chosen: frozenset[str]) -> None:
    """Check that all inputs are known before the outputs are computed."""
    network = selection.network
    behind: dict[Port, Port] = {}  # an output of another block, and the one of ours it depends on
    for call in plan.evaluations:
        if call.block in chosen or call.gate.once:
            continue
        for signal in (*call.reads, *call.gate.switches):
            source = signal.key
            if source[0] in chosen and source not in selection.constants:
                behind |= {output.key: source for output in call.outputs}
            elif source in behind:
                behind |= {output.key: behind[source] for output in call.outputs}
    problems = []
    for end in selection.inputs:
        if end in behind:
            entry = network.entries[end[0]]
            made = ".".join(behind[end])
            message = (
                f"'{end[0]}.{end[1]}' is an input of what is exported, and is computed from its "
                f"output '{made}' in the same tick; export '{end[0]}', too, or put a UnitDelay "
                "between them"
            )
            problems.append(Problem(entry.node.where, entry.address, message))
    if problems:
        raise GraphError(problems)
