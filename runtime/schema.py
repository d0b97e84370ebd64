"""Checks plain data that was read from a file against its expected form."""

from __future__ import annotations

import math
from typing import Any

LARGEST = 1e308  # about the largest float
NUMBER, MAYBE_NUMBER = (int, float), (int, float, type(None))
_NAMES = {str: "a string", int: "a number", float: "a number", bool: "true or false"}
_NAMES |= {list: "a list", dict: "an object", type(None): "null"}


def check(value: Any, form: Any, address: str = "", longest: float = math.inf) -> None:
    """Check that a value has a form.

    Parameters
    ----------
    value : of dicts, lists and scalars.
    form : a type or a tuple of types; ``[form]`` for a list; ``{key: form}`` for a mapping with at
        least these keys.
    address : of the value, for the message.
    longest : the largest length of a string or a list.

    Raises
    ------
    ValueError : it does not; the message gives the address, the expected types and the value.
    """
    if isinstance(form, dict):
        _expect(value, (dict,), address)
        for key, inner in form.items():
            inside = f"{address}.{key}".lstrip(".")
            if key not in value:
                raise ValueError(f"{inside} is missing")
            check(value[key], inner, inside, longest)
    elif isinstance(form, list):
        _expect(value, (list,), address)
        for i, item in enumerate(value):
            check(item, form[0], f"{address}[{i}]", longest)
    else:
        _expect(value, form if isinstance(form, tuple) else (form,), address)
    if isinstance(value, (str, list)) and len(value) > longest:
        raise ValueError(f"{address}: expected a length of up to {longest}, got {len(value)}")


def is_number(value: Any) -> bool:
    """Whether a value is a number that a float can hold; in Python, a bool is an int."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return isinstance(value, float) or abs(value) < LARGEST


def _expect(value: Any, types: tuple[type, ...], address: str) -> None:
    is_valid = bool in types if isinstance(value, bool) else isinstance(value, types)
    is_huge = isinstance(value, int) and abs(value) >= LARGEST
    if not is_valid or is_huge:
        names = " or ".join(dict.fromkeys(_NAMES[t] for t in types))
        raise ValueError(f"{address or 'top level'}: expected {names}, got {str(value)[:40]!r}")
