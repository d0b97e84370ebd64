"""Immutable records of values, to detect later changes bit by bit."""

from __future__ import annotations

import functools
import types
from collections import deque
from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np

_BY_IDENTITY = (
    type,
    types.ModuleType,
    types.FunctionType,
    types.BuiltinFunctionType,
    types.MethodType,
    functools.partial,
)


def snapshot(value: Any, seen: frozenset[int] = frozenset()) -> Hashable:
    """A record that is equal exactly when two values hold the same bits in the same structure.

    Arrays, numbers, containers and generators are recorded by content, other objects by their
    attributes; functions, classes and modules by identity. NaN equals NaN.
    """
    if id(value) in seen:
        return "a cycle"
    inside = seen | {id(value)}
    kind = type(value).__name__
    if isinstance(value, np.ndarray):
        return kind, value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, float):
        return kind, value.hex()
    if value is None or isinstance(value, (bool, int, complex, str, bytes)):
        return kind, value
    if isinstance(value, bytearray):
        return kind, bytes(value)
    if isinstance(value, np.generic):
        return kind, value.tobytes()
    if isinstance(value, _BY_IDENTITY):
        return kind, id(value)
    if isinstance(value, np.random.Generator):
        return kind, snapshot(value.bit_generator.state, inside)
    if isinstance(value, np.random.RandomState):
        return kind, snapshot(value.get_state(legacy=False), inside)
    if isinstance(value, np.random.SeedSequence):
        return kind, snapshot(value.state, inside)
    if isinstance(value, Mapping):
        return kind, tuple((repr(key), snapshot(item, inside)) for key, item in value.items())
    if isinstance(value, (list, tuple, deque)):
        return kind, tuple(snapshot(item, inside) for item in value)
    if isinstance(value, (set, frozenset)):
        return kind, tuple(sorted(repr(item) for item in value))
    if hasattr(value, "__dict__"):
        return kind, snapshot(vars(value), inside)
    return kind, repr(value)
