"""Parameters of a block: declared once with type, unit, bounds and a line of documentation.

The declaration is what the constructor checks against, what error messages quote, and what
``runtime blocks TYPE`` and docs/blocks.md print.
"""

from __future__ import annotations

import math
import numbers
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import numpy as np

from blocks.core.equation_settings import Names
from blocks.core.expression_text import ExpressionError
from blocks.core.expressions import array_of
from blocks.core.hints import misspelt
from blocks.core.settings import Setting, SettingError
from blocks.core.signals import TYPES, FloatArray, SignalType, signal_type
from blocks.core.stored_arrays import StoredArray, as_written
from blocks.messages import Message, Replace, message_of

REQUIRED: Any = object()
USUAL_ANGLES = {"rad": math.tau, "rad/s": 3.0 * math.tau}  # larger ones may be degrees
ParamKind = Literal["float", "int", "bool", "str", "array", "signal", "texts", "numbers", "setting"]
KINDS: dict[object, ParamKind] = {
    float: "float",
    int: "int",
    bool: "bool",
    str: "str",
    FloatArray: "array",
    SignalType: "signal",
    tuple[str, ...]: "texts",
    Mapping[str, float]: "numbers",
}
_DEGREES = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?) ?(?:deg|°)(.*)", re.ASCII)
_WITH_UNIT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?) ?([^\W\d]\S*)", re.ASCII)
_COMMA = re.compile(r"([-+]?\d+),(\d+)", re.ASCII)
ArrayShape = tuple[int | str | None, ...]


class DeclarationError(TypeError):
    """A block class is inconsistent; the message names the class and what to change."""


class ParameterError(ValueError):
    """One or more parameters are unknown, missing, of the wrong type or out of bounds.

    ``problems`` holds (parameter name, what is wrong, and a suggested fix).
    """

    def __init__(self, problems: Sequence[tuple[str, str]], block: str = "") -> None:
        self.problems = list(problems)
        where = f"{block}." if block else ""
        super().__init__("\n".join(f"{where}{name}: {text}" for name, text in self.problems))


