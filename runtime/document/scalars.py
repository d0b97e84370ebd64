"""Plain scalars by YAML 1.2's core schema: ``1e-3`` is a number, ``on`` text, ``010`` ten.

In: a scalar without quotes. Out: None, a bool, an int, a float or the string itself. PyYAML reads
YAML 1.1, in which these three are a string, true and 8, and ``12:30`` is 750.
"""

from __future__ import annotations

import math
import re
from typing import Any

_INT = re.compile(r"[-+]?[0-9]+")
_OTHER_INT = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_WORDS: dict[str, Any] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".inf", ".Inf", ".INF", "+.inf", "+.Inf", "+.INF"), math.inf),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), -math.inf),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), math.nan),
}
MAX_DIGITS = 400


def parse_scalar(text: str) -> Any:
    """The value of a plain scalar.

    Raises
    ------
    ValueError : the number is out of a float's range.
    """
    if text in _WORDS:
        return _WORDS[text]
    if _INT.fullmatch(text):
        # int() refuses more than 4,300 digits with a message of its own; all of these are out of
        # range.
        digits = text.lstrip("+-").lstrip("0")
        return in_range(int(text)) if len(digits) <= MAX_DIGITS else in_range(10**MAX_DIGITS)
    if _OTHER_INT.fullmatch(text):
        return in_range(int(text, 0))
    if _FLOAT.fullmatch(text):
        number = float(text)
        if math.isinf(number):
            raise ValueError("too large for a float; infinity is written .inf")
        # 1e-400 is not what a graph means by 0.
        if number == 0.0 and re.search("[1-9]", re.split("[eE]", text)[0]):
            raise ValueError("too small for a float; write 0 if that is intended")
        return number
    return text


def in_range(number: int) -> int:
    """The number, if it is in a float's range."""
    try:
        float(number)
    except OverflowError:
        raise ValueError("too large for a float; infinity is written .inf") from None
    return number


def is_text(text: str) -> bool:
    """Whether a plain scalar written like this is read as text."""
    try:
        return isinstance(parse_scalar(text), str)
    except ValueError:
        return False
