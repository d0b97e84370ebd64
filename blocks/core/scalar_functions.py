"""The functions that expressions may call: each takes floats and returns a float.

Those that ``math`` lacks, or that return integers there, are written out here, without branches on
types, so that both engines compute the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from keyword import iskeyword
from typing import Any

import numpy as np

from blocks.core.matrices import determinant, small_product, solution

# From here on all floats are integers.
INTEGERS = 2.0**52
# The largest arguments at which exp, sinh, gamma and lgamma are finite.
LARGEST_EXPONENT = 709.782712893384
LARGEST_HYPERBOLIC = 710.4758600739439
LARGEST_GAMMA, LARGEST_LGAMMA = 171.62437695630271, 2.5563481638716906e305


def floor(x: float) -> float:
    """The largest integer that is not above x, as a float of any size."""
    return float(math.floor(x)) if math.fabs(x) < INTEGERS else x


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
    if not math.isfinite(x):
        return math.nan
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
    return math.inf if x > LARGEST_EXPONENT else math.exp(x)


# Functions of ``math`` raise an exception outside of their domain, those of C return NaN or
# infinity. The ones below do what C does, so that both engines agree.


def real_sqrt(x: float) -> float:
    """The square root; NaN of a negative number."""
    return math.sqrt(x) if x >= 0.0 else math.nan


def real_log(x: float) -> float:
    """The natural logarithm; minus infinity of 0, NaN of a negative number."""
    if x > 0.0:
        return math.log(x)
    return -math.inf if x == 0.0 else math.nan


def real_log2(x: float) -> float:
    """The logarithm to base 2, as :func:`real_log`."""
    if x > 0.0:
        return math.log2(x)
    return -math.inf if x == 0.0 else math.nan


def real_log10(x: float) -> float:
    """The logarithm to base 10, as :func:`real_log`."""
    if x > 0.0:
        return math.log10(x)
    return -math.inf if x == 0.0 else math.nan


def real_log1p(x: float) -> float:
    """The logarithm of 1 + x, as :func:`real_log`."""
    if x > -1.0:
        return math.log1p(x)
    return -math.inf if x == -1.0 else math.nan


def real_asin(x: float) -> float:
    """The inverse sine; NaN outside of [-1, 1]."""
    return math.asin(x) if -1.0 <= x <= 1.0 else math.nan


def real_acos(x: float) -> float:
    """The inverse cosine; NaN outside of [-1, 1]."""
    return math.acos(x) if -1.0 <= x <= 1.0 else math.nan


def real_acosh(x: float) -> float:
    """The inverse hyperbolic cosine; NaN below 1."""
    return math.acosh(x) if x >= 1.0 else math.nan


def real_atanh(x: float) -> float:
    """The inverse hyperbolic tangent; infinity of 1 and -1, NaN beyond."""
    if -1.0 < x < 1.0:
        return math.atanh(x)
    return math.copysign(math.inf, x) if x == 1.0 or x == -1.0 else math.nan


def real_sin(x: float) -> float:
    """The sine; NaN of infinity."""
    return math.sin(x) if math.isfinite(x) else math.nan


def real_cos(x: float) -> float:
    """The cosine; NaN of infinity."""
    return math.cos(x) if math.isfinite(x) else math.nan


def real_tan(x: float) -> float:
    """The tangent; NaN of infinity."""
    return math.tan(x) if math.isfinite(x) else math.nan


def real_sinh(x: float) -> float:
    """The hyperbolic sine; infinity where it exceeds all floats."""
    return math.sinh(x) if math.fabs(x) <= LARGEST_HYPERBOLIC else x * math.inf


def real_cosh(x: float) -> float:
    """The hyperbolic cosine; infinity where it exceeds all floats."""
    return math.cosh(x) if math.fabs(x) <= LARGEST_HYPERBOLIC else x * x * math.inf


def real_expm1(x: float) -> float:
    """exp(x) - 1; infinity where it exceeds all floats."""
    return math.inf if x > LARGEST_EXPONENT else math.expm1(x)


def real_gamma(x: float) -> float:
    """The gamma function; NaN at its poles, infinity where it exceeds all floats."""
    if x > LARGEST_GAMMA:
        return math.inf
    if x <= 0.0 and not (math.isfinite(x) and x != floor(x)):
        return math.nan
    return math.gamma(x)


def real_lgamma(x: float) -> float:
    """The logarithm of the gamma function; infinity at its poles."""
    if x > LARGEST_LGAMMA or (x <= 0.0 and not (math.isfinite(x) and x != floor(x))):
        return math.inf
    return math.lgamma(x)


def real_pow(x: float, y: float) -> float:
    """x to the power of y; NaN of a negative x with a fraction, infinity beyond all floats."""
    if x < 0.0 and y != floor(y):
        return math.nan
    if x == 0.0 and y < 0.0:
        return math.inf
    if x != 0.0 and y * math.log(math.fabs(x)) > LARGEST_EXPONENT:
        odd = x < 0.0 and modulo(y, 2.0) == 1.0
        return -math.inf if odd else math.inf
    return math.pow(x, y)


_GUARDED = (
    "sqrt log log2 log10 log1p asin acos acosh atanh sin cos tan sinh cosh expm1 gamma lgamma"
)
_OF_ONE = "atan  tanh asinh erf erfc degrees radians"
# Name in an expression: what is called, and the number of arguments; None for two or more.
FUNCTIONS: Mapping[str, tuple[str, int | None]] = {
    **{name: (f"math.{name}", 1) for name in _OF_ONE.split()},
    **{name: (f"real_{name}", 1) for name in _GUARDED.split()},
    **{name: (f"math.{name}", 2) for name in ("atan2", "hypot", "copysign")},
    "pow": ("real_pow", 2),
    **{"abs": ("math.fabs", 1), "exp": ("exponential", 1), "mod": ("modulo", 2)},
    **{"floor": ("floor", 1), "ceil": ("ceil", 1), "round": ("nearest", 1)},
    **{"sign": ("sign", 1), "clip": ("clip", 3), "wrap": ("wrap", 1)},
    **{"min": ("lesser", None), "max": ("greater", None)},
}
CONSTANTS = {"pi": math.pi, "e": math.e, "tau": math.tau}
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
    *(square, cube, exponential, real_sqrt, real_log, real_log2, real_log10, real_log1p, real_asin),
    *(real_acos, real_acosh, real_atanh, real_sin, real_cos, real_tan, real_sinh, real_cosh),
    *(real_expm1, real_gamma, real_lgamma, real_pow),
)
SCOPE: Mapping[str, Any] = {
    "math": math,
    "np": np,
    **{helper.__name__: helper for helper in (*_HELPERS, determinant, small_product, solution)},
}


def misnamed(
    names: Iterable[str], variables: Mapping[str, str], others: Iterable[str] = ()
) -> Iterator[tuple[str, str]]:
    """Names that a block cannot add to its expressions, each with the reason.

    Parameters
    ----------
    variables : names that its expressions have, with what they are: {"u": "the inputs"}.
    others : names that were added before.
    """
    seen = set(others)
    meanings = {name: f"the number {value:.4g}" for name, value in CONSTANTS.items()}
    meanings |= dict.fromkeys([*FUNCTIONS, "sum", "mean", "norm"], "a function")
    meanings |= {"t": "the time", **variables}
    for name in names:
        if not (name.isidentifier() and name.isascii()) or iskeyword(name):
            yield name, f"'{name}' is not a valid name; use letters, digits and _"
        elif name in meanings:
            yield name, f"'{name}' is {meanings[name]} in every expression; choose another name"
        elif name in seen:
            yield name, f"the name '{name}' is given twice"
        seen.add(name)
