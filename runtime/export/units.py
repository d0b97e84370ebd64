"""The blocks' C text: one piece for all blocks whose text is the same."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from blocks.core import BlockState
from runtime.codegen import support, unused
from runtime.engine.compiled import Kernel, fixed_sizes, make_kernels
from runtime.errors import GraphError, Problem
from runtime.export.selection import Selection

ENTRIES = re.compile(r"^struct entries \{\n(.*?)^\};", re.MULTILINE | re.DOTALL)
MEMBER = re.compile(r"^    (.*?)(\w+);$", re.MULTILINE)
TAKEN = re.compile(r"\btake\(ctx, ([^,]*), \d+\)")
ALIGNED = 32  # bytes that local arrays are multiples of


@dataclass(frozen=True)
class BlockText:
    """One block: the prefix of its functions, and the values of its entries.

    first : the number of its first failure.
    words : the members of its ``struct <prefix>_entries`` with their C types, and for each the
        value: a number, or an array. owned : which arrays are the state's.
    """

    prefix: str
    first: int
    words: tuple[tuple[str, str], ...]
    values: tuple[Any, ...]
    owned: tuple[bool, ...]


@dataclass
class Units:
    """The text of all blocks, and each block's part in it.

    failures : by number, as the text names them: what went wrong, and where.
    arena : bytes that the local arrays of one call take at most, where that is known.
    largest : bytes of the largest local array of known size.
    open : whether the sizes of some local arrays depend on data.
    """

    text: str = ""
    blocks: dict[str, BlockText] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    arena: int = 0
    largest: int = 0
    open: bool = False


def write_units(selection: Selection, states: Mapping[str, BlockState]) -> Units:
    """The C text of the selected blocks.

    Parameters
    ----------
    states : after ``start``.

    Raises
    ------
    GraphError : naming every block that cannot be exported, and why.
    """
    network = selection.network
    with fixed_sizes():
        kernels = make_kernels(network, states)
    units, problems = Units(), []
    known: dict[tuple[str, str], tuple[str, int]] = {}
    taken: set[str] = set()
    texts = []
    for name in selection.blocks:
        entry = network.entries[name]
        kernel = kernels.compiled.get(name)
        values = () if kernel is None else tuple(leaves(kernel.fields(entry.made, states[name])))
        reason = kernels.refused.get(name, "")
        if any(isinstance(value, np.random.Generator) for value in values):
            reason = "it draws random numbers while it runs"
        if reason or kernel is None:
            message = f"'{name}' cannot be exported: {reason}"
            problems.append(Problem(entry.node.where, entry.address, message))
            continue
        key = (entry.cls.__name__, kernel.text)
        if key not in known:
            prefix = unused(_snake(entry.cls.__name__), taken)
            known[key] = prefix, len(units.failures)
            texts.append(kernel.enclosed(prefix).text)
            units.failures += [f"{prefix}: {message}" for _, message, *_ in kernel.failures]
            _measure(units, kernel.text.replace(support(), ""))
        words = _words(kernel.text)
        units.blocks[name] = BlockText(*known[key], words, values, _owned(kernel, values))
    if problems:
        raise GraphError(problems)
    units.text = "\n".join(texts)
    return units


def leaves(value: Any) -> list[Any]:
    """The values in nested tuples."""
    return (
        [leaf for part in value for leaf in leaves(part)] if isinstance(value, tuple) else [value]
    )


def _owned(kernel: Kernel, values: tuple[Any, ...]) -> tuple[bool, ...]:
    """Which values are arrays of the block's state."""
    owners = [word.partition("_")[0] for word, _ in _words(kernel.text)]
    return tuple(
        owner == "state" and isinstance(value, np.ndarray)
        for owner, value in zip(owners, values, strict=True)
    )


def _words(text: str) -> tuple[tuple[str, str], ...]:
    """The members of a unit's ``struct entries``, and their C types."""
    found = ENTRIES.search(text)
    members = MEMBER.findall(found.group(1)) if found else []
    return tuple((name, kind.strip()) for kind, name in members if name != "none")


def _measure(units: Units, text: str) -> None:
    """What a unit's local arrays need."""
    sizes = TAKEN.findall(text)
    fixed = [-(-int(size) // ALIGNED) * ALIGNED for size in sizes if size.isdigit()]
    units.arena = max(units.arena, sum(fixed))
    units.largest = max([units.largest, *fixed])
    units.open |= len(fixed) < len(sizes)


def _snake(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
