"""Kernels: the same arithmetic as a method's, written as loops for the compiled engine.

Array expressions run well in Python, and compile slowly or run slowly once compiled. Such a method
has a kernel declared beside it::

    def update(self, state, t, command):
        state.reached -= state.share * (state.reached - command)

    @kernel_of(update)
    def _update_kernel(self, state, t, command):
        for i in range(2):
            state.reached[i] -= state.share * (state.reached[i] - command[i])

The kernel stands for that very function object. A class that overrides ``update`` has another
function there, and no kernel. A class that overrides something that only one of the two relies on
(a helper that the kernel spells out, or the ``start`` that prepares a table for it) loses the
kernel, too: :func:`kernel_for` decides. A kernel of a module's function is declared in the module
of that function in the same way.
"""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])
MARK = "__kernel_of__"


def kernel_of(method: Callable[..., Any]) -> Callable[[Function], Function]:
    """Declare a function as the kernel of ``method``, the function object itself.

    Raises
    ------
    TypeError : the parameters of the two differ.
    """

    def bound(kernel: Function) -> Function:
        wanted, got = (list(inspect.signature(f).parameters) for f in (method, kernel))
        if wanted != got:
            raise TypeError(
                f"{kernel.__qualname__} is declared as the kernel of {method.__qualname__} and "
                f"must take the same parameters ({', '.join(wanted)}), not ({', '.join(got)})"
            )
        setattr(kernel, MARK, method)
        return kernel

    return bound


def function_kernel(function: types.FunctionType) -> types.FunctionType | None:
    """The kernel of a function of a module, which is declared in the same module."""
    return _declared(function.__globals__, function)


def has_kernels(cls: type) -> bool:
    """Whether a class, or one that it inherits from, declares any kernel."""
    return any(hasattr(value, MARK) for owner in cls.__mro__ for value in vars(owner).values())


def kernel_for(
    cls: type, method: types.FunctionType, kept: Collection[str] = ()
) -> types.FunctionType | None:
    """The kernel that stands for a method in a class; None if there is none that holds there.

    A kernel holds where all that only one of the two, method and kernel, relies on is still what
    it is in the class that declares the kernel. What both rely on may differ: they follow it alike.

    Parameters
    ----------
    cls : the block's class; ``method`` is what it has under the method's name.
    kept : names of the attributes that a started state of the block has. Where only one of the two
        relies on one of them, ``start`` with all that it relies on counts as well.
    """
    for owner in cls.__mro__:
        kernel = _declared(vars(owner), method)
        if kernel is not None:
            return kernel if not _differences(cls, owner, method, kernel, kept) else None
    return None


def _declared(
    namespace: Mapping[str, Any], function: types.FunctionType
) -> types.FunctionType | None:
    for value in list(namespace.values()):
        if isinstance(value, types.FunctionType) and getattr(value, MARK, None) is function:
            return value
    return None


def _differences(
    cls: type,
    owner: type,
    method: types.FunctionType,
    kernel: types.FunctionType,
    kept: Collection[str],
) -> set[str]:
    """Names of which ``cls`` makes something else than ``owner``, to one of the two alone."""
    alone = _relied_on(owner, method) ^ _relied_on(owner, kernel)
    if not alone.isdisjoint(kept):
        alone |= {"start"} | _relied_on(owner, *_defined(owner, "start"))
    return {
        name
        for name in alone
        if inspect.getattr_static(cls, name, None) is not inspect.getattr_static(owner, name, None)
    }


def _relied_on(owner: type, *functions: Any) -> set[str]:
    """All attributes that functions name, and the class's own methods among them in turn."""
    found: set[str] = set()
    waiting = list(functions)
    while waiting:
        for name in _names(waiting.pop()) - found:
            found.add(name)
            waiting += _defined(owner, name)
    return found


def _defined(owner: type, name: str) -> list[Any]:
    """What a class and those that it inherits from, which ``super`` may reach, define."""
    return [vars(base)[name] for base in owner.__mro__ if name in vars(base)]


def _names(value: Any) -> set[str]:
    """The names of globals and attributes in the code of a function, method or property."""
    if isinstance(value, (staticmethod, classmethod)):
        value = value.__func__
    elif isinstance(value, property):
        value = value.fget
    elif isinstance(value, cached_property):
        value = value.func
    if not isinstance(value, types.FunctionType):
        return set()
    return {name for code in _codes(value.__code__) for name in code.co_names}


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)