@dataclass(frozen=True)
class Param:
    """The declaration of one parameter; see :func:`param`."""

    default: Any
    doc: str
    unit: str
    above: float | None
    at_least: float | None
    below: float | None
    at_most: float | None
    choices: tuple[str, ...]
    shapes: tuple[ArrayShape, ...]
    finite: bool
    name: str
    kind: ParamKind = "float"
    tunable: bool = False
    setting: type[Setting] | None = None

    @property
    def required(self) -> bool:
        return self.default is REQUIRED

    @property
    def units(self) -> tuple[str, ...]:
        """One unit for all numbers, or one per column: ``m, m, rad``."""
        return tuple(self.unit.split(", "))

    def describe(self, sizes: Mapping[str, int] | None = None) -> str:
        """What a value must be, in words: ``a number above 0 rad/s``.

        ``sizes`` are the known sizes of the symbols in its shapes.
        """
        if self.choices and self.kind != "array":
            return "one of " + ", ".join(self.choices)
        if self.setting is not None:
            return f"{self.setting.expected} in {self.unit}".removesuffix(" in ")
        if self.kind == "array":
            known: dict[Any, Any] = dict(sizes or {})
            # Two open lengths need not be equal.
            shapes = [
                ["m", "n"] if s == (None, None) else [str(known.get(d, d or "n")) for d in s]
                for s in self.shapes
                if s
            ]
            # 3x3, but neurons x n.
            size = " or ".join(
                ("x" if all(n.isdigit() for n in names) else " x ").join(names) for names in shapes
            )
            noun = f"an array of {size} numbers" if size else "an array of numbers"
            noun = f"a number or {noun}" if () in self.shapes else noun
        else:
            noun = {
                "float": "a number",
                "int": "an integer",
                "bool": "true or false",
                "str": "a string",
                "signal": "a signal type such as Scalar, Pose or Vector(3)",
                "texts": "a string or a list of strings",
                "numbers": "a mapping of names to numbers, as in {a: 1.5}",
                "setting": "a setting",
            }[self.kind]
        limits = self._limits()
        if not limits and self.unit:
            limits = "in"  # "a number in m", but "a number above 0 m"
        text = " ".join([noun, limits, self.unit]).replace("  ", " ").strip()
        return ", or ".join([text, *self.choices])

    def _limits(self) -> str:
        """The bounds in words: ``above 0 and at most 1``."""
        bounds = {"above": self.above, "at least": self.at_least}
        bounds |= {"below": self.below, "at most": self.at_most}
        return " and ".join(f"{w} {value:g}" for w, value in bounds.items() if value is not None)

    def bound(self, name: str, kind: ParamKind | type[Setting]) -> Param:
        """The declaration, completed by its name and annotation in the class body."""
        named = replace(self, name=self.name or name)
        if isinstance(kind, str):
            return replace(named, kind=kind)
        return replace(named, kind="setting", setting=kind)

    def convert(self, value: Any) -> Any:
        """Check a value and turn it into what the block holds.

        Raises
        ------
        ValueError : the message says what was expected and what was given.
        """
        if value is None and self.default is None:
            return None
        if self.setting is not None and isinstance(value, self.setting):
            return value
        if self.kind == "array" and isinstance(value, str) and value in self.choices:
            return value
        try:
            if self.setting is not None:
                return self.setting.read(value)
            converted = _CONVERT[self.kind](in_radians(value, self.units))
        except SettingError:
            raise
        except (ExpressionError, ZeroDivisionError) as error:
            quotes = "; in {...} it needs quotes" if value.count("(") > value.count(")") else ""
            message = message_of(error).within(after=f" (in '{value[:60]}'){quotes}")
            raise ValueError(message) from None
        except (TypeError, ValueError, ArithmeticError) as error:
            if self.kind == "signal" and isinstance(value, str):
                raise ValueError(misspelt("unknown-type", str(error), value, TYPES)) from None
            text = f"expected {self.describe()}, got {show(value)}"
            raise ValueError(self._with_number(text, value)) from None
        if self.choices and self.kind != "array" and converted not in self.choices:
            text = f"expected {self.describe()}, got {show(value)}"
            raise ValueError(misspelt("invalid-value", text, value, self.choices))
        if self.kind in ("float", "int", "array") and not self._within(converted):
            raise ValueError(f"expected {self.describe()}, got {show(value)}")
        if isinstance(converted, np.ndarray):
            converted.setflags(write=False)
        return converted

    def missing(self) -> Message:
        """What is wrong where a required parameter is not given."""
        return Message(f"missing; expected {self.describe()}: {self.doc}", "missing-value")

    def _with_number(self, text: str, value: Any) -> str:
        """A message, with how to write the number that a string seems to mean."""
        if not isinstance(value, str):
            return text
        if match := _COMMA.fullmatch(value):
            number = f"{match[1]}.{match[2]}"
            fixes = [Replace(number, title=f"Replace by {number}")]
            return Message(f"{text}; a decimal point is a dot: {number}", fixes=fixes)
        match = _WITH_UNIT.fullmatch(value.strip())
        if not match or self.kind not in ("float", "int", "array") or not self.unit:
            return text
        if len(self.units) == 1 and self.unit.startswith("rad") and match[2].startswith("deg"):
            return f"{text}; in degrees, it is {match[1]}deg{self.unit.removeprefix('rad')}"
        return f"{text}; write the number alone, in {self.unit}"

    def _within(self, numbers: Any) -> bool:
        if not isinstance(numbers, np.ndarray):
            low = high = float(numbers)
        elif numbers.size:
            low, high = float(numbers.min()), float(numbers.max())  # NaN if one of them is
        else:
            return True
        if math.isnan(low) or (self.finite and (math.isinf(low) or math.isinf(high))):
            return False
        return (
            (self.above is None or low > self.above)
            and (self.at_least is None or low >= self.at_least)
            and (self.below is None or high < self.below)
            and (self.at_most is None or high <= self.at_most)
        )

    def fits(self, value: FloatArray, sizes: dict[str, int]) -> bool:
        """Whether an array has one of the declared shapes, given the sizes of the symbols."""
        if not self.shapes:
            return True
        return any(
            len(shape) == value.ndim
            and all(
                want is None or have == (sizes.get(want, have) if isinstance(want, str) else want)
                for want, have in zip(shape, value.shape, strict=True)
            )
            for shape in self.shapes
        )


def param(
    default: object = REQUIRED,
    *,
    doc: str | None = None,
    unit: str = "",
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    choices: Iterable[str] = (),
    shape: ArrayShape | Sequence[ArrayShape] = (),
    finite: bool = True,
    name: str = "",
    tunable: bool = False,
) -> Any:
    """Declare a parameter of a block; its type is the annotation beside it.

    Parameters
    ----------
    default : left out, the parameter is required; None makes "not given" a legal value.
    doc : one line of documentation.
    unit : SI unit, as plots and messages print it; one per column, as in ``m, m, rad``. Where it
        begins with rad, graphs may write degrees: ``90deg``, ``30deg/s``.
    above, at_least, below, at_most : bounds; of every element, for an array.
    choices : the allowed strings; those of an array stand in place of its numbers.
    shape : an array's shape, or several allowed ones; a string is the size given by the integer
        parameter of that name, None any size.
    finite : False accepts ``inf``.
    name : the name in graphs, if it differs from the attribute's.
    tunable : whether it may change while a run goes on. The shapes of states do not depend on it,
        and what ``start`` computes from it is in cached states or attributes, never in memory.

    Raises
    ------
    DeclarationError : there is no ``doc``, which messages, docs and editors show.
    """
    if doc is None:
        raise DeclarationError("param() needs a line of documentation: param(1.0, doc='the gain')")
    shapes: tuple[ArrayShape, ...] = ()
    if shape:
        nested = isinstance(shape, list) or isinstance(shape[0], tuple)
        shapes = cast("tuple[ArrayShape, ...]", tuple(shape) if nested else (tuple(shape),))
    return Param(
        default=default,
        doc=doc,
        unit=unit,
        above=above,
        at_least=at_least,
        below=below,
        at_most=at_most,
        choices=tuple(choices),
        shapes=shapes,
        finite=finite,
        name=name,
        tunable=tunable,
    )


