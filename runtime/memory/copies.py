"""Copies of what own blocks keep undeclared, for another run or for a later time.

In: objects that refer to the run's own. Out: copies that refer to none of it: views of a declared
state and the objects of the run are written as what they are, and found again in the other run::

    [state.h[:2], state.h[2:]]      [View("h", 0, (2,), ...), View("h", 16, (2,), ...)]
    state.rng                       Of("rng")

Arrays that share memory do so in the copy; a closure is copied with its cells.
"""

from __future__ import annotations

import copy
import functools
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.errors import NotCopiedError
from runtime.memory.record import (
    BOUND,
    EMPTY,
    FIXED,
    Array,
    copies_itself,
    kind_of,
    nothing,
    owner_of,
    parts,
    refused,
    view_like,
)


@dataclass(frozen=True)
class View:
    """A view of a declared state: its bytes from an offset on."""

    state: str
    offset: int
    shape: tuple[int, ...]
    dtype: str
    strides: tuple[int, ...]
    writeable: bool


@dataclass(frozen=True)
class Of:
    """An object that the run itself has: the block, its state, its generator, ..."""

    name: str


@dataclass(frozen=True)
class Run:
    """The objects of one run that a block's memory may refer to.

    objects : by name. states : the arrays of its declared states, views of ``memory``.
    """

    objects: Mapping[str, Any]
    states: Mapping[str, Array]
    memory: Array

    def written(self, value: Array) -> View | None:
        """A view of a declared state as what it is; None of other arrays.

        Raises
        ------
        NotCopiedError : it lies in the state of another block.
        """
        if owner_of(value) is not self.memory:
            return None
        begin = value.__array_interface__["data"][0]
        for name, array in self.states.items():
            offset = begin - array.__array_interface__["data"][0]
            if 0 <= offset < max(array.nbytes, 1):
                form = value.shape, value.dtype.str, value.strides
                return View(name, offset, *form, value.flags.writeable)
        raise NotCopiedError("refers to the state of another block")

    def found(self, view: View) -> Array:
        """The view in this run."""
        flat = self.states[view.state].reshape(-1).view(np.uint8)
        made: Array = np.ndarray(view.shape, view.dtype, flat, view.offset, view.strides)
        made.flags.writeable = view.writeable
        return made


