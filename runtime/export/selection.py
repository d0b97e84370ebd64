"""What is exported: the blocks that were named, what they read from others, what others read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from blocks.core import Evaluation, hint
from runtime.engine import Emitter, Plan, Step, drivers
from runtime.errors import GraphError, Problem, UsageError
from runtime.network import Network

Port = tuple[str, str]  # a block and one of its outputs


@dataclass(frozen=True)
class Selection:
    """Blocks of a graph, in the order of a tick, and the signals between them and the others.

    Parameters
    ----------
    blocks : those that do something in a tick.
    steps : their evaluations, in the plan's order.
    updates : block, step in base ticks, and method, in the plan's order.
    inputs : outputs of other blocks that they read.
    outputs : their outputs that others read; all that nobody reads, if there are none.
    constants : constant outputs that they read.
    resetting : blocks that reset the part that they switch, where some of it is exported.
    """

    plan: Plan
    blocks: tuple[str, ...]
    steps: tuple[Step, ...]
    updates: tuple[tuple[str, int, Evaluation], ...]
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    constants: tuple[Port, ...]
    resetting: tuple[str, ...] = ()

    @property
    def network(self) -> Network:
        return self.plan.network

    def every(self, port: Port) -> int:
        """How many base ticks an output holds."""
        return self.network.entries[port[0]].every


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


def select(plan: Plan, chosen: frozenset[str]) -> Selection:
    """The selection of these blocks.

    Raises
    ------
    UsageError : they have no output.
    GraphError : an input of theirs depends on an output of theirs in the same tick, or one of
        them has continuous states.
    """
    network = plan.network
    constant = {
        (step.block, port)
        for step in plan.steps
        if step.constant
        for port in step.evaluation.outputs
    }
    sources = {
        (wire.source.block, wire.source.port): None
        for wire in network.driving
        if wire.block in chosen
    }
    switches = dict.fromkeys(n for b in sorted(chosen) for n in plan.enables.get(b, ()))
    sources |= {(name, "on"): None for name in switches}
    steps = tuple(s for s in plan.steps if s.block in chosen and not s.constant)
    emitter = Emitter(plan, [])
    updates = tuple(u for u in emitter.updates() if u[0] in chosen)
    read = {
        (wire.source.block, wire.source.port)
        for wire in network.driving
        if wire.block not in chosen
    }
    read |= {(n, "on") for b, names in plan.enables.items() if b not in chosen for n in names}
    inside = {(wire.source.block, wire.source.port) for wire in network.driving}
    made = [(step.block, port) for step in steps for port in step.evaluation.outputs]
    outputs = [port for port in made if port in read] or [p for p in made if p not in inside]
    working = {step.block for step in steps} | {name for name, _, _ in updates}
    selection = Selection(
        plan,
        tuple(sorted(working)),
        steps,
        updates,
        tuple(p for p in sources if p[0] not in chosen and p not in constant),
        tuple(outputs or made),
        tuple(p for p in sources if p in constant),
        tuple(name for name in emitter.resetting() if name in switches),
    )
    if not selection.outputs:
        names = ", ".join(sorted(chosen))
        raise UsageError(f"nothing to export: {names} computes no output that changes in a run")
    _check_evaluation(selection)
    _check_order(selection, chosen)
    return selection


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
            problems.append(Problem(entry.node.where, entry.address, message))
    if problems:
        raise GraphError(problems)


def _check_order(selection: Selection, chosen: frozenset[str]) -> None:
    """Check that all inputs are known before the outputs are computed."""
    network, plan = selection.network, selection.plan
    wires = drivers(network)
    behind: dict[Port, Port] = {}  # an output of another block, and the one of ours it depends on
    for step in plan.steps:
        if step.block in chosen or step.constant:
            continue
        sources = [
            (wire.source.block, wire.source.port)
            for port in step.evaluation.needs
            for wire in wires.get((step.block, port), ())
        ]
        for source in (*sources, *((name, "on") for name in step.enables)):
            if source[0] in chosen and source not in selection.constants:
                behind |= {(step.block, out): source for out in step.evaluation.outputs}
            elif source in behind:
                behind |= {(step.block, out): behind[source] for out in step.evaluation.outputs}
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
