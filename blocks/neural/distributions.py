"""Distributions of the numbers of a population, written as ``uniform(200, 400)`` and so on.

In: what a graph writes, a number, a list or a call such as ``uniform(200, 400)``, which is read by
a small grammar and never evaluated. Out: arrays drawn with a block's own generator::

    Distribution.read("uniform(200, 400)").draw(rng, 100)      # (100, 1)
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from blocks.core import (
    ARRAYS,
    CREATION,
    ExpressionError,
    FloatArray,
    Setting,
    SettingError,
    array_of,
    misspelt,
    plain,
    show,
)

Draw = Callable[[np.random.Generator, int, int, tuple[Any, ...]], FloatArray]
_CALL = re.compile(r"\s*([A-Za-z_]+)\s*(?:\((.*)\))?\s*", re.DOTALL | re.ASCII)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_TOKEN = re.compile(rf"\s*({_NUMBER.pattern}|[\[\],])", re.ASCII)
LONGEST = 100_000


@dataclass(frozen=True)
class _Kind:
    """A kind of distribution: how it is written, its arguments, and how it is drawn from."""

    form: str
    doc: str
    draw: Draw
    least: int
    most: int


def _uniform(rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]) -> FloatArray:
    return np.asarray(rng.uniform(arguments[0], arguments[1], (n, d)))


def _normal(rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]) -> FloatArray:
    return np.asarray(rng.normal(arguments[0], arguments[1], (n, d)))


def _exponential(
    rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]
) -> FloatArray:
    shift = arguments[1] if len(arguments) > 1 else 0.0
    high = arguments[2] if len(arguments) > 2 else math.inf
    # Cut at the last number below high: as for uniform, the bound itself is not drawn.
    drawn: FloatArray = shift + rng.exponential(arguments[0], (n, d))
    return np.asarray(np.minimum(drawn, np.nextafter(high, -math.inf)))


def _choice(rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]) -> FloatArray:
    options = np.array(arguments[0], dtype=float)
    options = options.reshape(len(options), -1)
    chosen: FloatArray = options[rng.integers(0, len(options), n)]
    return chosen


def _sphere(rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]) -> FloatArray:
    points = rng.standard_normal((n, d))
    return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))


def _ball(rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]) -> FloatArray:
    # The share of the volume within r is r^d; rejection would draw for ever in many dimensions.
    points = _sphere(rng, n, d, ())
    return np.asarray(points * rng.uniform(0.0, 1.0, (n, 1)) ** (1.0 / d))


def _cosine(rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]) -> FloatArray:
    """The cosine of the angle between two random directions in so many dimensions."""
    of = arguments[0]
    # The squared cosine of a random angle has this beta distribution (Muller, 1959: the square of
    # one component of a normal vector over the sum of all).
    square = rng.beta(0.5, 0.5 * (of - 1.0), (n, d))
    return np.asarray(np.sqrt(square) * rng.choice((-1.0, 1.0), (n, d)))


def _scattered(rng: np.random.Generator, n: int, d: int) -> FloatArray:
    """Points (n, d) of the unit cube that fill it more evenly than random ones, in random order."""
    # The additive recurrence whose steps are powers of 1 / phi, phi^(d+1) = phi + 1: the golden
    # ratio's for any number of dimensions (Roberts, 2018). A random shift keeps each point uniform.
    phi = 2.0
    for _ in range(60):
        phi = (1.0 + phi) ** (1.0 / (d + 1.0))
    steps = np.array([phi ** -(j + 1.0) for j in range(d)])
    points: FloatArray = (rng.random(d) + np.arange(n)[:, None] * steps) % 1.0
    return np.asarray(rng.permutation(points))


def _quasirandom(
    rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]
) -> FloatArray:
    low, high = arguments
    return np.asarray(low + (high - low) * _scattered(rng, n, d))


def _directions(points: FloatArray) -> FloatArray:
    """Points of the unit cube as directions, evenly where they are even."""
    from scipy.special import ndtri  # scipy stays off the start-up path

    # Independent normal numbers point into all directions alike.
    normal = ndtri(np.clip(points, 1e-12, 1.0 - 1e-12))
    normal[:, 0] += np.where(normal.any(axis=1), 0.0, 1.0)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _scattered_sphere(
    rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]
) -> FloatArray:
    return _directions(_scattered(rng, n, d))


def _scattered_ball(
    rng: np.random.Generator, n: int, d: int, arguments: tuple[Any, ...]
) -> FloatArray:
    points = _scattered(rng, n, d + 1)
    return np.asarray(_directions(points[:, :d]) * points[:, d:] ** (1.0 / d))


KINDS: Mapping[str, _Kind] = {
    "uniform": _Kind("uniform(low, high)", "between two bounds", _uniform, 2, 2),
    "normal": _Kind("normal(mean, deviation)", "Gaussian", _normal, 2, 2),
    "exponential": _Kind(
        "exponential(scale, shift, high)",
        "decaying from shift to high",
        _exponential,
        1,
        3,
    ),
    "choice": _Kind("choice([a, b, ...])", "one of some numbers", _choice, 1, 1),
    "sphere": _Kind("sphere", "on the unit sphere", _sphere, 0, 0),
    "ball": _Kind("ball", "in the unit ball", _ball, 0, 0),
    "quasirandom": _Kind(
        "quasirandom(low, high)", "between two bounds, evenly scattered", _quasirandom, 2, 2
    ),
    "scattered_sphere": _Kind(
        "scattered_sphere", "on the unit sphere, evenly scattered", _scattered_sphere, 0, 0
    ),
    "scattered_ball": _Kind(
        "scattered_ball", "in the unit ball, evenly scattered", _scattered_ball, 0, 0
    ),
    "cosine": _Kind("cosine(dimensions)", "of an angle between random directions", _cosine, 1, 1),
}


class Distribution(Setting):
    """Numbers that are drawn, ``uniform(-1, 1)``, or given: one for all, or one per neuron."""

    expected: ClassVar[str] = "a number, an array, or a distribution such as uniform(-1, 1)"

    def __init__(self, kind: str = "", arguments: tuple[Any, ...] = (), fixed: Any = None) -> None:
        self.kind, self.arguments = kind, arguments
        self.fixed: FloatArray | None = None if fixed is None else np.array(fixed, dtype=float)
        if self.fixed is not None:
            self.fixed.setflags(write=False)  # shared by all runs of a graph

    @classmethod
    def read(cls, written: Any) -> Self:
        first = written.partition("(")[0].strip() if isinstance(written, str) else ""
        if first in {*ARRAYS, *CREATION} or first.startswith("["):
            try:
                written = array_of(written)
            except (ExpressionError, ArithmeticError) as error:
                raise SettingError([("", str(error))]) from None
        if isinstance(written, str):
            return cls._parsed(written)
        try:
            if isinstance(written, (bool, dict)) or written is None:
                raise ValueError
            fixed = np.array(written, dtype=float)
        except (TypeError, ValueError):
            raise ValueError from None
        if not np.isfinite(fixed).all() or fixed.ndim > 2 or not fixed.size:
            raise SettingError([("", f"expected finite numbers, got {show(written)}")])
        return cls(fixed=fixed)

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        return {kind.form: kind.doc for kind in KINDS.values()}

    @classmethod
    def _parsed(cls, text: str) -> Self:
        # Longer texts are refused before a regular expression works on them.
        match = _CALL.fullmatch(text[:LONGEST])
        known = ", ".join(kind.form for kind in KINDS.values())
        if match is None or match[1] not in KINDS:
            if "(" in text and ")" not in text:
                raise SettingError(
                    [("", f"{show(text)} ends at a comma; in {{...}} put it into quotes")]
                )
            message = f"expected a number, an array or one of {known}, got {show(text)}"
            name, names = (match[1], KINDS) if match else ("", ())
            raise SettingError([("", misspelt("unknown-type", message, name, names))])
        kind = KINDS[match[1]]
        arguments = _arguments(match[2] or "", text)
        least, most = kind.least, kind.most
        if match[1] == "cosine" and not arguments:
            least = 0  # an ensemble then takes its own number of dimensions plus two
        if not least <= len(arguments) <= most:
            raise SettingError([("", f"expected {kind.form}, got {show(text)}")])
        distribution = cls(match[1], arguments)
        problem = distribution._wrong()
        if problem:
            raise SettingError([("", f"{problem}, got {show(text)}")])
        return distribution

    def _wrong(self) -> str:
        arguments, kind = self.arguments, self.kind
        if kind == "choice":
            options = arguments[0]
            if not isinstance(options, list) or not options:
                return "expected choice([a, b, ...]) with one entry or more"
            if len({len(o) if isinstance(o, list) else 0 for o in options}) > 1:
                return "expected entries of one length"
            return ""
        if any(isinstance(number, list) for number in arguments):
            return f"expected {KINDS[kind].form} with numbers"
        if kind in ("uniform", "quasirandom") and arguments[0] > arguments[1]:
            return f"expected {KINDS[kind].form} with low at most high"
        if kind == "normal" and arguments[1] < 0.0:
            return "expected a deviation of 0 or more"
        if kind == "exponential" and arguments[0] <= 0.0:
            return "expected a scale above 0"
        if kind == "cosine" and arguments and arguments[0] < 2.0:
            return "expected cosine(dimensions) with 2 dimensions or more"
        return ""

    def draw(self, rng: np.random.Generator, n: int, d: int = 1, dimensions: int = 1) -> FloatArray:
        """n rows of d numbers, (n, d); ``dimensions`` are those of ``cosine`` without a number.

        Raises
        ------
        ValueError : given numbers do not have this shape.
        """
        if self.fixed is None:
            arguments = (
                (dimensions + 2.0,)
                if self.kind == "cosine" and not self.arguments
                else self.arguments
            )
            drawn = KINDS[self.kind].draw(rng, n, d, arguments)
            if drawn.shape != (n, d):
                raise ValueError(f"expected entries of {d} numbers, got {drawn.shape[1]}")
            return drawn
        fixed = self.fixed
        if fixed.ndim == 1 and len(fixed) == n and d == 1:
            return fixed.reshape(n, 1).copy()
        if fixed.ndim == 0 or fixed.shape in ((n, d), (1, d)) or (fixed.shape == (d,) and d > 1):
            return np.broadcast_to(fixed, (n, d)).copy()
        shape = f"{n}x{d}" if d > 1 else f"{n}"
        raise ValueError(f"expected {shape} numbers, got an array of shape {fixed.shape}")

    def written(self) -> Any:
        if self.fixed is not None:
            return plain(self.fixed)
        inside = ", ".join(_shown(value) for value in self.arguments)
        return f"{self.kind}({inside})" if self.arguments else self.kind


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_shown(item) for item in value)}]"
    return f"{value!r}".removesuffix(".0")


def _arguments(text: str, whole: str) -> tuple[Any, ...]:
    """Numbers and lists of numbers, separated by commas."""
    arguments: list[Any] = []
    stack = [arguments]
    at, wants_value = 0, True
    text = text.strip()
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            break
        at, token = match.end(), match[1]
        if token == "," and not wants_value:
            wants_value = True
        elif token == "[" and wants_value and len(stack) < 3:
            stack.append([])
            stack[-2].append(stack[-1])
        elif token == "]" and len(stack) > 1 and not (wants_value and stack[-1]):
            stack.pop()
            wants_value = False
        elif token not in "[]," and wants_value:
            stack[-1].append(float(token))
            wants_value = False
        else:
            break
    else:
        if len(stack) == 1 and not (wants_value and arguments):
            return tuple(arguments)
    raise SettingError([("", f"expected numbers separated by commas, got {show(whole)}")])
