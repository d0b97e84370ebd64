"""Options of metrics and plots, declared as a block declares its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from blocks.core.params import Param, show
from blocks.core.reading import read_params
from blocks.messages import Message


class Options:
    """A set of options; a subclass declares each with :func:`blocks.core.params.param`::

    class Level(Options):
        level: float = param(0.5, doc="what the signal is compared with")
    """

    declared: ClassVar[Mapping[str, Param]] = {}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.declared = read_params(cls)

    @classmethod
    def check(
        cls, values: Mapping[str, Any], sizes: Mapping[str, int] | None = None
    ) -> Iterator[tuple[str, str]]:
        """Everything wrong with written options, as (name, text).

        ``sizes`` are the known sizes of the symbols in the declared shapes.
        """
        known = dict(sizes or {})
        for name, declared in cls.declared.items():
            if name not in values:
                if declared.required:
                    expected = f"expected {declared.describe(known)}"
                    yield name, Message(f"missing; {expected}: {declared.doc}", "missing-value")
                continue
            written = values[name]
            try:
                value = declared.convert(written)
            except ValueError:
                value = None
            is_misshapen = isinstance(value, np.ndarray) and not declared.fits(value, known)
            if value is None or is_misshapen:
                yield name, f"expected {declared.describe(known)}, got {show(written)}"

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> dict[str, Any]:
        """Checked options as numbers and arrays, with defaults filled in."""
        return {
            name: declared.convert(values.get(name, declared.default))
            for name, declared in cls.declared.items()
            if name in values or not declared.required
        }
