"""Checks whether a user's block follows the rules that a run relies on."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

from blocks.core import (
    Block,
    BlockContext,
    ParameterError,
    PortType,
    Same,
    Scalar,
    SignalType,
    hint,
)
from blocks.library.registry import is_built_in
from runtime.checking.bench import OUTSIDE, Bench, CheckError
from runtime.compiler import refusals
from runtime.errors import raised_text

if TYPE_CHECKING:
    from blocks.world import World

__all__ = ["CheckError", "NotCompiledWarning", "NotCopiedWarning", "check_block"]

LENGTH = 3
TERMS = (2, 1, *range(3, 10), 0)


def check_block(
    block: Block,
    inputs: dict[str, SignalType] | None = None,
    ticks: int = 5,
    dt: float = 0.01,
    world: World | None = None,
) -> None:
    """Run a block on random inputs and check that it follows the rules of :mod:`blocks.core.block`.

    Every output has its declared form. Outputs change neither the state nor their inputs, and
    return the same values when called twice. Everything that changes is in a declared
    :class:`State`, so that two runs with one seed are equal, simultaneous runs do not affect each
    other, and a run that resumes from its declared states continues identically.

    What the compiled engine cannot compile is no broken rule, since it calls it from Python, which
    is slower: a :class:`NotCompiledWarning` lists it with file, line and a suggestion. Memory that
    cannot be copied, such as an open file, is a warning, too.

    Parameters
    ----------
    block : the block, made with the parameters to check it with.
    inputs : types of input ports, as in ``{"path": Path(50)}``; by default ``Same("T")`` is a
        ``Scalar`` and an open length is 3.
    ticks : ticks to run.
    dt : the block's step (s).
    world : walls and obstacles, for a block that needs them.

    Raises
    ------
    CheckError : at the first rule that is broken.
    ParameterError : if the block rejects this step or these types.
    """
    name = type(block).__name__
    if not (type(block).__doc__ or "").strip():
        raise CheckError(f"{name}: has no docstring; draw the box and give its equation")
    _check_parameters(block)
    bench = Bench(block, context_for(block, inputs or {}, dt, world), ticks)
    first = list(bench.run(seed=0, careful=True))
    _compare(first, bench.run(seed=0), f"{name}: two runs with the same seed differ")
    pairs = zip(bench.run(seed=0), bench.run(seed=1, stream=1), strict=True)
    message = f"{name}: simultaneous runs affect each other"
    _compare(first, (mine for mine, _ in pairs), message)
    resumed = bench.run(seed=0, resumed=True)
    _compare(first, resumed, f"{name}: a run that resumes from its declared states differs")
    if any(port.optional for port in block.spec.inputs.values()) and _may_be_open(bench):
        list(replace(bench, ticks=1, open_inputs=True).run(seed=0, careful=True))
    for reason in refusals(block, bench.started(), bench.context):
        warnings.warn(f"{name}.{reason}", NotCompiledWarning, stacklevel=2)
    why = "" if is_built_in(type(block)) else bench.not_copied()
    if why:
        text = f"{name} {why}: such a block is not compared, not branched and not checkpointed"
        warnings.warn(text, NotCopiedWarning, stacklevel=2)


class NotCopiedWarning(UserWarning):
    """A block keeps memory that cannot be copied."""


class NotCompiledWarning(UserWarning):
    """A method of a block cannot be compiled."""


def _may_be_open(bench: Bench) -> bool:
    """Whether the block accepts that nothing is wired to its optional inputs."""
    try:
        bench.block.validate_in(bench.open_context)
    except ParameterError:
        return False
    return True


def _check_parameters(block: Block) -> None:
    name = type(block).__name__
    try:
        same = type(block)(**block.parameters()) == block
    except BaseException as error:
        reason = raised_text(error, with_place=False)
        raise CheckError(f"{name}: cannot be rebuilt from parameters(): {reason}") from error
    if not same:
        raise CheckError(f"{name}: differs when rebuilt from parameters()")


def _compare(first: list[dict[str, Any]], again: Iterator[dict[str, Any]], message: str) -> None:
    for tick, (a, b) in enumerate(zip(first, again, strict=True)):
        for item in a:
            if a[item] != b[item]:
                raise CheckError(f"{message}, in {item} at tick {tick}; {OUTSIDE}")


def context_for(
    block: Block, given: Mapping[str, SignalType], dt: float, world: World | None = None
) -> BlockContext:
    """A context for a single block: the given types, then its own, then the defaults.

    Raises
    ------
    ParameterError : if the block rejects it with every number of terms.
    ValueError : if a given type does not fit the port.
    """
    spec = block.spec
    variables, lengths = dict(block.variables), dict(block.sizes())
    for name, kind in given.items():
        if name not in spec.inputs:
            suggestion = (
                hint(name, spec.inputs) or f"; its inputs: {', '.join(spec.inputs) or 'none'}"
            )
            raise ValueError(f"{type(block).__name__} has no input '{name}'{suggestion}")
        declared = block.port_type(name)
        if isinstance(declared, Same):
            variables.setdefault(declared.variable, kind)
        elif declared.symbol and isinstance(kind.length, int):
            lengths.setdefault(declared.symbol, kind.length)

    lengths.update({s: n for s, n in block.infer(lengths).items() if s not in lengths})

    def resolve(declared: PortType) -> SignalType:
        kind = variables.get(declared.variable, Scalar) if isinstance(declared, Same) else declared
        return kind.sized(lengths.get(kind.symbol, LENGTH)) if kind.symbol else kind

    variadic = [name for name, port in spec.inputs.items() if port.variadic]
    rejections = []
    # The same number everywhere first: most blocks take any, or one for all of their inputs.
    alike = [(count,) * len(variadic) for count in TERMS]
    for counts in dict.fromkeys([*alike, *product(TERMS, repeat=len(variadic))]):
        given_counts = dict(zip(variadic, counts, strict=True))
        spread = {spec.inputs[name].spread: n for name, n in given_counts.items()}
        lengths.update({symbol: n for symbol, n in spread.items() if symbol})
        _complete(block, lengths, resolve)
        types = {name: resolve(block.port_type(name)) for name in spec.ports}
        _check_given(block, given, types)
        terms = {name: (True,) * n for name, n in given_counts.items()}
        context = BlockContext(dt, types, terms, world, lengths)
        try:
            block.validate_in(context)
        except ParameterError as error:
            rejections.append(error)
        else:
            return context
    raise rejections[0]


def _check_given(
    block: Block, given: Mapping[str, SignalType], types: Mapping[str, SignalType]
) -> None:
    for name, kind in given.items():
        if types[name] != (kind.sized(types[name].length) if kind.symbol else kind):
            raise ValueError(f"{type(block).__name__}.{name} takes {types[name]}, not {kind}")


def _complete(
    block: Block, lengths: dict[str, int], resolve: Callable[[PortType], SignalType]
) -> None:
    """Add the lengths that are still open: those of outputs may follow from those of inputs."""
    for ports in (block.spec.inputs, block.spec.outputs):
        for port in ports.values():
            if isinstance(port.type, SignalType) and port.type.symbol:
                lengths.setdefault(port.type.symbol, resolve(port.type).shape[0])
        lengths.update({s: n for s, n in block.infer(lengths).items() if s not in lengths})
