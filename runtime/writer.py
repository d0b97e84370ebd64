"""Plain values as YAML text that reads back equal, by our rules and by YAML 1.1's."""

from __future__ import annotations

import math
from typing import Any

import yaml

from runtime.scalars import is_text

_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def dump_yaml(value: Any) -> str:
    """Write plain values as YAML that :func:`runtime.document.parse_yaml` reads back equal."""
    return _Writer.text(value)


class _Writer(_DUMPER):  # type: ignore[misc, valid-type]
    """Flow style for what holds no mapping deeper down, block style for the rest."""

    @classmethod
    def text(cls, value: Any) -> str:
        dumped: str = yaml.dump(
            value,
            Dumper=cls,
            sort_keys=False,
            width=100,
            allow_unicode=True,
            default_flow_style=None,
        )
        return dumped

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _represent_text(dumper: Any, text: str) -> Any:
    # Quote what would read back as anything but this text, by our rules or by YAML 1.1's.
    style = None if is_text(text) else "'"
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


def _represent_float(dumper: Any, number: float) -> Any:
    if math.isnan(number):
        text = ".nan"
    elif math.isinf(number):
        text = ".inf" if number > 0 else "-.inf"
    else:
        mantissa, e, exponent = repr(number).partition("e")
        text = mantissa + (".0" if "." not in mantissa else "") + e + exponent
    return dumper.represent_scalar("tag:yaml.org,2002:float", text)


_Writer.add_representer(str, _represent_text)
_Writer.add_representer(float, _represent_float)