def in_radians(value: Any, units: Sequence[str]) -> Any:
    """A value with strings such as ``90deg`` converted to radians, where the unit is radians.

    ``units`` are one for all numbers, or one per item of the list; other strings stay unchanged.
    """
    if isinstance(value, str) and len(units) == 1 and units[0].startswith("rad"):
        match = _DEGREES.fullmatch(value.strip())
        if match and match[2] == units[0].removeprefix("rad"):
            return math.radians(float(match[1]))
    if isinstance(value, (list, tuple)):
        pairs = zip(value, _units_of_items(value, units), strict=True)
        return [in_radians(item, own) for item, own in pairs]
    return value


def _units_of_items(value: Sequence[Any], units: Sequence[str]) -> list[Sequence[str]]:
    """A row's items have one unit each; each row of a table, also of a square one, has all."""
    is_row = len(units) == len(value) and not any(isinstance(x, (list, tuple)) for x in value)
    return [(unit,) for unit in units] if is_row else [units] * len(value)


def maybe_degrees(value: Any, units: Sequence[str]) -> list[tuple[float, str]]:
    """Numbers in rad beyond a turn, or in rad/s beyond three per second, which may be degrees."""
    if isinstance(value, (list, tuple)):
        pairs = zip(value, _units_of_items(value, units), strict=True)
        return [part for item, own in pairs for part in maybe_degrees(item, own)]
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    limit = USUAL_ANGLES.get(units[0], math.inf) if len(units) == 1 else math.inf
    return [(float(value), units[0])] if is_number and limit < abs(value) < math.inf else []


def plain(value: Any) -> Any:
    """A parameter's value as graphs write it; a user's own signal type stays as it is."""
    if isinstance(value, np.ndarray):
        return as_written(value)
    if isinstance(value, tuple):
        return list(value)
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, Setting):
        return value.written()
    if isinstance(value, SignalType) and value.rows:
        return dict(value.rows)
    if isinstance(value, SignalType) and TYPES.get(value.name) == value.sized(None):
        return value.name if value.symbol else str(value)
    return value


def show(value: Any) -> str:
    """A value as an error message quotes it: its kind, shortened."""
    if value is None:
        return "nothing (null)"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        text = value if len(value) <= 40 else value[:37] + "..."
        return f"the string '{text}'"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, StoredArray):
        value = value.values
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if isinstance(value, (list, tuple)):
        text = str(list(value))
        return text if len(text) <= 60 else f"a list of {len(value)} items"
    text = str(value)
    return text if len(text) <= 40 else text[:37] + "..."


def as_matrix(value: FloatArray, declared: Param) -> str:
    """How a number or a list is written as one row, where a parameter may be a matrix."""
    if value.ndim > 1 or not any(len(shape) == 2 for shape in declared.shapes):
        return ""
    return f"; one row is written {show([np.atleast_1d(value).tolist()])}"


def size_of(value: FloatArray) -> str:
    """The size of an array in words: ``a number``, ``3 numbers``, ``2 x 3 numbers``."""
    sides = " x ".join(map(str, value.shape))
    return f"{sides} numbers" if sides else "a number"


def _number(value: Any) -> Any:
    """A value that is a number, taken out of a zero-dimensional array if necessary."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError
    return value


def _float(value: Any) -> float:
    return float(_number(value))


def _int(value: Any) -> int:
    number = _number(value)
    if not isinstance(number, numbers.Integral):
        raise TypeError
    return int(number)


def _bool(value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError
    return bool(value)


def _str(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _signal(value: Any) -> SignalType:
    if isinstance(value, Mapping):  # names of components with their units
        rows = Names.read(value).rows
        return replace(
            signal_type("Scalar" if len(rows) == 1 else f"Vector({len(rows)})"), rows=rows
        )
    return value if isinstance(value, SignalType) else signal_type(_str(value))


def _texts(value: Any) -> tuple[str, ...]:
    """One text, or several; numbers among them count as written."""
    items = value if isinstance(value, (list, tuple)) else [value]
    if not items:
        raise TypeError
    return tuple(item if isinstance(item, str) else repr(_number(item)) for item in items)


def _numbers(value: Any) -> dict[str, float]:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise TypeError
    numbers = {key: _float(item) for key, item in value.items()}
    if not all(map(math.isfinite, numbers.values())):
        raise ValueError
    return numbers


def _array(value: Any) -> FloatArray:
    if isinstance(value, StoredArray):
        return value.values
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "fiu":
            raise TypeError
        return np.array(value, dtype=float)
    if isinstance(value, str) and re.search(r"\w\s*\(|\[", value):
        return array_of(value)
    if not isinstance(value, (list, tuple)):
        return np.array(_float(value))
    rows = [_array(item) for item in value]
    if len({row.shape for row in rows}) > 1:
        raise ValueError
    return np.array(rows, dtype=float)


_CONVERT = {
    "float": _float,
    "int": _int,
    "bool": _bool,
    "str": _str,
    "array": _array,
    "signal": _signal,
    "texts": _texts,
    "numbers": _numbers,
}
