"""Each block's own check of its place in the graph: its step, types, wires, lengths and world.

In: a network with types. Out: problems of the blocks whose contexts are complete, and the package
that one of them needs and that is not installed::

    blocks: {q: {type: Selector, indices: [3]}}, 2 components wired: expected numbers from 0 to 1

What another error leaves incomplete is not checked: it would be reported twice.
"""

from __future__ import annotations

import math

from blocks.core import Block, MissingPackageError, ParameterError
from runtime.errors import Problems, raised_text
from runtime.network.addresses import Endpoint
from runtime.network.network import Network, place_of
from runtime.network.shapes import MAX_BYTES, whole_shape


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
