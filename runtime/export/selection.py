"""What is exported: the blocks that were named, what they read from others, what others read."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass

from blocks.core import Block, hint
from runtime.errors import GraphError, Problem, UsageError
from runtime.network import Network, enables_of
from runtime.plan import Call, Operation, Plan, Port, Restore, Test, Zero


@dataclass(frozen=True)
class Selection:
    """Blocks of a graph, in the order of a tick, and the signals between them and the others.

    Parameters
    ----------
    blocks : those that do something in a tick.
    operations : what they do, in the plan's order, and what resets the parts that they are in.
    inputs : outputs of other blocks that they read.
    outputs : their outputs that others read; all that nobody reads, if there are none.
    constants : constant outputs that they read.
    """

    network: Network
    plan: Plan
    blocks: tuple[str, ...]
    operations: tuple[Operation, ...]
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    constants: tuple[Port, ...]

    @property
    def calls(self) -> list[Call]:
        return [each for each in self.operations if isinstance(each, Call)]

    @property
    def signals(self) -> list[Port]:
        """The outputs that they compute."""
        return [signal.key for call in self.calls for signal in call.outputs]

    def every(self, port: Port) -> int:
        """How many base ticks an output holds."""
        return self.network.entries[port[0]].grid


def named_blocks(network: Network, names: Sequence[str], others: Sequence[str]) -> frozenset[str]:
    """The blocks of these names, or of parts of these names; without ``names``, all but others.

    Raises
    ------
    UsageError : there is no such block, or none is left.
    """
    if not names and not others:
        message = "name what is exported with --block NAME, or what is not with --except NAME"
        raise UsageError(f"{message}; blocks: {', '.join(sorted(network.entries))}")
    found = _meant(network, names) if names else frozenset(network.entries)
    left = found - _meant(network, others)
    if not left:
        raise UsageError("no block is left to export")
    return left


def _meant(network: Network, names: Iterable[str]) -> frozenset[str]:
    found: set[str] = set()
    parts = {name.rpartition(".")[0] for name in network.entries} - {""}
    for name in names:
        inside = {n for n in network.entries if n == name or n.startswith(f"{name}.")}
        if not inside:
            suggestion = hint(name, (*network.entries, *parts))
            raise UsageError(f"'{network.title}' has no block or part '{name}'{suggestion}")
        found |= inside
    return frozenset(found)


def select(network: Network, plan: Plan, chosen: frozenset[str]) -> Selection:
    """The selection of these blocks.

    Raises
    ------
    UsageError : they have no output.
    GraphError : an input of theirs depends on an output of theirs in the same tick, or one of
        them has continuous states.
    """
    for loop in plan.loops:
        if blocks := sorted(loop.blocks & chosen):
            raise UsageError(
                f"{', '.join(blocks)} are in an algebraic loop that only a run solves "
                f"({loop.path}); a UnitDelay on one of its wires breaks it"
            )
    once = {s.key for call in plan.evaluations if call.gate.once for s in call.outputs}
    calls = [each for each in plan.operations if isinstance(each, Call) and not each.gate.once]
    ours = [call for call in calls if call.block in chosen]
    switches = _switches(network, sorted(chosen))
    sources = _wired(network, lambda block: block in chosen) | switches
    others = _switches(network, sorted(network.entries.keys() - chosen))
    read = _wired(network, lambda block: block not in chosen) | others
    inside = _wired(network, lambda block: True)
    made = [signal.key for call in ours for signal in call.outputs]
    outputs = [port for port in made if port in read] or [p for p in made if p not in inside]
    selection = Selection(
        network,
        plan,
        tuple(sorted({call.block for call in ours})),
        tuple(each for each in plan.operations if _is_ours(each, chosen, switches)),
        tuple(p for p in sources if p[0] not in chosen and p not in once),
        tuple(outputs or made),
        tuple(p for p in sources if p in once),
    )
    if not selection.outputs:
        names = ", ".join(sorted(chosen))
        raise UsageError(f"nothing to export: {names} computes no output that changes in a run")
    _check_evaluation(selection)
    _check_order(selection, chosen)
    return selection


def _is_ours(operation: Operation, chosen: frozenset[str], switches: Container[Port]) -> bool:
    """Whether a controller does an operation in its step."""
    if operation.gate.once:
        return False
    if isinstance(operation, Restore):
        return (operation.block, "on") in switches
    return isinstance(operation, (Call, Test, Zero)) and operation.block in chosen


def _wired(network: Network, reads: Callable[[str], bool]) -> dict[Port, None]:
    """The outputs that some blocks read."""
    ends = (wire.source for wire in network.driving if reads(wire.block))
    return {(end.block, end.port): None for end in ends}


def _switches(network: Network, blocks: Sequence[str]) -> dict[Port, None]:
    """The outputs that switch the parts that some blocks are in."""
    enables = enables_of(network)
    return {(name, "on"): None for block in blocks for name in enables.get(block, ())}


def _check_evaluation(selection: Selection) -> None:
    """Check that no solver is needed."""
    problems = []
    for name in selection.blocks:
        entry = selection.network.entries[name]
        if entry.cls.spec.continuous:
            message = (
                f"'{name}' cannot be exported: it has continuous states, which the graph's solver "
                "integrates between two ticks; export blocks that are sampled"
            )
            if type(entry.block).discretized is not Block.discretized:
                message += f", which --discretize tustin:{name} makes of it"
            problems.append(Problem(entry.node.where, entry.address, message))
    if problems:
        raise GraphError(problems)


def _check_order(selection: Selection, chosen: frozenset[str]) -> None:
    """Check that all inputs are known before the outputs are computed."""
    network, plan = selection.network, selection.plan
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
