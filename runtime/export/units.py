"""The blocks' C text: one piece for all blocks whose text is the same."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from blocks.core import BlockState
from runtime.codegen import CFunction, Counter, unused
from runtime.compiler import Kernel, bits_of, fixed_sizes
from runtime.engine.compiled import make_kernels
from runtime.errors import GraphError, Problem
from runtime.export.selection import Selection


@dataclass(frozen=True)
class BlockText:
    """One block: the prefix of its functions, and the values of its entries.

    functions : in the typed form, by their names before they have the prefix. methods : the names
        of its methods among them.
    failures : by number, as the text has them: what went wrong, and where.
    words : the members of its ``struct <prefix>_entries`` with their C types, and for each the
        value: a number, or an array (of a generator, its bits).
    owned : which arrays are the state's.
    """

    prefix: str
    functions: Mapping[str, CFunction]
    methods: Mapping[str, str]
    failures: tuple[str, ...]
    words: tuple[tuple[str, str], ...]
    values: tuple[Any, ...]
    owned: tuple[bool, ...]

    @property
    def integers(self) -> dict[str, int]:
        """The integers among the values, which nothing changes."""
        pairs = zip(self.words, self.values, strict=True)
        return {word: int(value) for (word, kind), value in pairs if kind == "int64_t"}


@dataclass
class Units:
    """The text of all blocks, and each block's part in it.

    reserved : bytes that the local arrays of one call take at most, of those of known size.
    open : the owners of local arrays whose size or number has no bound that the text tells.
    """

    text: str = ""
    blocks: dict[str, BlockText] = field(default_factory=dict)
    kernels: dict[str, Kernel] = field(default_factory=dict)
    reserved: int = 0
    open: set[str] = field(default_factory=set)


def write_units(selection: Selection, states: Mapping[str, BlockState], controller: str) -> Units:
    """The C text of the selected blocks.

    Parameters
    ----------
    states : after ``start``.
    controller : the name of its struct and functions.

    Raises
    ------
    GraphError : naming every block that cannot be exported, and why.
    """
    network = selection.network
    with fixed_sizes():
        kernels = make_kernels(network, states, typed=True)
    units, problems = Units(), []
    known: dict[tuple[str, str], str] = {}
    taken = {controller}
    texts = []
    for name in selection.blocks:
        entry = network.entries[name]
        kernel = kernels.compiled.get(name)
        values = () if kernel is None else tuple(leaves(kernel.fields(entry.block, states[name])))
        reason = kernels.refused.get(name, "")
        if reason or kernel is None:
            message = f"'{name}' cannot be exported: {reason}"
            problems.append(Problem(entry.node.where, entry.address, message))
            continue
        key = (entry.cls.__name__, kernel.text)
        is_new = key not in known
        if is_new:
            known[key] = unused(f"block_{_snake(entry.cls.__name__)}", taken)
        enclosed = units.kernels[name] = kernel.enclosed(known[key])
        if is_new:
            texts.append(enclosed.text)
        owned = _owned(kernel, values)
        values = tuple(
            bits_of(value, name).copy() if isinstance(value, np.random.Generator) else value
            for value in values
        )
        block = units.blocks[name] = BlockText(
            prefix=known[key],
            functions=kernel.functions,
            methods=kernel.symbols,
            failures=tuple(map(_failure_text, kernel.failures)),
            words=kernel.words,
            values=values,
            owned=owned,
        )
        measure(units, name, kernel.functions, kernel.symbols.values(), block.integers)
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
    owners = [word.partition("_")[0] for word, _ in kernel.words]
    return tuple(
        owner == "state" and isinstance(value, (np.ndarray, np.random.Generator))
        for owner, value in zip(owners, values, strict=True)
    )


def _failure_text(failure: tuple[str, str, str, int]) -> str:
    """What went wrong in a block, and where; an index is not in the text of a controller."""
    _, message, file, line = failure
    message = re.sub(r"\{(index|size|axis)\}", "...", message)
    return f"{message} ({Path(file).name}:{line})" if file else message


def measure(
    units: Units,
    owner: str,
    functions: Mapping[str, CFunction],
    names: Iterable[str],
    integers: Mapping[str, int] = MappingProxyType({}),
) -> None:
    """What the local arrays of functions need, given the integers of their block."""
    counter = Counter(functions)
    for name in names:
        found = counter.count(name, integers)
        units.reserved = max(units.reserved, found.reserved)
        units.open |= {owner} if found.is_open else set()


def _snake(name: str) -> str:
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", plain).lower()
