"""The function that a decoder computes of what an ensemble represents.

In: expressions of ``x`` as a graph writes them, a table, or a function for each group. Out: its
values at points, before a run::

    DecodedFunction.read(["x[0]*x[1]", "x[0]**2"]).of_points(points)      # (m, d) to (m, 2)
    DecodedFunction.read({"points": [-1, 0, 1], "targets": [1, 0, 1]})
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
    plain,
    show,
)

OwnNames = tuple[Constants | None, Definitions | None]


class PointError(ArithmeticError):
    """A function has no finite value at a point."""


class DecodedFunction(Setting):
    """Expressions of the components of ``x``: ``x[0]*x[1]``, or a list with one per component.

    In one dimension, ``x`` is the number itself. ``{points: [...], targets: [...]}`` is a function
    that is known at these points alone, a row each, and ``{each: ["x", "x**2"]}`` is one function
    for each group.
    """

    expected: ClassVar[str] = (
        "an expression such as x[0]*x[1], a list of them, {points: [...], targets: [...]}, or "
        "{each: [...]} with a function for each group"
    )

    def __init__(
        self,
        texts: str | tuple[str, ...] = (),
        table: tuple[FloatArray, FloatArray] | None = None,
        each: tuple[DecodedFunction, ...] = (),
    ) -> None:
        self.texts, self.table, self.each = texts, table, each

    @classmethod
    def read(cls, written: Any) -> DecodedFunction:
        if isinstance(written, dict):
            return cls._of_mapping(written)
        items = written if isinstance(written, (list, tuple)) else [written]
        texts = [_text(item) for item in items]
        if not texts:
            raise SettingError([("", f"expected {cls.expected}, got {show(written)}")])
        return cls(texts[0] if not isinstance(written, (list, tuple)) else tuple(texts))

    @classmethod
    def _of_mapping(cls, written: dict[str, Any]) -> DecodedFunction:
        if written.keys() == {"each"} and isinstance(written["each"], list) and written["each"]:
            return cls(each=tuple(cls.read(item) for item in written["each"]))
        if written.keys() != {"points", "targets"}:
            raise SettingError([("", f"expected {cls.expected}, got {show(written)}")])
        table = []
        for name in ("points", "targets"):
            try:
                rows = np.array(written[name], dtype=float)
            except (TypeError, ValueError):
                rows = np.array(math.nan)
            if rows.ndim not in (1, 2) or not rows.size or not np.isfinite(rows).all():
                raise SettingError([(name, "expected finite numbers, or rows of them")])
            table.append(rows.reshape(len(rows), -1))
        points, targets = table
        if len(points) != len(targets):
            message = f"expected a target for each of {len(points)} points, got {len(targets)}"
            raise SettingError([("targets", message)])
        return cls(table=(points, targets))

    def written(self) -> Any:
        if self.table is not None:
            return {"points": plain(self.table[0]), "targets": plain(self.table[1])}
        if self.each:
            return {"each": [function.written() for function in self.each]}
        return self.texts if isinstance(self.texts, str) else list(self.texts)

    def of_group(self, group: int) -> DecodedFunction:
        """The function of one group."""
        return self.each[group] if self.each else self

    def wrong_for(self, groups: int, d: int, own: OwnNames) -> str:
        """Why it does not fit so many groups of d dimensions; '' if it does."""
        if self.each and len(self.each) != groups:
            return f"expected a function for each of {groups} groups, got {len(self.each)}"
        if len({function.components(d, own) for function in self.each}) > 1:
            return "expected functions with as many components each"
        widths = [part.table[0].shape[1] for part in (self, *self.each) if part.table is not None]
        if any(width != d for width in widths):
            return f"expected points of {d} numbers, as the ensemble has dimensions"
        return ""

    def components(self, d: int, own: OwnNames) -> int:
        """The length of the value at a point of d dimensions, as far as the expressions are valid.

        ``own`` are the constants and definitions that the expressions name.
        """
        if self.table is not None:
            return len(self.table[1][0])
        if self.each:
            return self.each[0].components(d, own)
        try:
            return int(np.size(self._function(d, own)([0.5] * d)))
        except (ArithmeticError, ValueError):
            return 1 if isinstance(self.texts, str) else len(self.texts)

    def exact(self, d: int, own: OwnNames) -> tuple[Callable[[Any], Any], bool]:
        """The function of a point that both engines call, and whether it takes a bare number.

        Raises
        ------
        SettingError : it is no expression, or wrong for d dimensions.
        """
        if self.table is not None or self.each:
            raise SettingError(
                [("", "without neurons (Direct), expected expressions for all groups")]
            )
        if d == 1:
            try:
                return self._read({"x": None}, own), True
            except ExpressionError:
                pass
        try:
            return self._read({"x": d}, own), False
        except ExpressionError as error:
            raise SettingError([("", str(error))]) from None

    def _read(self, arguments: dict[str, int | None], own: OwnNames) -> Callable[[Any], Any]:
        constants = own[0].values if own[0] else {}
        return expression_function(self.texts, arguments, constants, own[1].texts if own[1] else {})

    def of_points(self, points: FloatArray, own: OwnNames) -> FloatArray:
        """The values (m, components) at points (m, d).

        Raises
        ------
        SettingError : an expression is wrong for d dimensions.
        PointError : naming a point where the function fails.
        """
        if self.table is not None:
            return self.table[1]
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
        try:
            # In one dimension people write x, and x[0] must be right as well: the second reading is
            # tried where the first is not an expression of a number.
            if d == 1:
                try:
                    scalar = self._read({"x": None}, own)
                except ExpressionError:
                    pass
                else:
                    return lambda point: scalar(point[0])
            return self._read({"x": d}, own)
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