class Copier:
    """Copies objects; what is met twice is copied once.

    Parameters
    ----------
    source : the run that the objects belong to; None of a copy that belongs to none.
    target : the run that the copies shall belong to; None for a copy that belongs to none.
    """

    def __init__(self, source: Run | None, target: Run | None = None) -> None:
        self.source, self.target = source, target
        self.memo: dict[int, Any] = {}
        if source is not None:
            self.memo = {id(value): Of(name) for name, value in source.objects.items()}
        self.owners: dict[int, Array] = {}
        self.kept: list[Any] = []  # the memo is by identity

    def place(self, value: Array, there: Array) -> None:
        """Copy an array into one that is there, which others may have the address of."""
        owner, target = owner_of(value), owner_of(there)
        flat = target.ravel(order="K")
        if owner.nbytes == target.nbytes and np.shares_memory(flat, target):
            if self.owners.get(id(owner)) is not flat:
                flat.view(np.uint8)[...] = owner.ravel(order="K").view(np.uint8)
            self.owners[id(owner)] = flat
        there[...] = value
        self.memo[id(value)] = there
        self.kept.append(value)

    def __call__(self, value: Any) -> Any:
        """The copy of an object.

        Raises
        ------
        NotCopiedError : it cannot be copied.
        """
        if id(value) in self.memo:
            return self.memo[id(value)]
        if isinstance(value, FIXED) or value is EMPTY:
            return value
        made = self._made(value)
        self.memo.setdefault(id(value), made)
        self.kept.append(value)
        return self.memo[id(value)]

    def _made(self, value: Any) -> Any:
        if isinstance(value, Of):
            return value if self.target is None else self.target.objects[value.name]
        if isinstance(value, View):
            return value if self.target is None else self.target.found(value)
        if isinstance(value, np.ndarray):
            return self._array(value)
        if parts(value) is not None:
            return self._fixed(value)
        kind = kind_of(type(value))
        if kind is None or copies_itself(value):
            return self._by_itself(value)
        made = self.memo[id(value)] = kind.made(value)
        kind.put(made, kind.mapped(kind.content(value), self))
        if type(value).__dictoffset__:
            vars(made).update({key: self(item) for key, item in list(vars(value).items())})
        return made

    def _by_itself(self, value: Any) -> Any:
        """Let an object copy itself."""
        why = refused(value)
        try:
            if not why:
                return copy.deepcopy(value, self.memo)
        except Exception as error:  # noqa: BLE001 -- copying runs code of the object
            why = str(error) or type(error).__name__
        raise NotCopiedError(f"what cannot be copied ({type(value).__name__}: {why})")

    def _array(self, value: Array) -> Any:
        view = None if self.source is None else self.source.written(value)
        if view is not None:
            return view
        if value.dtype.hasobject:
            made = self.memo[id(value)] = np.empty_like(value)
            for at in np.ndindex(value.shape):
                made[at] = self(value[at])
            return made
        owner = owner_of(value)
        if not (owner.flags.writeable or value.flags.writeable):
            return value  # nobody can change it
        if id(owner) not in self.owners:
            self.owners[id(owner)] = owner.ravel(order="K").copy()
            self.kept.append(owner)
        made = view_like(value, owner, self.owners[id(owner)])
        if type(value) is not np.ndarray:
            made = made.view(type(value))
            if type(value).__dictoffset__:
                vars(made).update({key: self(item) for key, item in vars(value).items()})
        return made

    def _fixed(self, value: Any) -> Any:
        """A copy of what cannot change itself; it is the same if all that it refers to is."""
        if isinstance(value, types.FunctionType):
            return self._function(value)
        inner = parts(value) or ()
        made = [self(each) for each in inner]
        if all(a is b for a, b in zip(inner, made, strict=True)):
            return value
        if isinstance(value, types.MethodType):
            return types.MethodType(made[1], made[0])
        if isinstance(value, BOUND):
            return getattr(made[0], value.__name__)
        if isinstance(value, functools.partial):
            return functools.partial(made[0], *made[1], **made[2])
        if isinstance(value, types.MappingProxyType):
            return types.MappingProxyType(dict(zip(value, made, strict=True)))
        new: Callable[..., Any] = tuple.__new__ if isinstance(value, tuple) else frozenset.__new__
        return new(type(value), made)

    def _function(self, value: types.FunctionType) -> Any:
        """A closure with cells of its own; other functions stay what they are."""
        if not value.__closure__:
            return value
        cells = tuple(self(cell) for cell in value.__closure__)
        if id(value) in self.memo:  # a cell refers to the function
            return self.memo[id(value)]
        made = types.FunctionType(
            value.__code__, value.__globals__, value.__name__, self(value.__defaults__), cells
        )
        self.memo[id(value)] = made
        made.__kwdefaults__ = self(value.__kwdefaults__)
        made.__qualname__, made.__module__ = value.__qualname__, value.__module__
        vars(made).update({key: self(item) for key, item in vars(value).items()})
        return made


def alike(one: Any, other: Any) -> bool:
    """Whether two objects have the same content, all that they refer to included."""
    waiting: list[tuple[Any, Any]] = [(one, other)]
    known: dict[tuple[int, int], Any] = {}  # with what is compared, so that it lives on
    while waiting:
        one, other = waiting.pop()
        if one is other or (id(one), id(other)) in known:
            continue
        known[id(one), id(other)] = one, other
        if type(one) is not type(other):
            return False
        if isinstance(one, np.ndarray) and not one.dtype.hasobject:
            form = one.shape == other.shape and one.dtype == other.dtype
            if not form or one.tobytes() != other.tobytes():
                return False
            continue
        mine, its = _inner(one), _inner(other)
        if mine is None or its is None:
            if not _equal(one, other):
                return False
        elif len(mine) != len(its):
            return False
        else:
            waiting += zip(mine, its, strict=True)
    return True


def _inner(value: Any) -> list[Any] | None:
    """What an object consists of; None if it is compared as a whole."""
    if isinstance(value, (*FIXED, Of, View)):
        return None
    if isinstance(value, types.FunctionType):
        return [value.__code__, *(parts(value) or ())]
    if isinstance(value, np.ndarray):
        return [value.shape, *value.ravel().tolist()]
    found = parts(value)
    kind = kind_of(type(value))
    if found is not None or kind is None:
        return None if found is None else [*found]
    content = kind.content(value)
    inside = [content] if kind.inside is nothing else [*kind.inside(content)]
    return [*inside, vars(value)] if type(value).__dictoffset__ else inside


def _equal(one: Any, other: Any) -> bool:
    try:
        return bool(one == other) or (one != one and other != other)
    except Exception:  # noqa: BLE001 -- comparing runs code of the object
        return False
