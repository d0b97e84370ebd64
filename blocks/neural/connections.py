"""Numbers for each pair of neurons: drawn, listed, or a rule of the two neurons' places.

In: what a graph writes. Out: a matrix with a row for each neuron that a connection leads to, and a
column for each one that it comes from::

    PerConnection.read("exp(cos(2*pi*(i - j)/n))").draw(rng, 100, 100)      # (100, 100)
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, ClassVar, Self

import numpy as np

from blocks.core import ExpressionError, FloatArray, SettingError, expression_function
from blocks.neural.distributions import Distribution

PLACES = ("i", "j", "m", "n")
_PLACE = re.compile(r"(?<![\w.$])[ijmn](?![\w(])", re.ASCII)


class PerConnection(Distribution):
    """A Distribution, or an expression of i, j, m and n.

    i counts the neurons after the connection, of which there are m, and j those before it, n.
    """

    expected: ClassVar[str] = (
        "a number, an array, a distribution such as normal(0, 1), or an expression of i, j, m, n"
    )
    rule: str = ""

    @classmethod
    def read(cls, written: Any) -> Self:
        # A list over an index, as in [i for i in range(3)], may call it i as well.
        if not isinstance(written, str) or "[" in written or not _PLACE.search(written):
            return super().read(written)
        pattern = cls(kind="rule")
        pattern.rule = written
        try:
            expression_function(written, dict.fromkeys(PLACES))
        except ExpressionError as error:
            raise SettingError([("", f"{error} (in '{written[:60]}')")]) from None
        return pattern

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        return {**super().forms(), "exp(cos(2*pi*(i - j)/n))": "a rule of the neurons' places"}

    def draw(self, rng: np.random.Generator, n: int, d: int = 1, dimensions: int = 1) -> FloatArray:
        return _of_places(self.rule, n, d).copy() if self.rule else super().draw(rng, n, d)

    def largest(self, n: int, d: int) -> float:
        """The largest number that can be drawn for n neurons after and d before; infinity if there
        is none.
        """
        if self.rule:
            return float(_of_places(self.rule, n, d).max())
        if self.fixed is not None:
            return float(self.fixed.max())
        if self.kind == "choice":
            return float(np.max(self.arguments[0]))
        at = {"uniform": 1, "exponential": 2}.get(self.kind, len(self.arguments))
        return float(self.arguments[at]) if at < len(self.arguments) else math.inf

    def written(self) -> Any:
        return self.rule or super().written()


@lru_cache(maxsize=8)
def _of_places(rule: str, m: int, n: int) -> FloatArray:
    """The matrix (m, n) of a rule, which a check and each run of a sweep ask for again.

    Raises
    ------
    ValueError : it is no finite number for some pair of neurons.
    """
    # Number by number: NumPy's exp and cos differ between processors, and weights are part of the
    # bits of a run.
    function = expression_function(rule, dict.fromkeys(PLACES))
    matrix = np.empty((m, n))
    for i in range(m):
        for j in range(n):
            try:
                value = function(float(i), float(j), float(m), float(n))
            except (ArithmeticError, ValueError) as error:
                raise ValueError(f"'{rule}' fails at i = {i}, j = {j}: {error}") from None
            if isinstance(value, tuple):
                raise ValueError(f"expected one number for each i and j, got {len(value)}")
            if not math.isfinite(value):
                raise ValueError(f"'{rule}' is {value} at i = {i}, j = {j}")
            matrix[i, j] = value
    matrix.setflags(write=False)
    return matrix
