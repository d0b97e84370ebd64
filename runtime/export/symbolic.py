"""Stand-ins for numbers, which write down as C what Python computes with them.

In goes ``-math.expm1(-0.01 / tau)`` with a stand-in for ``tau``, out comes its C. A comparison asks
:data:`DECISIONS` for its answer, so that both are tried; what wants a float raises.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

import numpy as np

FUNCTIONS = ("exp", "expm1", "log", "log1p", "sqrt", "sin", "cos", "tan", "atan", "tanh")


class Number:
    """A stand-in for a number; ``text`` is how C computes it."""

    __array_priority__ = 1000.0

    def __init__(self, text: str) -> None:
        self.text = text

    def _with(self, sign: str, other: Any, swapped: bool = False) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        one, two = (text_of(other), self.text) if swapped else (self.text, text_of(other))
        return Number(f"({one} {sign} {two})")

    def __add__(self, other: Any) -> Any:
        return self._with("+", other)

    def __radd__(self, other: Any) -> Any:
        return self._with("+", other, swapped=True)

    def __sub__(self, other: Any) -> Any:
        return self._with("-", other)

    def __rsub__(self, other: Any) -> Any:
        return self._with("-", other, swapped=True)

    def __mul__(self, other: Any) -> Any:
        return self._with("*", other)

    def __rmul__(self, other: Any) -> Any:
        return self._with("*", other, swapped=True)

    def __truediv__(self, other: Any) -> Any:
        return self._with("/", other)

    def __rtruediv__(self, other: Any) -> Any:
        return self._with("/", other, swapped=True)

    def __neg__(self) -> Number:
        return Number(f"(-{self.text})")

    def __pos__(self) -> Number:
        return self

    def __abs__(self) -> Number:
        return Number(f"fabs({self.text})")

    def sqrt(self) -> Number:
        """What numpy asks of an object."""
        return Number(f"sqrt({self.text})")

    def item(self) -> Number:
        return self

    def _than(self, sign: str, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else Condition(self, sign, other)

    def __lt__(self, other: Any) -> Any:
        return self._than("<", other)

    def __le__(self, other: Any) -> Any:
        return self._than("<=", other)

    def __gt__(self, other: Any) -> Any:
        return self._than(">", other)

    def __ge__(self, other: Any) -> Any:
        return self._than(">=", other)

    def __eq__(self, other: object) -> Any:
        return self._than("==", other)

    def __ne__(self, other: object) -> Any:
        return self._than("!=", other)

    def __bool__(self) -> bool:
        return bool(Condition(self, "!=", 0.0))

    def __float__(self) -> float:
        raise TypeError("a float is wanted")

    __hash__ = None  # type: ignore[assignment]
    __int__ = __float__


class Condition:
    """A comparison of a stand-in; what it decides is tried both ways, see :func:`_explored`."""

    def __init__(self, one: Number, sign: str, other: Any) -> None:
        self.text = f"{one.text} {sign} {text_of(other)}"

    def __bool__(self) -> bool:
        return DECISIONS.get().answer(self.text)


@dataclass
class Decisions:
    """What conditions decide in one trace, in order; those that were not chosen are true."""

    chosen: tuple[bool, ...] = ()
    asked: list[str] = field(default_factory=list)

    def answer(self, text: str) -> bool:
        """The decision of the next condition."""
        self.asked.append(text)
        at = len(self.asked) - 1
        return self.chosen[at] if at < len(self.chosen) else True


DECISIONS: ContextVar[Decisions] = ContextVar("DECISIONS")


def text_of(value: Any) -> str:
    """An operand in C."""
    if isinstance(value, Number):
        return value.text
    number = float(value)
    if math.isinf(number):
        return "(double)INFINITY" if number > 0.0 else "(-(double)INFINITY)"
    if math.isnan(number):
        return "(double)NAN"
    return f"({number!r})" if math.copysign(1.0, number) < 0.0 else repr(number)


class _Math:
    """The module math, for numbers and their stand-ins."""

    def __getattr__(self, name: str) -> Any:
        function = getattr(math, name)
        if not callable(function):
            return function

        def called(*arguments: Any) -> Any:
            if not any(isinstance(each, Number) for each in arguments):
                return function(*arguments)
            if name not in FUNCTIONS:
                raise TypeError(name)
            return Number(f"{name}({arguments[0].text})")

        return called


def _has_blocks(module: Any) -> bool:
    """Whether a module is the library's, or defines blocks of someone's own."""
    from blocks.core import Block

    members = list(vars(module).values())
    return module.__name__.startswith("blocks.") or any(
        isinstance(each, type) and issubclass(each, Block) for each in members
    )


@contextmanager
def symbolic_math() -> Iterator[None]:
    """Let the functions of math in the modules of blocks take stand-ins meanwhile."""
    modules = [m for m in list(sys.modules.values()) if vars(m).get("math") is math]
    ours = [m for m in modules if m.__name__.partition(".")[0] != "runtime" and _has_blocks(m)]
    for module in ours:
        vars(module)["math"] = _Math()
    try:
        yield
    finally:
        for module in ours:
            vars(module)["math"] = math
