"""What a block's box says of its parameters: the value by which a reader knows it.

In: a type and its parameters. Out: a short text, in which a line break is the bar of a fraction::

    Gain, {"gain": 3.0}        ->  "× 3"
    Lowpass, {"tau": 0.1}      ->  "1\\n0.1 s + 1"
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

LONGEST = 26  # characters of a line; what is longer stays in the hovering text

Values = Mapping[str, Any]


def value_text(kind: str, values: Values) -> str:
    """The value of a block of a type, or '' if it has none that fits into its box."""
    if kind not in _TEXTS:
        return ""
    try:
        text = _TEXTS[kind](values)
    except (KeyError, TypeError, ValueError):
        return ""  # a block of another package with the same name
    return text if all(len(line) <= LONGEST for line in text.split("\n")) else ""


def _number(value: Any) -> str:
    return f"{float(value):.4g}".replace("-", "−")


def _numbers(value: Any) -> str:
    """A number, or the numbers of an array."""
    array = np.asarray(value, float)
    if array.ndim > 1:
        return f"{' × '.join(map(str, array.shape))} matrix"
    return f"[{', '.join(map(_number, array))}]" if array.ndim else _number(array)


def _polynomial(coefficients: Any, variable: str) -> str:
    """Coefficients of falling powers: [2, 0, 1] is 2 s² + 1."""
    array = np.atleast_1d(np.asarray(coefficients, float))
    text = ""
    for power, each in zip(range(len(array) - 1, -1, -1), array, strict=True):
        if each == 0.0:
            continue
        factor = "" if abs(each) == 1.0 and power else _number(abs(each))
        name = "" if power == 0 else variable if power == 1 else f"{variable}{_superscript(power)}"
        sign = "−" if each < 0.0 else "+"
        start = ("−" if each < 0.0 else "") if not text else f" {sign} "
        text += start + " ".join(part for part in (factor, name) if part)
    return text or "0"


def _superscript(power: int) -> str:
    return str(power).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _fraction(variable: str) -> Callable[[Values], str]:
    def text(values: Values) -> str:
        above = _polynomial(values["numerator"], variable)
        return f"{above}\n{_polynomial(values['denominator'], variable)}"

    return text


def _expression(values: Values) -> str:
    (expression,) = values["expression"]  # of several none fits: a ValueError
    return str(expression)


_TEXTS: dict[str, Callable[[Values], str]] = {
    "Clip": lambda v: f"{_numbers(v['low'])} … {_numbers(v['high'])}",
    "Compare": lambda v: f"{v['operator']} {_numbers(v['value'])}",
    "Constant": lambda v: _numbers(v["value"]),
    "Delay": lambda v: f"{_number(v['delay'])} s",
    "Derivative": lambda v: f"s\n{_polynomial([v['tau'], 1.0], 's')}",
    "DiscreteTransferFunction": _fraction("z"),
    "Function": _expression,
    "Gain": lambda v: f"× {_numbers(v['gain'])}",
    "Integrator": lambda v: "1\ns",
    "Lowpass": lambda v: f"1\n{_polynomial([v['tau'], 1.0], 's')}",
    "Product": lambda v: "×",
    "TransferFunction": _fraction("s"),
    "UnitDelay": lambda v: "1\nz",
}
