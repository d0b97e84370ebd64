"""Checks of each block in its place: shapes, its own check, what it switches, walls it passes.

In: a network with types. Out: problems of the blocks whose contexts are complete, and the package
that one of them needs and that is not installed::

    blocks: {q: {type: Selector, indices: [3]}}, 2 components wired: expected numbers from 0 to 1

What another error leaves incomplete is not checked: it would be reported twice.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import FunctionType, ModuleType

from blocks.core import (
    Block,
    GraphInput,
    MissingPackageError,
    ParameterError,
    PartEnable,
    Pose,
    state_lengths,
    state_shape,
)
from blocks.library.registry import is_built_in
from blocks.messages import Note
from runtime.errors import Problems, raised_text
from runtime.network.addresses import Endpoint
from runtime.network.network import Network, NetworkEntry, place_of
from runtime.network.scope import INPUTS

MAX_BYTES = 4 * 1024**3
GENERATORS = ("default_rng", "Generator", "RandomState", "Random")


def whole_shape(network: Network, end: Endpoint) -> tuple[int, ...] | None:
    """Shape of the output or state at an address; None while a type, a length or the block is
    unknown.

    A state's length may be open although the types of all ports are known: a Decoder that is wired
    on both sides has the rows of its weights from the Ensemble, which may have no input yet.
    """
    entry = network.entries.get(end.block)
    if entry is None or entry.block_or_none is None:
        return None
    spec = entry.cls.spec
    if end.port in spec.outputs:
        kind = network.types.get((end.block, end.port))
        return None if kind is None else kind.shape
    if not network.is_typed(end.block):
        return None
    state, context = spec.states[end.port], network.context(end.block)
    lengths = state_lengths(entry.block, context)
    if any(isinstance(n, str) and n not in lengths for n in state.shape):
        return None
    return state_shape(entry.block, state, context)


def failure_text(cls: type[Block], error: BaseException) -> str:
    """What a user's class raised, and where."""
    return f"{cls.__name__} failed: {raised_text(error)}"


def _shape_problem(network: Network, name: str) -> str:
    """Which of a block's arrays cannot be allocated, and why; '' if all can."""
    spec = network.entries[name].cls.spec
    for key in (*spec.states, *spec.outputs):
        shape = whole_shape(network, Endpoint(name, key)) or ()
        size = 8 * math.prod(shape)
        if any(n < 0 for n in shape):
            return f"state '{key}' has a negative length"
        if size > MAX_BYTES:
            # A product of integers has no limit, and a float has.
            return f"'{key}' would take {min(size, 10**300) / 1024**3:.4g} GiB; make it smaller"
    return ""


def _count_problem(network: Network, name: str) -> str:
    """Which variadic input does not have as many wires as its block says; '' if none."""
    entry = network.entries[name]
    for key, port in entry.cls.spec.inputs.items():
        if isinstance(port.variadic, str):
            expected_count = entry.block.value(port.variadic)
            count = len(network.terms.get((name, key), ()))
            if count != expected_count:
                return (
                    f"input '{key}' takes {port.variadic} = {expected_count} wires, {count} are "
                    f"connected; change one of the two"
                )
    return ""


def check_contexts(network: Network, problems: Problems) -> MissingPackageError | None:
    """Let each block check its context, once all its ports have types.

    Returns the error of a block that needs a package that is not installed: the graph is right.
    """
    missing: MissingPackageError | None = None
    incomplete = _incomplete(network)
    for name, entry in network.entries.items():
        if (
            entry.block_or_none is None
            or not network.is_typed(name)
            or network.waits(name)
            or name in incomplete
        ):
            continue
        try:
            context = network.context(name)
            message = _count_problem(network, name) or _shape_problem(network, name)
            if message:
                problems.add(entry.node.key, entry.address, message)
                continue
            entry.block.validate_in(context)
        except ParameterError as error:
            for parameter, text in error.problems:
                where = place_of(entry.node, parameter)
                problems.add(where, f"{entry.address}.{parameter}", text)
        except MissingPackageError as error:
            missing = error
        except BaseException as error:  # noqa: BLE001 -- a user's block may raise anything
            text = failure_text(entry.cls, error)
            problems.add(entry.node.key, entry.address, text, "block-failed")
    return missing


def _incomplete(network: Network) -> set[str]:
    """Blocks to which something is not wired, or with an unknown type, for a reported reason."""
    removed = {(wire.block, wire.port, wire.term) for wire in network.removed_wires}
    lost = {
        (*at, term)
        for at, flags in network.terms.items()
        if not all(flags)
        for term, flag in enumerate(flags)
        if not flag
    }
    untyped = {
        wire.block
        for wire in network.wires
        if (wire.source.block, wire.source.port) not in network.types
    }
    return untyped | {block for block, _, _ in lost - removed}


# What a part has that is there while it is off.
FROM_OUTSIDE = (PartEnable, GraphInput)


