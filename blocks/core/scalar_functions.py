"""The functions that expressions may call: each takes floats and returns a float.

Those that ``math`` lacks, or that return integers there, are written out here, without branches on
types, so that both engines compute the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

# From here on all floats are integers.
INTEGERS = 2.0**52


def floor(x: float) -> float:
    """The largest integer that is not above x, as a float of any size."""
    return x if math.fabs(x) >= INTEGERS else float(math.floor(x))


def ceil(x: float) -> float:
    """The smallest integer that is not below x."""
    return -floor(-x)


def nearest(x: float) -> float:
    """The nearest integer; of two, the even one."""
    low = floor(x)
    part = x - low
    if part > 0.5 or (part == 0.5 and low % 2.0 != 0.0):
        return low + 1.0
    return low


def modulo(x: float, y: float) -> float:
    """The remainder of x / y with the sign of y, as Python's ``%``."""
    return x % y


def sign(x: float) -> float:
    """-1, 0 or 1."""
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)


def lesser(x: float, y: float) -> float:
    """The smaller of two numbers."""
    return y if y < x else x


def greater(x: float, y: float) -> float:
    """The larger of two numbers."""
    return y if y > x else x


def clip(x: float, low: float, high: float) -> float:
    """x, limited to the interval from low to high."""
    return low if x < low else (high if x > high else x)


def wrap(x: float) -> float:
    """An angle (rad), wrapped to (-pi, pi]."""
    angle = math.remainder(x, math.tau)
    return math.pi if angle == -math.pi else angle


def square(x: float) -> float:
    """The square of x."""
    return x * x


def cube(x: float) -> float:
    """The third power of x."""
    return x * x * x


def exponential(x: float) -> float:
    """The exponential function; infinity where it exceeds all floats."""
    return math.inf if x > 709.782712893384 else math.exp(x)


_OF_ONE = "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh expm1 log log1p log10 log2"
_OF_ONE += " sqrt erf erfc gamma lgamma degrees radians"
# Name in an expression: what is called, and the number of arguments; None for two or more.
FUNCTIONS: Mapping[str, tuple[str, int | None]] = {
    **{name: (f"math.{name}", 1) for name in _OF_ONE.split()},
    **{name: (f"math.{name}", 2) for name in ("atan2", "hypot", "copysign", "pow")},
    **{"abs": ("math.fabs", 1), "exp": ("exponential", 1), "mod": ("modulo", 2)},
    **{"floor": ("floor", 1), "ceil": ("ceil", 1), "round": ("nearest", 1)},
    **{"sign": ("sign", 1), "clip": ("clip", 3), "wrap": ("wrap", 1)},
    **{"min": ("lesser", None), "max": ("greater", None)},
}
CONSTANTS = {"pi": math.pi, "e": math.e, "tau": math.tau}
# Functions of all components of a vector.
VECTORS = ("sum", "mean", "norm", "min", "max")
ALIASES = {
    **{"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2", "ln": "log"},
    **{
        "fabs": "abs",
        "fmod": "mod",
        "power": "pow",
        "where": "a if condition else b",
        "sgn": "sign",
    },
    **{"sqr": "x**2", "sat": "clip", "saturate": "clip", "rad": "radians", "deg": "degrees"},
}
_HELPERS: tuple[Callable[..., float], ...] = (
    *(floor, ceil, nearest, modulo, sign, lesser, greater, clip, wrap),
    *(square, cube, exponential),
)
# Names that mean something in every expression.
RESERVED = frozenset([*CONSTANTS, *FUNCTIONS, *VECTORS])
SCOPE: Mapping[str, Any] = {
    "math": math,
    "np": np,
    **{helper.__name__: helper for helper in _HELPERS},
}
