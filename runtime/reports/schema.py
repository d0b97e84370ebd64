"""Plain data that was read from a file, held against the form that it should have."""

from __future__ import annotations

from typing import Any

LARGEST = 1e308  # that a float can hold, about
MAYBE_NUMBER = (int, float, type(None))
_NAMES = {str: "a text", int: "a number", float: "a number", bool: "true or false"}
_NAMES |= {list: "a list", dict: "an object", type(None): "null"}


def check(value: Any, form: Any, address: str = "") -> None:
    """Check that a value has a form.

    Parameters
    ----------
    value : of dicts, lists and scalars.
    form : a type, or several; ``[form]`` for a list of such; ``{key: form}`` for a mapping that
        has these keys, among others.
    address : where the value stands, for the message.

    Raises
    ------
    ValueError : it has another one; the message says where, what was expected and got.
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
    is_fit = isinstance(value, types)
    if isinstance(value, bool):
        # A bool is an int to Python, and to nobody else.
        is_fit = bool in types
    elif isinstance(value, int):
        is_fit = is_fit and abs(value) < LARGEST
    if not is_fit:
        names = " or ".join(dict.fromkeys(_NAMES[t] for t in types))
        raise ValueError(f"{address or 'it'}: expected {names}, got {str(value)[:40]!r}")