def enables_of(network: Network) -> dict[str, tuple[str, ...]]:
    """The blocks that switch each block, those of outer parts first; only of blocks that have any.

    A block that switches a part is itself switched by those of the parts around it only.
    """
    result: dict[str, tuple[str, ...]] = {}
    # By depth: a part inside of one that is off is off, whatever its own block says.
    enables = sorted(_enables(network), key=lambda entry: (len(entry.scope.prefix), entry.name))
    for name, entry in network.entries.items():
        above = tuple(
            enable.name
            for enable in enables
            if name.startswith(enable.scope.prefix)
            and not (issubclass(entry.cls, FROM_OUTSIDE) and entry.scope is enable.scope)
        )
        if above:
            result[name] = above
    return result


def resets(network: Network, name: str) -> bool:
    """Whether a block resets the part that it is in while it is off."""
    block = network.entries[name].block_or_none
    return isinstance(block, PartEnable) and block.resets


def check_enabling(network: Network, problems: Problems) -> None:
    """Report blocks that switch no part, or that what they switch would have to switch on."""
    for enable in _enables(network):
        kind, prefix = enable.cls.__name__, enable.scope.prefix
        if enable.scope.is_graph:
            message = f"{kind} switches the part that it is in, but this is not in one; move it, "
            message += "with the blocks that it switches, to a part ({graph: part.yaml})"
            problems.add(enable.node.key, enable.address, message)
            continue
        for wire in network.wires:
            inside = wire.source.block.startswith(prefix)
            is_input = wire.source.block.startswith(f"{prefix}{INPUTS}")
            if wire.block == enable.name and inside and not is_input:
                message = f"'{wire.source}' is in the part that '{enable.name}' switches, and would"
                message += (
                    " not change once the part is off; wire a signal from outside of the part"
                )
                problems.add(wire.where, wire.address, message)
        is_momentary = issubclass(enable.cls, PartEnable) and enable.cls.momentary
        for name, entry in network.entries.items():
            # A solver integrates over the time between ticks; a part that runs on single ticks has
            # none.
            if is_momentary and name.startswith(prefix) and entry.cls.spec.continuous:
                message = f"its states are continuous, but '{enable.name}' runs the part on single "
                message += "ticks; use Enable, or a block in discrete time"
                problems.add(entry.node.key, entry.address, message)


def _enables(network: Network) -> Iterator[NetworkEntry]:
    return (each for each in network.entries.values() if issubclass(each.cls, PartEnable))


def context_notes(network: Network) -> list[Note]:
    """What is dubious of blocks in their places: bodies that pass walls, draws without seed."""
    return [*_contact_notes(network), *_random_notes(network)]


def _contact_notes(network: Network) -> list[Note]:
    """The moving bodies of a graph with a world that no surface stops and no block measures.

    A body is what turns commands into a pose: a block with states, an output Pose and no input of
    that type, which sensors, estimators and followers of paths have. One with an output
    ``contact`` of its own, such as a robot with physics, has a body unless its radius is 0.
    """
    if network.world is None:
        return []
    measured = {
        (wire.source.block, wire.source.port)
        for wire in network.wires
        if "contact" in network.entries[wire.block].cls.spec.outputs
    }
    notes = []
    for name, entry in network.entries.items():
        spec = entry.cls.spec
        poses = [port for port in spec.outputs if network.types.get((name, port)) == Pose]
        takes_poses = any(network.types.get((name, port)) == Pose for port in spec.inputs)
        if entry.block_or_none is None or not poses or takes_poses:
            continue
        radius = getattr(entry.block, "body_radius", None)
        stopped = bool(radius) or (radius is None and "contact" in spec.outputs)
        moves = spec.update is not None or spec.continuous
        if moves and not stopped and measured.isdisjoint((name, port) for port in poses):
            give = "give it a body_radius, or " if radius is not None else ""
            text = (
                f"block '{name}': passes through the walls of the world: nothing stops or measures "
                f"it; {give}wire {name}.{poses[0]} to a Contact"
            )
            notes.append(Note(text, "passes-walls", block=name))
    return notes


def _random_notes(network: Network) -> list[Note]:
    """The own blocks that draw random numbers which no seed of the run sets."""
    notes = []
    for name, entry in network.entries.items():
        if method := _draws_elsewhere(entry.cls):
            text = (
                f"block '{name}': {method} draws from a generator that the run's seed does not "
                "set, so that no two runs are equal; draw from state.rng"
            )
            notes.append(Note(text, "block-note", block=name))
    return notes


def _draws_elsewhere(cls: type[Block]) -> str:
    """The method of an own class that names ``np.random`` or ``random``; '' if none does.

    One that makes a generator, which it may seed, is not meant.
    """
    for owner in cls.__mro__:
        if is_built_in(owner):
            break
        for method in vars(owner).values():
            if isinstance(method, FunctionType):
                names = set(method.__code__.co_names)
                modules = {
                    value.__name__
                    for name in names
                    if isinstance(value := method.__globals__.get(name), ModuleType)
                }
                of_numpy = "numpy.random" in modules or ("numpy" in modules and "random" in names)
                if ("random" in modules or of_numpy) and names.isdisjoint(GENERATORS):
                    return method.__qualname__
    return ""
