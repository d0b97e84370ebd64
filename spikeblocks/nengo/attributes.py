"""Attributes of Nengo's objects: what is not read has its default, or is refused by name.

In: an object, and the names of what a caller has read of it. Out: nothing, or an error::

    only_reads(nengo.Alpha(0.01, method="euler"), "tau")    # UsageError: its method is not read
"""

from __future__ import annotations

import inspect
from typing import Any

import nengo
import numpy as np
from nengo.params import Parameter

from runtime.errors import UsageError

# Names of objects, and what a process takes where nobody says it; a network's objects all say it.
# The seeds of what is drawn once are in what was drawn.
IDLE = {"label", "seed", "default_dt", "default_size_in", "default_size_out"}


def parameters(kind: type) -> set[str]:
    """The names of a class's parameters, as Nengo declares them."""
    return {n for n in dir(kind) if isinstance(inspect.getattr_static(kind, n, None), Parameter)}


def default_of(kind: type, name: str) -> Any:
    """The default of a parameter: of the constructors, or of the class; ``inspect.Parameter.empty``
    if there is none.
    """
    for base in kind.__mro__:
        made = vars(base).get("__init__")
        found = inspect.signature(made).parameters.get(name) if made is not None else None
        if found is not None and found.default is not nengo.Default:
            return found.default
    declared = inspect.getattr_static(kind, name)
    return inspect.Parameter.empty if not declared.configurable else declared.default


def only_reads(thing: Any, *read: str) -> None:
    """Check that a caller that reads these parameters of an object leaves nothing out.

    Raises
    ------
    UsageError : another one differs from its default; the message names it.
    """
    for name in sorted(parameters(type(thing)) - IDLE - set(read)):
        value, default = getattr(thing, name), default_of(type(thing), name)
        if not same(value, default):
            text = f"{value!r}".replace("\n", " ")
            text = text if len(text) <= 60 else f"{text[:57]}..."
            raise UsageError(f"{thing!r}: its {name} is not read; expected {default!r}, got {text}")


def same(value: Any, other: Any) -> bool:
    """Whether two values of parameters are equal, arrays included."""
    if value is other:
        return True
    try:
        if isinstance(value, np.ndarray) or isinstance(other, np.ndarray):
            return bool(np.array_equal(value, other))
        return bool(value == other)
    except (TypeError, ValueError):
        return False


# What a subclass may define and still be simulated as its class is.
HARMLESS = {
    *("__init__", "__repr__", "__str__", "__module__", "__doc__", "__annotations__"),
    *("__static_attributes__", "__firstlineno__"),  # of Python 3.13
}


def is_exactly(thing: Any, *kinds: type) -> bool:
    """Whether an object is of one of these classes itself: a subclass may compute otherwise.

    One of a user's that only sets parameters in its ``__init__``, or adds names that the class does
    not have, is of the class.
    """
    added: set[str] = set()
    for cls in type(thing).__mro__:
        if cls in kinds:
            return not any(hasattr(cls, name) for name in added - HARMLESS)
        if f"{cls.__module__}.".startswith("nengo.") and ".tests." not in cls.__module__:
            return False
        added |= vars(cls).keys()
    return False


def number(value: float) -> str:
    """A number as text, with all of its digits."""
    return f"{float(value)!r}".removesuffix(".0")
