"""The function that a decoder computes of what an ensemble represents.

In: expressions of ``x`` as a graph writes them. Out: its values at points, before a run::

    DecodedFunction.read(["x[0]*x[1]", "x[0]**2"]).of_points(points)      # (m, d) to (m, 2)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from blocks.core import (
    Constants,
    Definitions,
    ExpressionError,
    FloatArray,
    Setting,
    SettingError,
    expression_function,
    show,
)

OwnNames = tuple[Constants | None, Definitions | None]


class PointError(ArithmeticError):
    """A function has no finite value at a point."""


class DecodedFunction(Setting):
    """Expressions of the components of ``x``: ``x[0]*x[1]``, or a list with one per component.

    In one dimension, ``x`` is the number itself.
    """

    expected: ClassVar[str] = "an expression such as x[0]*x[1], or a list of them"

    def __init__(self, texts: str | tuple[str, ...]) -> None:
        self.texts = texts

    @classmethod
    def read(cls, written: Any) -> DecodedFunction:
        items = written if isinstance(written, (list, tuple)) else [written]
        texts = [_text(item) for item in items]
        if not texts:
            raise SettingError([("", f"expected {cls.expected}, got {show(written)}")])
        return cls(texts[0] if not isinstance(written, (list, tuple)) else tuple(texts))

    def written(self) -> Any:
        return self.texts if isinstance(self.texts, str) else list(self.texts)

    def components(self, d: int, own: OwnNames) -> int:
        """The length of the value at a point of d dimensions, as far as the expressions are valid.

        ``own`` are the constants and definitions that the expressions name.
        """
        try:
            return int(np.size(self._function(d, own)([0.5] * d)))
        except (ArithmeticError, ValueError):
            return 1 if isinstance(self.texts, str) else len(self.texts)

    def of_points(self, points: FloatArray, own: OwnNames) -> FloatArray:
        """The values (m, components) at points (m, d).

        Raises
        ------
        SettingError : an expression is wrong for d dimensions.
        PointError : naming a point where the function fails.
        """
        function = self._function(points.shape[1], own)
        values = np.empty((len(points), self.components(points.shape[1], own)))
        for i, point in enumerate(points.tolist()):
            try:
                values[i] = function(point)
            except (ArithmeticError, ValueError) as error:
                raise PointError(_failed(point, str(error))) from None
            if not all(map(math.isfinite, values[i].tolist())):
                raise PointError(_failed(point, f"the value is {values[i].tolist()}"))
        return values

    def _function(self, d: int, own: OwnNames) -> Callable[[Any], Any]:
        constants = own[0].values if own[0] else {}
        let = own[1].texts if own[1] else {}
        try:
            # In one dimension people write x, and x[0] must be right as well: the second reading is
            # tried where the first is not an expression of a number.
            if d == 1:
                try:
                    scalar = expression_function(self.texts, {"x": None}, constants, let)
                except ExpressionError:
                    pass
                else:
                    return lambda point: scalar(point[0])
            return expression_function(self.texts, {"x": d}, constants, let)
        except ExpressionError as error:
            where = f"{error.place}: " if isinstance(error.place, str) else ""
            raise SettingError([("", f"{where}{error}")]) from None


def _text(item: Any) -> str:
    if isinstance(item, (int, float)) and not isinstance(item, bool):
        return repr(item)
    if not isinstance(item, str):
        raise ValueError
    return item


def _failed(point: list[float], why: str) -> str:
    at = ", ".join(f"{x:.6g}" for x in point)
    return (
        f"the function fails at x = [{at}], inside the radius: {why}; write it so that it is "
        "defined there, or give eval_points that avoid the place"
    )
