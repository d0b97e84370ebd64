"""The base of blocks that compute expressions of their inputs, and what names stand for in these.

In: the parameters ``names``, ``constants`` and ``let``, and the components that are wired to ``u``.
Out: the expressions as one function, and errors at the parameter and the item that is wrong::

    {expression: ["c*x", "c*y"], let: {c: "cos(t)"}, names: [x, y]}    ->    f(t, u, constants)
"""

from __future__ import annotations

import ast
import re
from abc import ABC
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

from blocks.core.block import Block
from blocks.core.block_state import BlockContext
from blocks.core.declarations import Input
from blocks.core.equation_settings import Constants, Definitions, Names
from blocks.core.expression_text import ExpressionError, tree_of
from blocks.core.expression_values import Written
from blocks.core.expressions import (
    Expressions,
    function_from,
    function_text,
    read_expressions,
    used_words,
)
from blocks.core.params import ParameterError, param
from blocks.core.scalar_functions import misnamed
from blocks.core.signals import Scalar, SignalForm, SignalType, Vector

# `u` other than `u[2]` or `u[0:3]`: how much it has is known once it is wired.
_WHOLE = re.compile(r"\bu\b(?!\s*\[\s*(\d+\s*:\s*)?\d+\s*\])")
_INDEX = re.compile(r"\bu\s*\[[^\]]*?(\d{1,4})\s*\]")


class Equations(Block, ABC):
    """A block whose parameters are expressions of its inputs ``u``, the time and further names."""

    inputs = Input(
        Scalar,
        variadic=True,
        spread="inputs",
        name="u",
        doc="any signals; their components in order are u[0], u[1], ...",
    )

    constants: Constants | None = param(
        None, tunable=True, doc="names with their values: {k: 2.5, A: [[0, 1], [-1, 0]]}"
    )
    names: Names | None = param(
        None, doc="names of the components of u, in order: [x, v]; p(3) is a vector"
    )
    let: Definitions | None = param(
        None, doc="names with expressions that are computed first, in order: {c: cos(x)}"
    )

    # What functions are called with; all of them names in expressions, but for the constants c.
    arguments: ClassVar[tuple[str, ...]] = ("t", "u", "c")

    def own_names(self) -> dict[str, Written]:
        """Names beside those of the parameters here: of states, of an unknown."""
        return {}

    def name_problems(
        self, variables: Mapping[str, str], states: Iterable[str] = ()
    ) -> list[tuple[str, str]]:
        """What is wrong with the names, by parameter.

        ``variables`` are names that expressions have beside u, with what they are.
        """
        known = {"u": "the inputs", **variables}
        own = {"names": self.names, "constants": self.constants, "let": self.let}
        groups = {"states": states, **own}
        taken: list[str] = []
        problems = []
        for parameter, names in groups.items():
            problems += [(parameter, text) for _, text in misnamed(names or (), known, taken)]
            taken += names or ()
        return problems

    def expected_inputs(self, texts: Iterable[str]) -> int | None:
        """The number of components in u that expressions name; None if they take it as a whole."""
        if self.names is not None:
            return self.names.size
        texts = [*texts, *(self.let.texts.values() if self.let else ())]
        if any(map(_WHOLE.search, texts)):
            return None
        return 1 + max((int(n) for text in texts for n in _INDEX.findall(text)), default=0)

    def uses_inputs(self, texts: Iterable[str]) -> bool:
        """Whether expressions name u or one of its components, through ``let`` as well."""
        words = used_words(texts, self.let.texts if self.let else {})
        return not words.isdisjoint({"u", *(self.names or ())})

    def read(self, written: Sequence[tuple[str, str]], inputs: int | Sequence[str]) -> Expressions:
        """Expressions, each with the parameter that it is written in.

        ``inputs`` are the number of components in u, or what each of them stands for.

        Raises
        ------
        ParameterError : one is not valid, at ``parameter[1]`` if there are several.
        """
        parts = [f"u[{i}]" for i in range(inputs)] if isinstance(inputs, int) else list(inputs)
        names: dict[str, Written] = {"u": parts, "t": "t", **self.own_names()}
        names |= (self.names.of(parts) if self.names else {}) | (
            self.constants.of("c") if self.constants else {}
        )
        let = self.let.texts if self.let else {}
        try:
            return read_expressions([text for _, text in written], names, let)
        except ExpressionError as error:
            if isinstance(error.place, str):
                place, text = f"let.{error.place}", let[error.place]
            else:
                place, text = written[error.place]
            short = text if len(text) <= 60 else text[:57] + "..."
            message = f"column {error.column} of '{short}': {error.message}"
            raise ParameterError([(place, message)]) from None

    def sizes_of(
        self, written: Mapping[str, Sequence[str]], inputs: int | None = None
    ) -> dict[str, int]:
        """How many components the expressions of each parameter have, all of them checked.

        Without ``inputs``, what can be said before they are known: nothing where an expression
        takes u as a whole.

        Raises
        ------
        ParameterError : one is not valid.
        """
        if inputs is None:
            inputs = self.expected_inputs(text for texts in written.values() for text in texts)
        if inputs is None:
            return {}
        read = {name: self.read(items(name, texts), inputs) for name, texts in written.items()}
        return {name: len(each.values) for name, each in read.items()}

    def width(self, parameter: str, texts: Sequence[str]) -> int:
        """The number of components of expressions, as far as it is known without wires.

        Raises
        ------
        ParameterError : one is not valid.
        """
        written = items(parameter, texts)
        expected = self.expected_inputs(texts)
        if expected is not None:
            return len(self.read(written, expected).values)
        try:  # `norm(u)` is a number whatever u is, `2*u` is not
            widths = {len(self.read(written, count).values) for count in (4, 5)}
        except ParameterError:
            return len(texts)
        return widths.pop() if len(widths) == 1 else len(texts)

    def function(
        self,
        parameter: str,
        texts: Sequence[str],
        inputs: int | Sequence[str],
        form: SignalForm | None = "array",
    ) -> Callable[..., Any]:
        """A function of :attr:`arguments` that computes expressions."""
        return self.function_of(items(parameter, texts), inputs, form)

    def function_of(
        self,
        written: Sequence[tuple[str, str]],
        inputs: int | Sequence[str],
        form: SignalForm | None = "array",
    ) -> Callable[..., Any]:
        """The same of expressions of several parameters, each with its address."""
        read = self.read(written, inputs)
        return function_from(function_text(read, self.arguments, form))

    @property
    def constant_values(self) -> tuple[float, ...]:
        """The values of the constants, as functions take them."""
        # Not empty: an empty tuple has no element type, and the function would not compile.
        return (self.constants.flat if self.constants else ()) or (0.0,)

    def input_count(self, context: BlockContext) -> int:
        """How many components are wired to ``u``.

        Raises
        ------
        ParameterError : one was removed, or there are not as many as names.
        """
        count = context.count("u")
        if self.names is not None and self.names.size != count:
            message = f"expected {count} names, one for each component of u, got "
            raise ParameterError([("names", message + str(self.names.size))])
        return count


