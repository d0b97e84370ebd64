"""Functions that compiled text calls and numba lacks; each matches the Python function it names."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic, overload

from blocks.generic import added, scaled

_remainder: Any = types.ExternalFunction("remainder", types.float64(types.float64, types.float64))


@njit  # type: ignore[untyped-decorator]
def remainder(x: float, y: float) -> float:
    """IEEE 754 remainder, :func:`math.remainder`, from the C library."""
    result: float = _remainder(x, y)
    return result


@njit  # type: ignore[untyped-decorator]
def all_finite(array: Any) -> bool:
    """Whether an array (any shape) holds only finite numbers."""
    for value in array.flat:  # noqa: SIM110 - a loop compiles faster
        if not math.isfinite(value):
            return False
    return True


@njit  # type: ignore[untyped-decorator]
def no_nan(array: Any) -> bool:
    """Whether an array (any shape) holds no NaN."""
    for value in array.flat:  # noqa: SIM110
        if np.isnan(value):
            return False
    return True


@njit  # type: ignore[untyped-decorator]
def overlap(a: Any, b: Any) -> bool:
    """Whether two contiguous arrays share memory."""
    first, second = np.int64(a.ctypes.data), np.int64(b.ctypes.data)
    return bool(first < second + b.nbytes and second < first + a.nbytes)


@intrinsic
def seen(typing_context, array):  # type: ignore[no-untyped-def]
    """A read-only view of an array, for a block that does not own it."""

    def code(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return impl_ret_borrowed(context, builder, signature.return_type, arguments[0])

    return array.copy(readonly=True)(array), code


def _each(n: int, text: str, arguments: str) -> Any:
    parts = ", ".join(text.format(i) for i in range(n))
    scope: dict[str, Any] = {}
    exec(f"def of({arguments}): return ({parts},)", scope)
    return scope["of"]


@overload(scaled)
def _scaled(value, factor):  # type: ignore[no-untyped-def]
    if isinstance(value, types.BaseTuple):
        return _each(len(value), "factor * value[{0}]", "value, factor")
    return lambda value, factor: factor * value


@overload(added)
def _added(a, b):  # type: ignore[no-untyped-def]
    if isinstance(a, types.BaseTuple):
        return _each(len(a), "a[{0}] + b[{0}]", "a, b")
    return lambda a, b: a + b
