"""Plain values as YAML text that gives equal values under YAML 1.2 and 1.1.

In: dicts, lists and scalars. Out: text that :func:`runtime.document.node.parse_yaml` and other
tools read alike::

    dump_yaml({"seed": 7, "title": "on", "rate": 1e-05})
    # {seed: 7, title: 'on', rate: 1.0e-05}
"""

from __future__ import annotations

import json
import math
import re
from typing import Any

import yaml

from blocks.core import StoredArray
from runtime.document.scalars import is_text

_PLAIN = re.compile(r"[A-Za-z_$][A-Za-z0-9_$./#-]*")
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def dump_yaml(value: Any) -> str:
    """Plain values as YAML from which :func:`parse_yaml` reads equal values."""
    return _YamlDumper.text(value)


def flow_yaml(value: Any) -> str:
    """Plain values as one line of YAML from which equal values are read."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{flow_yaml(k)}: {flow_yaml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(flow_yaml, value)) + "]"
    if isinstance(value, StoredArray):
        return flow_yaml(value.origin or repr(value))
    if isinstance(value, float):
        return _float_text(value)
    if isinstance(value, str):
        plain = _PLAIN.fullmatch(value) and is_text(value)
        return value if plain else f'"{"".join(map(_escape, value))}"'
    return json.dumps(value)  # integers, true, false and null are the same in JSON


def _escape(c: str) -> str:
    """A character as written between double quotes."""
    if c in '"\\':
        return f"\\{c}"
    return c if c.isprintable() else f"\\U{ord(c):08x}"


class _YamlDumper(_DUMPER):  # type: ignore[misc, valid-type]
    """Flow style for lists and mappings of scalars, block style for the rest."""

    @classmethod
    def text(cls, value: Any) -> str:
        text: str = yaml.dump(
            value,
            Dumper=cls,
            sort_keys=False,
            width=100,
            allow_unicode=True,
            default_flow_style=None,
        )
        return text

    def ignore_aliases(self, data: Any) -> bool:
        # yaml would write an anchor where a list occurs twice; people edit this text.
        return True


def _represent_text(dumper: Any, text: str) -> Any:
    # Quote what either version of YAML would not read as this text.
    style = None if is_text(text) else "'"
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


def _represent_float(dumper: Any, number: float) -> Any:
    return dumper.represent_scalar("tag:yaml.org,2002:float", _float_text(number))


def _float_text(number: float) -> str:
    if math.isnan(number):
        return ".nan"
    if math.isinf(number):
        return ".inf" if number > 0 else "-.inf"
    # YAML 1.1 reads 1e-05 as a string: its floats need a dot.
    mantissa, e, exponent = repr(number).partition("e")
    return mantissa + (".0" if "." not in mantissa else "") + e + exponent


def _represent_array(dumper: Any, array: StoredArray) -> Any:
    return dumper.represent_data(array.origin or array.values.tolist())


_YamlDumper.add_representer(StoredArray, _represent_array)
_YamlDumper.add_representer(str, _represent_text)
_YamlDumper.add_representer(float, _represent_float)
