"""Parameters of blocks with expressions: names of components, constants, and definitions.

In: what a graph writes. Out: settings, which :mod:`blocks.core.equations` gives to expressions::

    states: [p(3), v]            Names: p is a vector of 3, v a number
    states: {x: m, vx: m/s}      Names with units
    constants: {k: 2, A: [[0, 1], [-1, 0]]}
    let: {c: "cos(x)", R: [["c", "-s"], ["s", "c"]]}
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, ClassVar, TypeAlias

import numpy as np

from blocks.core.settings import Setting, SettingError

_SIZED = re.compile(r"\s*(\w+)\s*(?:\(\s*([1-9]\d{0,3})\s*\))?\s*", re.ASCII)
Table: TypeAlias = "float | list[Table]"


class Names(Setting):
    """Names of components in order; a name may have a unit, and ``p(3)`` names a vector of three.

    units : the unit of each name, '' if it has none.
    """

    expected: ClassVar[str] = "names, as in [x, v] or [p(3), v], or with units, as in {x: m}"

    def __init__(self, units: Mapping[str, str], has_units: bool) -> None:
        self.units, self.has_units = dict(units), has_units
        self.lengths: dict[str, int | None] = {}
        for written in units:
            match = _SIZED.fullmatch(written)
            name, length = match.groups() if match else (written, None)
            self.lengths[name] = int(length) if length else None
        if len(self.lengths) < len(units):
            raise SettingError([("", f"a name is given twice in {', '.join(units)}")])

    @classmethod
    def read(cls, written: Any) -> Names:
        if isinstance(written, Mapping):
            if not all(isinstance(unit, str) or unit is None for unit in written.values()):
                raise ValueError
            return cls({str(name): unit or "" for name, unit in written.items()}, True)
        names = [written] if isinstance(written, str) else written
        if not isinstance(names, (list, tuple)) or not all(isinstance(n, str) for n in names):
            raise ValueError
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise SettingError([("", f"the name '{twice}' is given twice")])
        return cls(dict.fromkeys(names, ""), False)

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        return {"[x, v]": "names in order", "{x: m, v: m/s}": "names with units"}

    def written(self) -> Any:
        return self.units if self.has_units else list(self.units)

    def __iter__(self) -> Iterator[str]:
        return iter(self.lengths)

    @property
    def size(self) -> int:
        """The number of components."""
        return sum(length or 1 for length in self.lengths.values())

    @property
    def rows(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of each component; those of ``p(3)`` are p0, p1 and p2."""
        pairs = zip(self.lengths.items(), self.units.values(), strict=True)
        return tuple(
            (name if length is None else f"{name}{i}", unit)
            for (name, length), unit in pairs
            for i in range(length or 1)
        )

    def of(self, components: Sequence[str]) -> dict[str, str | list[str]]:
        """What each name stands for, where ``components`` are the texts of all in order."""
        texts, meaning = list(components), dict[str, "str | list[str]"]()
        for name, length in self.lengths.items():
            own, texts = texts[: length or 1], texts[length or 1 :]
            meaning[name] = own[0] if length is None and own else own
        return meaning


class Constants(Setting):
    """Names with their values: numbers, vectors, or matrices as lists of rows."""

    expected: ClassVar[str] = "a mapping of names to numbers, as in {a: 1.5} or {a: [1, 2]}"

    def __init__(self, values: Mapping[str, Table]) -> None:
        self.values = dict(values)

    @classmethod
    def read(cls, written: Any) -> Constants:
        if not isinstance(written, Mapping) or not all(isinstance(key, str) for key in written):
            raise ValueError
        return cls({key: _table(key, value) for key, value in written.items()})

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        return {"{k: 2.5}": "numbers", "{A: [[0, 1], [-1, 0]]}": "a matrix, row by row"}

    def written(self) -> Any:
        return self.values

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)

    @property
    def flat(self) -> tuple[float, ...]:
        """All numbers in order."""
        return tuple(chain.from_iterable(np.ravel(v).tolist() for v in self.values.values()))

    def of(self, argument: str) -> dict[str, Any]:
        """What each name stands for, where :attr:`flat` is the ``argument`` of a function."""
        meaning, first = {}, 0
        for name, value in self.values.items():
            shape = np.shape(value)
            texts = [f"{argument}[{first + i}]" for i in range(math.prod(shape))]
            meaning[name] = np.array(texts, object).reshape(shape).tolist()
            first += len(texts)
        return meaning


def _table(name: str, value: Any) -> Table:
    """A number, a vector or a matrix of finite numbers as plain floats."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    try:
        array = np.array(value)
    except ValueError:
        array = np.array("ragged")
    if array.dtype.kind not in "iuf" or array.ndim > 2 or not array.size:
        raise SettingError([(name, "expected a number, a list of numbers, or rows of numbers")])
    if not np.isfinite(array.astype(float)).all():
        raise SettingError([(name, "expected finite numbers")])
    plain: Table = array.astype(float).tolist()
    return plain


class Definitions(Setting):
    """Names with the expressions that they stand for, in an order in which each uses earlier ones.

    A list of expressions is a vector, and a list of lists a matrix.
    """

    expected: ClassVar[str] = "a mapping of names to expressions, as in {c: cos(x[2])}"

    def __init__(self, written: Mapping[str, Any]) -> None:
        self.texts = {name: _text(value) for name, value in written.items()}
        self._written = dict(written)

    def __iter__(self) -> Iterator[str]:
        return iter(self.texts)

    @classmethod
    def read(cls, written: Any) -> Definitions:
        if not isinstance(written, Mapping) or not all(isinstance(key, str) for key in written):
            raise ValueError
        return cls(written)

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        return {"{c: cos(t)}": "computed once, before the expressions that use it"}

    def written(self) -> Any:
        return self._written


def _text(value: Any) -> str:
    if isinstance(value, (list, tuple)) and value:
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, str):
        return value
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return repr(value)
    raise ValueError
