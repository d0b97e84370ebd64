"""Values of signals held against what was declared, for messages and for the first tick."""

from __future__ import annotations

from typing import Any

import numpy as np

from blocks.core import SignalType


def has_form(kind: SignalType, value: Any) -> bool:
    if kind.form == "scalar":
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind.form == "record":
        return (
            isinstance(value, tuple)
            and len(value) == len(kind.components)
            and all(isinstance(part, (int, float)) for part in value)
        )
    return isinstance(value, np.ndarray) and value.shape == kind.shape and value.dtype == np.float64


def sealed(value: Any) -> Any:
    """An array that a block put out as others may have it: memory of its own, and read-only.

    What a :class:`blocks.core.block.BlockState` keeps are views, so an array without a base is
    not one of them.

    Raises
    ------
    TypeError : it is no array.
    """
    try:
        if value.base is not None:
            value = value.copy()
        value.setflags(write=False)
    except AttributeError:
        raise TypeError(f"expected a float64 array as output, got {brief(value)}") from None
    return value


def is_bad(kind: SignalType, value: Any) -> bool:
    numbers = np.asarray(value)
    return bool(np.isnan(numbers).any() or (kind.finite and np.isinf(numbers).any()))


def form(kind: SignalType) -> str:
    if kind.form == "scalar":
        return "a float"
    if kind.form == "record":
        return f"a tuple of {len(kind.components)} floats ({', '.join(kind.components)})"
    return f"a float64 array of shape {kind.shape}"


def brief(value: Any) -> str:
    text = (
        f"an array of shape {value.shape}, {value.dtype}"
        if isinstance(value, np.ndarray)
        else repr(value)
    )
    return text if len(text) < 80 else text[:77] + "..."
