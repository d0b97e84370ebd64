"""What follows from the tunable parameters of a block, as C: by a trace of its ``start``.

In goes a block with its state, out come its tunable numbers and, for each word of its struct that
follows from them, C expressions of ``c->parameters``. ``start`` runs with stand-ins for numbers,
which write down what is computed with them::

    state.share = -math.expm1(-state.dt / self.tau)
    ->  (-expm1((-0.001) / c->parameters.filter_tau))

A comparison is tried both ways. A solver that wants a float raises in the stand-in: the parameter
is then one of those that C does not follow, and what follows from it is settable instead. Each
expression is compared with ``start`` for other values before it is believed.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from blocks.core import Block, BlockState, Param, ParameterError, retune
from runtime.export.names import member_name, unused
from runtime.export.symbolic import (
    DECISIONS,
    FUNCTIONS,
    Decisions,
    Number,
    symbolic_math,
    text_of,
)


def _as_c(function: Callable[[float], float]) -> Callable[[float], Any]:
    return lambda x: np.float64(function(x))


# The functions of expressions in Python; numbers divide as C's do.
IN_PYTHON: dict[str, Any] = {
    **{name: _as_c(getattr(math, name)) for name in FUNCTIONS},
    **{"fabs": abs, "pick": lambda condition, one, other: one if condition else other},
    **{"INFINITY": math.inf, "NAN": math.nan},
}
MOST_DECISIONS = 6  # in a row, each tried both ways
SHARES = (1.0, 0.75, 1.3)  # of a parameter's value: where expressions are compared with start


@dataclass(frozen=True)
class Tunable:
    """A tunable number of a block, or an array of them.

    path : as a session's ``set`` names it: ``gain``, ``constants.k``. member : of the C struct.
    """

    path: str
    member: str
    value: np.ndarray[Any, Any]
    declared: Param
    is_array: bool

    @property
    def is_scalar(self) -> bool:
        return self.value.ndim == 0

    @property
    def texts(self) -> list[str]:
        """Each number in C."""
        place = f"c->parameters.{self.member}"
        return [place] if self.is_scalar else [f"{place}[{i}]" for i in range(self.value.size)]

    @property
    def stand_in(self) -> Any:
        """What start is run with."""
        made = np.empty(self.value.shape, dtype=object)
        made.ravel()[...] = [Number(text) for text in self.texts]
        return made if self.is_array else made.item()


@dataclass(frozen=True)
class Followed:
    """A block's tunable numbers in C.

    tunables : those of which C computes what follows. words : of each member of the block's struct
    that follows, the expressions of its numbers. others : the tunables of which C does not,
    by path, with the members that follow.
    """

    tunables: tuple[Tunable, ...]
    words: Mapping[str, tuple[str, ...]]
    others: Mapping[str, tuple[str, ...]]


def followed(
    name: str,
    block: Block,
    state: BlockState,
    attributes: tuple[tuple[str, str], ...],
    members: set[str],
) -> Followed:
    """What follows from the tunable parameters of a block.

    Parameters
    ----------
    name : of the block. state : after start.
    attributes : what its struct has: ("self" or "state", attribute); ("output", method) is what
        a method returns of which nothing changes, as a constant's.
    members : names that the struct has already; those of this block are added.
    """
    traced, direct = list[Tunable](), list[Tunable]()
    words, others = dict[str, tuple[str, ...]](), dict[str, tuple[str, ...]]()
    for one in _tunables(name, block, members):
        found = _found(block, state, attributes, [*traced, one])
        own = f"self_{block.spec.attributes.get(one.path, '')}"
        changed = () if found else _changed(block, state, attributes, one)
        is_direct = changed == (own,)
        if is_direct:
            # A step reads the parameter itself, and start draws random numbers with it.
            found = {own: tuple(one.texts)}
        if found and _is_right(block, state, attributes, [*traced, *direct, one], words | found):
            (direct if is_direct else traced).append(one)
            words |= found
        else:
            others[one.path] = changed or _changed(block, state, attributes, one)
    kept = (*traced, *direct)
    return Followed(kept, words, others)


def _tunables(name: str, block: Block, members: set[str]) -> Iterator[Tunable]:
    """The numbers of a block that a session may change."""
    for own, declared in block.spec.params.items():
        value = block.value(own)
        settings = getattr(value, "declared", {})
        names = getattr(value, "values", {}) if declared.tunable else {}
        every: dict[tuple[str, ...], tuple[Any, Param]]
        every = {(own,): (value, declared)} if declared.tunable else {}
        if isinstance(names, Mapping) and names:
            every = {(own, key): (each, declared) for key, each in names.items()}
        every |= {
            (own, key): (getattr(value, key, None), each)
            for key, each in settings.items()
            if each.tunable
        }
        for path, (number, of) in every.items():
            array = np.asarray(number)
            if array.dtype.kind == "f" or (array.dtype.kind == "i" and of.kind != "int"):
                # Block M_PI and block PI of part M both have an M_PI_gain.
                member = unused(member_name("_".join((name, *path))), members)
                numbers = array.astype(np.float64)
                yield Tunable(".".join(path), member, numbers, of, isinstance(number, np.ndarray))


def _placed(block: Block, tunables: list[Tunable], value: Callable[[Tunable], Any]) -> Block:
    """A copy of a block with other values, past its validation."""
    made = object.__new__(type(block))
    every = (item for c in type(block).__mro__ for item in vars(c).items())
    cached = {name for name, member in every if isinstance(member, cached_property)}
    vars(made).update({key: each for key, each in vars(block).items() if key not in cached})
    for one in tunables:
        own, _, key = one.path.partition(".")
        attribute = block.spec.attributes[own]
        if not key:
            vars(made)[attribute] = value(one)
            continue
        setting = vars(made)[attribute] = copy.copy(vars(made)[attribute])
        if isinstance(getattr(setting, "values", None), Mapping):
            vars(setting)["values"] = {**setting.values, key: value(one)}
        else:
            vars(setting)[key] = value(one)
    return made


def _found(
    block: Block, state: BlockState, attributes: tuple[tuple[str, str], ...], all_of: list[Tunable]
) -> dict[str, tuple[str, ...]]:
    """What :func:`_trace` finds; nothing if start does what a stand-in cannot."""
    # Memory of floats first: NumPy has no exp of objects. But noise starts with a draw, which has
    # stand-ins in it, and is then put back.
    for kind in (np.float64, np.object_):
        try:
            return _trace(block, state, attributes, all_of, kind)
        except Exception:  # noqa: BLE001 -- what a stand-in cannot do ends in any of many errors
            continue
    return {}


def _trace(
    block: Block,
    state: BlockState,
    attributes: tuple[tuple[str, str], ...],
    all_of: list[Tunable],
    kind: type[np.generic],
) -> dict[str, tuple[str, ...]]:
    """The expressions of the words that follow from stand-ins, with memory of this type."""

    def explored(chosen: tuple[bool, ...]) -> dict[str, tuple[str, ...]]:
        """The words after these decisions, and after either answer of each later one."""
        decisions = Decisions(chosen)
        token = DECISIONS.set(decisions)
        try:
            found = _start(block, state, attributes, all_of, kind)
        finally:
            DECISIONS.reset(token)
        if len(decisions.asked) == len(chosen):
            return found
        if len(chosen) == MOST_DECISIONS:
            raise TypeError("too many decisions")
        condition = decisions.asked[len(chosen)]
        one, other = explored((*chosen, True)), explored((*chosen, False))
        return {
            word: tuple(
                _picked(condition, *pair) for pair in zip(one[word], other[word], strict=True)
            )
            for word in one
        }

    words = explored(())
    return {word: texts for word, texts in words.items() if any("c->" in each for each in texts)}


def _picked(condition: str, one: str, other: str) -> str:
    return one if one == other else f"pick({condition}, {one}, {other})"


def _start(
    block: Block,
    state: BlockState,
    attributes: tuple[tuple[str, str], ...],
    all_of: list[Tunable],
    kind: type[np.generic],
) -> dict[str, tuple[str, ...]]:
    """The numbers of all words after start with stand-ins, as C."""
    made = _placed(block, all_of, lambda one: one.stand_in)
    held = vars(state)
    arrays = {name: held[name].copy() for name in block.spec.states}
    memory = {name: np.zeros_like(array, dtype=kind) for name, array in arrays.items()}
    again = BlockState(state.context, state.seed, memory)
    again.published = state.published
    with symbolic_math():
        made.start(again)
        for name, array in arrays.items():
            if not block.spec.states[name].cached:
                vars(again)[name][...] = array
        made.resume(again)
    found: dict[str, tuple[str, ...]] = {}
    for word, value in _words(made, again, attributes).items():
        is_number = isinstance(value, (Number, float, np.floating))
        if is_number or (isinstance(value, np.ndarray) and value.dtype.kind in "fO"):
            numbers = np.ravel(np.asarray(value, dtype=object)).tolist()
            found[word] = tuple(map(text_of, numbers))
    return found


def _words(
    block: Block, state: BlockState, attributes: tuple[tuple[str, str], ...]
) -> dict[str, Any]:
    """The members of a block's struct with their values; those of a tuple have numbers."""

    def parts(name: str, value: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(value, tuple):
            for i, part in enumerate(value):
                yield from parts(f"{name}_{i}", part)
        else:
            yield name, value

    of: dict[str, Any] = {"self": block, "state": state, "output": _Outputs(block, state)}
    pairs = [parts(f"{owner}_{name}", getattr(of[owner], name)) for owner, name in attributes]
    return {word: value for each in pairs for word, value in each}


def _shared(one: Tunable, share: float) -> np.ndarray[Any, Any]:
    """Other values than a tunable's: a share of each, of 0 and infinity something else."""
    finite = np.where(np.isfinite(one.value), one.value, 10.0)
    moved = finite * share + (share - 1.0) * (finite == 0.0)
    return one.value if share == 1.0 else np.asarray(moved)


def _other(block: Block, tunables: list[Tunable], share: float) -> Block | None:
    """The block with other numbers; None if it does not accept these."""
    if any("." in one.path for one in tunables):
        return _placed(block, tunables, lambda one: _numbers_of(one, share))
    written = {one.path: _shared(one, share).tolist() for one in tunables}
    try:
        return type(block)(**{**block.parameters(), **written})
    except (ParameterError, TypeError, ValueError):
        return None


def _numbers_of(one: Tunable, share: float) -> Any:
    """What an attribute of a setting has."""
    numbers = _shared(one, share)
    return numbers if one.is_array else numbers.tolist()


def _retuned(
    state: BlockState, attributes: tuple[tuple[str, str], ...], other: Block
) -> dict[str, Any]:
    """The words as a session has them after ``set``; the state is as before."""
    again = copy.deepcopy(vars(state)) | {"context": state.context, "published": state.published}
    made = object.__new__(BlockState)
    vars(made).update(again)
    retune(other, made)
    return _words(other, made, attributes)


def _is_right(
    block: Block,
    state: BlockState,
    attributes: tuple[tuple[str, str], ...],
    tunables: list[Tunable],
    words: Mapping[str, tuple[str, ...]],
) -> bool:
    """Whether the expressions give, to the bit, what a session has for several values."""
    compared = 0
    before = _words(block, state, attributes)
    for share in SHARES:
        other = _other(block, tunables, share)
        if other is None:
            continue
        values = {one.member: np.ravel(_shared(one, share)) for one in tunables}
        struct = SimpleNamespace(
            **{t.member: values[t.member][0] if t.is_scalar else values[t.member] for t in tunables}
        )
        names = {**IN_PYTHON, "p": struct}
        try:
            actual = _retuned(state, attributes, other)
        except Exception:  # noqa: BLE001 -- a session makes a new engine then
            return False
        for word, value in actual.items():
            texts = words.get(word)
            if texts is None:
                if not _same(before[word], value):
                    return False
                continue
            try:
                numbers = [float(eval(_python(text), dict(names))) for text in texts]
            except ArithmeticError:
                return False
            if not _same(np.ravel(value).tolist(), numbers):
                return False
        compared += 1
    return compared > 0


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, np.random.Generator) or not isinstance(one, (int, float, list, np.ndarray)):
        return True
    return np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f")


def _python(text: str) -> str:
    return (
        text.replace("c->parameters", "p")
        .replace("(double)INFINITY", "float('inf')")
        .replace("(double)NAN", "float('nan')")
    )


def _changed(
    block: Block, state: BlockState, attributes: tuple[tuple[str, str], ...], one: Tunable
) -> tuple[str, ...]:
    """The words that follow from a tunable of which C does not know how."""
    before, found = _words(block, state, attributes), dict[str, None]()
    for share in SHARES[1:]:
        if (other := _other(block, [one], share)) is None:
            continue
        try:
            after = _retuned(state, attributes, other)
        except Exception:  # noqa: BLE001 -- a session makes a new engine then
            continue
        found |= {w: None for w, v in after.items() if w in before and not _same(before[w], v)}
    return tuple(found)


class _Outputs:
    """What output methods of a block return that takes no input, as attributes."""

    def __init__(self, block: Block, state: BlockState) -> None:
        self.block, self.held = block, state

    def __getattr__(self, method: str) -> Any:
        return getattr(self.block, method)(self.held, 0.0)
