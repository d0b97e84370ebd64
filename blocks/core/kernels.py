"""Kernels: a method's arithmetic written as loops, for the compiled engine.

Array expressions of one shape compile to loops as they are. A method that is fast in Python by
means which are not compiled, or which loops do better, has a kernel declared beside it::

    def update(self, state, t, error):
        np.multiply(state.activity, self.gamma * error, out=state.step)
        state.weights -= state.step

    @kernel_of(update)
    def _update_kernel(self, state, t, error):
        for i in range(len(state.weights)):
            state.weights[i] -= self.gamma * error * state.activity[i]

The kernel replaces exactly that function object. A class that overrides ``update`` has another
function, without a kernel. A class that overrides something that only one of the two depends on
(a helper that the kernel writes out, or the ``start`` that prepares a table for it) loses the
kernel as well: :func:`kernel_for` decides. A kernel of a module-level function is declared in the
same module in the same way.
"""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property
from typing import Any, TypeVar

Kernel = TypeVar("Kernel", bound=Callable[..., object])
MARK = "__kernel_of__"


def kernel_of(method: Callable[..., object]) -> Callable[[Kernel], Kernel]:
    """Declare a function as the kernel of ``method``, the function object itself.

    Raises
    ------
    TypeError : the parameters of the two differ.
    """

    def bound(kernel: Kernel) -> Kernel:
        # When the class is defined, not when it is compiled: most runs are not.
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
    cls: type, method: types.FunctionType, attributes: Collection[str] = ()
) -> types.FunctionType | None:
    """The kernel that replaces a method in a class; None if none is valid there.

    A kernel is valid where everything that only one of the two, method and kernel, depends on is
    unchanged since the class that declares the kernel. What both depend on may be overridden.

    Parameters
    ----------
    cls, method : the block's class, and its method.
    kept : names of the attributes of the block's started state. If only one of the two depends on
        one of them, then ``start`` and everything that it depends on counts as well.
    """
    for owner in cls.__mro__:
        # By the function object: an override is another object, and has no kernel.
        kernel = _declared(vars(owner), method)
        if kernel is not None:
            return kernel if not _differences(cls, owner, method, kernel, attributes) else None
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
    attributes: Collection[str],
) -> set[str]:
    """Names that only one of the two depends on and that ``cls`` redefines."""
    # By names in the code, methods followed: more than is really used, so that a kernel is dropped
    # once too often rather than once too seldom.
    alone = _relied_on(owner, method) ^ _relied_on(owner, kernel)
    if not alone.isdisjoint(attributes):
        alone |= {"start"} | _relied_on(owner, *_defined(owner, "start"))
    return {
        name
        for name in alone
        if inspect.getattr_static(cls, name, None) is not inspect.getattr_static(owner, name, None)
    }


def _relied_on(owner: type, *functions: Any) -> set[str]:
    """All attributes that functions and, recursively, the methods among them name."""
    names: set[str] = set()
    waiting = list(functions)
    while waiting:
        for name in _names(waiting.pop()) - names:
            names.add(name)
            waiting += _defined(owner, name)
    return names


def _defined(owner: type, name: str) -> list[Any]:
    """All definitions of a name in a class and its bases, which ``super`` may reach."""
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
