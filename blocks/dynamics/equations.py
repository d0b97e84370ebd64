"""Equations of a system as expressions of its states, its inputs and the time."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from blocks.core import (
    Expression,
    ExpressionError,
    ParameterError,
    function_from,
    function_text,
    misnamed,
    read_expression,
)

PARAMETERS = ("t", "x", "u", "c")
_INDEX = re.compile(r"\bu\s*\[[^\]]*?(\d{1,3})\s*\]")


@dataclass(frozen=True)
class Equations:
    """What the names in the expressions of a system stand for.

    count : the number of states, x[0], x[1], ... states : their names, if they have any.
    constants : further names, and their values.
    """

    count: int
    states: Sequence[str]
    constants: Mapping[str, float]

    def problems(self) -> list[tuple[str, str]]:
        """What is wrong with the names, by parameter."""
        problems = []
        if self.states and len(self.states) != self.count:
            message = f"expected {self.count} name(s), one per state, got {len(self.states)}"
            problems.append(("states", message))
        variables = {"u": "the inputs"}
        problems += [("states", text) for _, text in misnamed(self.states, variables)]
        constants = misnamed(self.constants, variables, self.states)
        return [*problems, *(("constants", text) for _, text in constants)]

    def read(self, parameter: str, text: str, inputs: int) -> Expression:
        """One expression of a parameter, with so many components in u.

        Raises
        ------
        ParameterError : it is not valid.
        """
        states = [f"x[{i}]" for i in range(self.count)]
        names: dict[str, Any] = {"x": states, "u": [f"u[{i}]" for i in range(inputs)], "t": "t"}
        names |= {name: f"c[{i}]" for i, name in enumerate(self.constants)}
        names |= dict(zip(self.states, states, strict=False))
        try:
            return read_expression(text, names)
        except ExpressionError as error:
            short = text if len(text) <= 60 else text[:57] + "..."
            message = f"column {error.column} of '{short}': {error.message}"
            raise ParameterError([(parameter, message)]) from None

    def function(self, parameter: str, texts: Sequence[str], inputs: int, form: Any) -> Any:
        """A function of (t, x, u, the values of the constants)."""
        read = [self.read(parameter, text, inputs) for text in texts]
        return function_from(function_text(read, PARAMETERS, form))

    @property
    def values(self) -> tuple[float, ...]:
        """The values of the constants, as functions take them."""
        # Not empty: an empty tuple has no element type, and the function would not compile.
        return tuple(self.constants.values()) or (0.0,)

    def check(self, written: Iterable[tuple[str, str]], inputs: int | None = None) -> None:
        """Check expressions, each with its parameter; ``inputs`` are those that they name.

        Raises
        ------
        ParameterError : one is not valid.
        """
        written = list(written)
        # Before anything is wired, u has as many components as the expressions name: all else can
        # be checked, and what is missing is found once the wires are known.
        if inputs is None:
            used = [int(n) for _, text in written for n in _INDEX.findall(text)]
            inputs = 1 + max(used, default=0)
        for parameter, text in written:
            self.read(parameter, text, inputs)
