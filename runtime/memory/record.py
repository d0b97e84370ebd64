"""What own blocks keep undeclared: everything that can change, with its content.

In: places that refer to objects, such as the attributes of a state. Out: a :class:`Record`, which
puts all content back into the very objects that had it, so that whatever refers to them still does:
views of a state in a list, closures, bound methods, objects that share an array::

    state.legs = [state.h[:2], state.h[2:]]     the list has the same two views again
    state.add = add                             the cells of the closure have their values again

What other runs see, too, as attributes of a class and globals that a method uses, is recorded as
well (:mod:`.shared_memory`). What has a position that nobody can read, as a generator or an open
file, is refused with a sentence.
"""

from __future__ import annotations

import array
import copy
import enum
import functools
import random
import sys
import types
import weakref
from collections import OrderedDict, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.errors import NotCopiedError

Array = np.ndarray[Any, Any]
Found = tuple[Any, "Kind", Any]
# What cannot change, or is not memory of a run.
FIXED: tuple[type, ...] = (int, float, complex, str, bytes, type(None), np.generic, np.dtype, type)
FIXED += (types.ModuleType, types.CodeType, range, slice, enum.Enum, np.random.SeedSequence)
FIXED += (type(...), type(NotImplemented), np.ufunc, weakref.ref, property, staticmethod)
FIXED += (classmethod, functools.cached_property)
BOUND = (types.BuiltinMethodType, types.MethodWrapperType)
EMPTY = object()  # in the place of the content of a cell that has none
POSITION = "nobody can read where it is"


def nothing(content: Any) -> tuple[()]:
    return ()


def _same(content: Any, change: Callable[[Any], Any]) -> Any:
    return content


@dataclass(frozen=True, eq=False)
class Kind:
    """How objects of one kind are taken apart.

    content : what an object has, of which ``inside`` are the objects that it refers to.
    put : puts a content back in place. made : a new object of the type, without content.
    mapped : a content with other objects inside.
    """

    content: Callable[[Any], Any]
    put: Callable[[Any, Any], None]
    inside: Callable[[Any], Iterable[Any]] = nothing
    mapped: Callable[[Any, Callable[[Any], Any]], Any] = _same
    made: Callable[[Any], Any] = lambda value: object.__new__(type(value))


def _list_mapped(content: list[Any], change: Callable[[Any], Any]) -> list[Any]:
    return [change(each) for each in content]


def _put_dict(value: dict[Any, Any], content: list[tuple[Any, Any]]) -> None:
    there = list(value.items())
    if len(there) == len(content):
        pairs = zip(there, content, strict=True)
        if all(a is c and b is d for (a, b), (c, d) in pairs):
            return
    value.clear()
    value.update(content)


def _pairs(content: list[tuple[Any, Any]]) -> Iterator[Any]:
    for key, item in content:
        yield key
        yield item


def _pairs_mapped(content: list[tuple[Any, Any]], change: Callable[[Any], Any]) -> list[Any]:
    return [(change(key), change(item)) for key, item in content]


def _put_list(value: list[Any], content: list[Any]) -> None:
    list.__setitem__(value, slice(None), content)


def _put_all(value: Any, content: Any) -> None:
    value.clear()
    (value.extend if isinstance(value, deque) else value.update)(content)


def _put_bytes(value: Any, content: Any) -> None:
    value[:] = content


def _put_cell(value: types.CellType, content: tuple[Any]) -> None:
    if content[0] is EMPTY:
        del value.cell_contents
    else:
        value.cell_contents = content[0]


def _cell(value: types.CellType) -> tuple[Any]:
    try:
        return (value.cell_contents,)
    except ValueError:
        return (EMPTY,)


def _new(cls: type) -> Callable[[Any], Any]:
    new: Any = cls.__new__
    return lambda value: new(type(value))


DICT = Kind(lambda v: list(v.items()), _put_dict, _pairs, _pairs_mapped, _new(dict))
SET = Kind(list, _put_all, list, _list_mapped, _new(set))
KINDS: dict[type, Kind] = {
    list: Kind(list, _put_list, list, _list_mapped, _new(list)),
    OrderedDict: replace(DICT, made=_new(OrderedDict)),
    defaultdict: replace(DICT, made=lambda value: type(value)(value.default_factory)),
    dict: DICT,
    deque: replace(SET, made=lambda value: type(value)(maxlen=value.maxlen)),
    set: SET,
    bytearray: Kind(bytes, _put_bytes, made=_new(bytearray)),
    array.array: Kind(copy.copy, _put_bytes, made=lambda v: array.array(v.typecode)),
    types.CellType: Kind(
        content=_cell,
        put=_put_cell,
        inside=tuple,
        mapped=lambda content, change: (change(content[0]),),
        made=lambda value: types.CellType(),
    ),
    np.random.Generator: Kind(
        lambda value: value.bit_generator.state,
        lambda value, content: setattr(value.bit_generator, "state", content),
        made=lambda value: type(value)(type(value.bit_generator)()),
    ),
    np.random.BitGenerator: Kind(
        lambda value: value.state,
        lambda value, content: setattr(value, "state", content),
        made=lambda value: type(value)(),
    ),
    np.random.RandomState: Kind(
        lambda value: value.get_state(legacy=False),
        lambda value, content: value.set_state(content),
        made=lambda value: type(value)(),
    ),
    random.Random: Kind(
        lambda value: value.getstate(),
        lambda value, content: value.setstate(content),
        made=_new(random.Random),
    ),
}


