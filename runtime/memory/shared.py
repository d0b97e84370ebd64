"""What several runs see of an own block: attributes of its class, globals, the block itself.

In: a class or a function. Out: the places where its code finds what may change::

    class Counts(Block):
        total = [0]                     the list, and which object the class attribute is

        def update(self, state, t, x):
            global LAST
            LAST = x                    which object the global is
            LOG.append(x)               the list

A list or an object that no code of the block's own names is not found, nor are the globals of
Python's and the project's own modules and of installed packages that are not the block's.
"""

from __future__ import annotations

import dis
import functools
import sys
import types
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from runtime.memory.record import FIXED, KINDS

ROOTS = frozenset(("blocks", "runtime", "spikeblocks", "numpy", "scipy", "networkx", "yaml"))
DEPTH = 3  # of modules in modules
INSTALLED = ("site-packages", "dist-packages")


class Place(NamedTuple):
    """Where code finds an object: the entry of a module's or a class's namespace.

    label : for messages, such as "the global 'LOG'".
    """

    owner: Any
    name: str
    label: str

    @property
    def value(self) -> Any:
        """What is there now; :data:`MISSING` if nothing is."""
        there = vars(self.owner) if isinstance(self.owner, type) else self.owner
        return there.get(self.name, MISSING)

    def put(self, value: Any) -> None:
        """Put an object back."""
        if self.value is value:
            return
        if isinstance(self.owner, type):
            if value is MISSING:
                delattr(self.owner, self.name)
            else:
                setattr(self.owner, self.name, value)
        elif value is MISSING:
            del self.owner[self.name]
        else:
            self.owner[self.name] = value


MISSING = object()


class SharedPlaces:
    """The places that classes and functions of own blocks refer to; found once for each.

    Parameters
    ----------
    packages : those of the blocks' classes, which are looked into where they are installed.
    """

    def __init__(self, packages: frozenset[str]) -> None:
        self.packages = packages
        self._known: dict[Any, tuple[Place, ...]] = {}

    def of(self, found: Any) -> tuple[Place, ...]:
        """The places of a class or a function, those that it leads to included."""
        if found not in self._known:
            self._known[found] = ()  # one that leads back to itself
            code = self._of_class if isinstance(found, type) else self._of_function
            self._known[found] = tuple(code(found)) if self.is_own(found.__module__) else ()
        return self._known[found]

    def is_own(self, module: str | None) -> bool:
        """Whether a module is the user's."""
        return _is_own(module or "", self.packages)

    def _of_class(self, cls: type) -> Iterator[Place]:
        for each in cls.__mro__:
            if not self.is_own(each.__module__):
                continue
            for name, value in list(vars(each).items()):
                function = _function(value)
                if function is not None:
                    yield from self.of(function)
                elif not name.startswith("__") and (_may_change(value) or _is_number(value)):
                    yield Place(each, name, f"the class attribute '{each.__name__}.{name}'")

    def _of_function(self, function: types.FunctionType) -> Iterator[Place]:
        if function.__closure__ or function.__defaults__ or function.__kwdefaults__:
            label = f"a default or the closure of '{function.__qualname__}'"
            yield Place({"": function}, "", label)
        names, stored = _names(function.__code__)
        yield from self._of_scope(function.__globals__, names, stored, "", 0)

    def _of_scope(
        self, scope: dict[str, Any], names: set[str], stored: set[str], prefix: str, depth: int
    ) -> Iterator[Place]:
        """The places of a module's names, and of those of modules that it imports."""
        for name in sorted(names & scope.keys()):
            value = scope.get(name, MISSING)
            if isinstance(value, types.ModuleType):
                if self.is_own(value.__name__) and depth < DEPTH:
                    label = f"{prefix}{name}."
                    yield from self._of_scope(vars(value), names, stored, label, depth + 1)
            elif name in stored or (value is not MISSING and _may_change(value)):
                yield Place(scope, name, f"the global '{prefix}{name}'")
            elif isinstance(value, (type, types.FunctionType)):
                yield from self.of(value)


@functools.cache
def _is_own(module: str, packages: frozenset[str]) -> bool:
    root = module.partition(".")[0]
    if root in packages:
        return True
    if root in ROOTS or root in sys.stdlib_module_names or not root:
        return False
    file = getattr(sys.modules.get(module), "__file__", None) or ""
    return not any(part in file for part in INSTALLED)


def _function(value: Any) -> types.FunctionType | None:
    """The function behind an attribute of a class."""
    if isinstance(value, property):
        value = value.fget
    value = getattr(value, "__func__", getattr(value, "func", value))
    return value if isinstance(value, types.FunctionType) else None


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, str, np.generic, tuple))


def _may_change(value: Any) -> bool:
    """Whether an object is one that code may change: no declaration of a block, no function."""
    if isinstance(value, (*FIXED, types.FunctionType, types.BuiltinFunctionType)):
        return False
    if isinstance(value, (*KINDS, np.ndarray)):
        return True
    return type(value).__module__.partition(".")[0] != "blocks"


@functools.cache
def _names(code: types.CodeType) -> tuple[set[str], set[str]]:
    """The names that code reads, with those of the functions in it; and those it assigns to.

    Of the latter, attributes may be of a module.
    """
    names, stored = set(code.co_names), set()
    for step in dis.get_instructions(code):
        if step.opname in ("STORE_GLOBAL", "DELETE_GLOBAL", "STORE_ATTR"):
            stored.add(step.argval)
    for inner in code.co_consts:
        if isinstance(inner, types.CodeType):
            more, assigned = _names(inner)
            names, stored = names | more, stored | assigned
    return names, stored