def items(parameter: str, texts: Sequence[str]) -> list[tuple[str, str]]:
    """Expressions with their addresses: the parameter itself, or each item of its list."""
    if len(texts) == 1:
        return [(parameter, texts[0])]
    return [(f"{parameter}[{i}]", text) for i, text in enumerate(texts)]


def wrong_size(texts: Sequence[str], size: int, got: int, what: str) -> str:
    """The message for expressions that have ``got`` components in place of ``size``."""
    noun = "expression(s)" if got == len(texts) else "component(s) in all"
    return f"expected {size} {noun}, one per {what}, got {got}"


def _is_list(texts: Sequence[str]) -> bool:
    """Whether a text is a list, as [u[i] for i in range(n)]: a vector, also where n is 1."""
    if len(texts) != 1 or not texts[0].lstrip().startswith("["):
        return False
    return isinstance(tree_of(texts[0]), ast.List | ast.ListComp)


def value_type(
    kind: SignalType | None,
    width: int,
    texts: Sequence[str] = (),
    rows: tuple[tuple[str, str], ...] = (),
) -> SignalType:
    """The type of the value of some texts of so many components, where ``signal`` may state one.

    ``rows`` are names and units of the components, if they have any.
    """
    if kind is None:
        is_number = width == 1 and not _is_list(texts)
        return replace(Scalar if is_number else Vector(width), rows=rows)
    return kind.sized(width) if kind.symbol else kind


def width_of(kind: SignalType) -> int:
    """The components of a type of number, record or vector; 0 for others."""
    if kind.symbol or len(kind.shape) > 1:
        return 0
    return kind.shape[0] if kind.shape else 1