# Objects whose attributes are all in their dictionary, which is recorded as such.
PLAIN = Kind(lambda value: (), lambda value, content: None)


LISTED = tuple(KINDS)


def is_library(cls: type) -> bool:
    """Whether a class is of Python's own library, as that of a logger is."""
    return cls.__module__.partition(".")[0] in sys.stdlib_module_names


def copies_itself(value: Any) -> bool:
    """Whether an object says itself how it is copied."""
    cls: Any = type(value)
    own = cls.__reduce__ is not object.__reduce__ or cls.__reduce_ex__ is not object.__reduce_ex__
    return (own or hasattr(cls, "__deepcopy__")) and not isinstance(value, LISTED)


def is_one(value: Any) -> bool:
    """Whether an object says that its copy is itself, as a logger does."""
    if not copies_itself(value):
        return False
    try:
        return copy.deepcopy(value) is value
    except Exception:  # noqa: BLE001 -- copying runs code of the object
        return False


def _slots(cls: type) -> list[str]:
    """The names of the slots of a class and its bases, as its attributes have them."""
    found = []
    for each in cls.__mro__:
        slots = vars(each).get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name not in ("__dict__", "__weakref__"):
                hidden = name.startswith("__") and not name.endswith("__")
                found.append(f"_{each.__name__.lstrip('_')}{name}" if hidden else name)
    return found


def _is_plain(cls: type) -> bool:
    """Whether objects of a class have only attributes: nothing that only C code knows."""
    extra = 8 * (len(_slots(cls)) + (cls.__dictoffset__ > 0) + (cls.__weakrefoffset__ > 0))
    return cls.__basicsize__ <= object.__basicsize__ + extra and not cls.__itemsize__


def kind_of(cls: Any) -> Kind | None:
    """The kind of the objects of a class; None if it is neither listed nor plain."""
    if cls not in _kinds:
        _kinds[cls] = _kind_of(cls)
    return _kinds[cls]


_kinds: dict[Any, Kind | None] = {}


def _kind_of(cls: Any) -> Kind | None:
    listed = next((KINDS[each] for each in cls.__mro__ if each in KINDS), None)
    if listed is None and not _is_plain(cls):
        return None
    slots = _slots(cls)
    first = listed or PLAIN
    if not slots:
        return first

    def content(value: Any) -> Any:
        return first.content(value), [getattr(value, name, EMPTY) for name in slots]

    def put(value: Any, content: Any) -> None:
        first.put(value, content[0])
        for name, item in zip(slots, content[1], strict=True):
            if item is not EMPTY:
                object.__setattr__(value, name, item)
            elif hasattr(value, name):
                object.__delattr__(value, name)

    def inside(content: Any) -> Iterator[Any]:
        yield from first.inside(content[0])
        yield from content[1]

    def mapped(content: Any, change: Callable[[Any], Any]) -> Any:
        return first.mapped(content[0], change), [change(each) for each in content[1]]

    return Kind(content, put, inside, mapped, first.made)


def parts(value: Any) -> tuple[Any, ...] | None:
    """The objects that one refers to that itself cannot change; None if it is none of these."""
    if isinstance(value, (tuple, frozenset)):
        return tuple(value)
    if isinstance(value, types.FunctionType):
        return (*(value.__closure__ or ()), value.__defaults__, value.__kwdefaults__, vars(value))
    if isinstance(value, types.MethodType):
        return value.__self__, value.__func__
    if isinstance(value, BOUND):
        return (value.__self__,)
    if isinstance(value, functools.partial):
        return value.func, value.args, value.keywords
    if isinstance(value, types.MappingProxyType):
        return tuple(value.values())
    return None


def owner_of(value: Array) -> Array:
    """The array that has the memory of a view."""
    while isinstance(value.base, np.ndarray):
        value = value.base
    return value


def refused(value: Any) -> str:
    """Why an object cannot be copied; '' if that may be possible."""
    if hasattr(type(value), "__next__") or isinstance(value, types.CoroutineType):
        return POSITION
    return ""


