"""Checks plain data that was read from a file against its expected form."""

from __future__ import annotations

from typing import Any

LARGEST = 1e308  # about the largest float
MAYBE_NUMBER = (int, float, type(None))
_NAMES = {str: "a string", int: "a number", float: "a number", bool: "true or false"}
_NAMES |= {list: "a list", dict: "an object", type(None): "null"}


def check(value: Any, form: Any, address: str = "") -> None:
    """Check that a value has a form.

    Parameters
    ----------
    value : of dicts, lists and scalars.
    form : a type or a tuple of types; ``[form]`` for a list; ``{key: form}`` for a mapping with at
        least these keys.
    address : of the value, for the message.

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
            check(value[key], inner, inside)
    elif isinstance(form, list):
        _expect(value, (list,), address)
        for i, item in enumerate(value):
            check(item, form[0], f"{address}[{i}]")
    else:
        _expect(value, form if isinstance(form, tuple) else (form,), address)


def _expect(value: Any, types: tuple[type, ...], address: str) -> None:
    is_valid = isinstance(value, types)
    if isinstance(value, bool):
        # In Python, a bool is an int.
        is_valid = bool in types
    elif isinstance(value, int):
        is_valid = is_valid and abs(value) < LARGEST
    if not is_valid:
        names = " or ".join(dict.fromkeys(_NAMES[t] for t in types))
        raise ValueError(f"{address or 'top level'}: expected {names}, got {str(value)[:40]!r}")