class Record:
    """The content of everything that can be reached from some places, as it is now.

    Parameters
    ----------
    outer : by identity, the objects of the run itself, which are put back by others.
    memory : the array whose views are put back by others.
    """

    def __init__(self, outer: Mapping[int, Any], memory: Array) -> None:
        self.outer, self.memory = outer, memory
        self.found: dict[int, Found] = {}
        self.arrays: dict[int, tuple[Array, Array]] = {}
        self.known: dict[int, Any] = {}  # which also keeps them alive
        self.foreign: dict[int, Any] = {}  # objects that only their own code can copy
        # Classes and functions that were met: what they share is added by whoever asks for it.
        self.entered: list[Any] = []

    def add(self, value: Any, place: str, shared: bool = False) -> list[int]:
        """Record what one place refers to; returns the identities of what was new.

        Parameters
        ----------
        place : for the error.
        shared : whether other runs see it, too; what nobody can copy is then left out.

        Raises
        ------
        NotCopiedError : something cannot be copied.
        """
        waiting, known, new = [value], self.known, []
        while waiting:
            value = waiting.pop()
            key = id(value)
            if key in known or isinstance(value, FIXED) or key in self.outer or value is EMPTY:
                continue
            known[key] = value
            new.append(key)
            if isinstance(value, np.ndarray):
                self._array(value, waiting)
                continue
            inner = parts(value)
            if inner is not None:
                waiting += inner
                if isinstance(value, types.FunctionType):
                    self.entered.append(value)
            else:
                waiting += self._content(value, place, shared)
        return new

    def _content(self, value: Any, place: str, shared: bool) -> Iterable[Any]:
        """Record the content of one object; returns what it refers to."""
        cls = type(value)
        kind = kind_of(cls)
        if kind is None:
            why = refused(value) or ("" if shared else self._copy(value))
            if why:
                text = f"keeps in {place} what cannot be copied ({cls.__name__}: {why})"
                raise NotCopiedError(text)
            return ()
        if not isinstance(value, LISTED) and ((shared and is_library(cls)) or is_one(value)):
            return ()
        content = kind.content(value)
        if kind is not PLAIN:
            self.found[id(value)] = value, kind, content
        self.entered.append(cls)
        inside = [*kind.inside(content)]
        if cls.__dictoffset__:
            inside.append(vars(value))
        return inside

    def _copy(self, value: Any) -> str:
        """Let an object copy itself; returns why that is not possible, or ''."""
        try:
            made = copy.deepcopy(value, dict(self.outer))
        except Exception as error:  # noqa: BLE001 -- copying runs code of the object
            return str(error) or type(error).__name__
        if made is not value:
            self.foreign[id(value)] = made
        return ""

    def _array(self, value: Array, waiting: list[Any]) -> None:
        owner = owner_of(value)
        if type(value) is not np.ndarray and type(value).__dictoffset__:
            waiting.append(vars(value))
        if owner is self.memory or id(owner) in self.arrays:
            return
        if owner.dtype.hasobject:
            waiting += owner.ravel().tolist()
        if owner.flags.writeable:
            self.arrays[id(owner)] = owner, owner.copy(order="K")
            self.known[id(owner)] = owner
        elif value.flags.writeable:  # the owner became read-only later
            self.arrays[id(value)] = value, value.copy(order="K")

    def restore(self) -> None:
        """Put all contents back; a record may be restored again."""
        # Copied again, for the next time.
        anew = {key: copy.deepcopy(made, dict(self.outer)) for key, made in self.foreign.items()}

        def change(value: Any) -> Any:
            return anew.get(id(value), value)

        for value, kind, content in self.found.values():
            kind.put(value, kind.mapped(content, change) if anew else content)
        for owner, numbers in self.arrays.values():
            # One that a block has returned since is read-only now: mostly it is as it was.
            if not owner.flags.writeable:
                if owner.tobytes() == numbers.tobytes():
                    continue
                owner.setflags(write=True)
            owner[...] = numbers

    def copy_of(self, value: Array) -> Array | None:
        """An array as it was; None if it is not recorded, as views of the run's memory."""
        there = self.arrays.get(id(owner_of(value)))
        return None if there is None else view_like(value, *there)

    def has_changed(self, key: int) -> bool:
        """Whether an object, by identity, has another content now."""
        if key in self.arrays:
            owner, numbers = self.arrays[key]
            return owner.tobytes() != numbers.tobytes()
        if key in self.found:
            value, kind, content = self.found[key]
            return not same_content(kind.content(value), content)
        return False


def same_content(one: Any, other: Any) -> bool:
    """Whether two contents are the same numbers and texts, and the same other objects."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(same_content, one, other))
    if isinstance(one, np.ndarray):
        return bool(one.tobytes() == other.tobytes())
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same_content(one[k], other[k]) for k in one)
    is_value = isinstance(one, (int, float, complex, str, bytes, np.generic, array.array))
    return is_value and bool(one == other or (one != one and other != other))


def view_like(value: Array, owner: Array, memory: Array) -> Array:
    """A view of another memory that lies in it as a view lies in its owner's.

    Parameters
    ----------
    memory : as long as the owner, with the same order of axes in memory.
    """
    if not value.size or owner.dtype.hasobject:
        return value.copy()
    first, begin = (each.__array_interface__["data"][0] for each in (owner, value))
    flat = memory.ravel(order="K").view(np.uint8)
    made = np.ndarray(value.shape, value.dtype, flat, begin - first, value.strides)
    made.flags.writeable = value.flags.writeable
    return made
