"""A block's methods as plain functions: the text that is compiled.

``self.x`` and ``state.x`` become entries of one tuple ``b`` that goes along as the first argument;
functions of the block's modules that the methods call come along as functions of the same text.
Where a method has a kernel (:mod:`blocks.kernels`) that holds for the block's class, the kernel is
taken: the same arithmetic as loops, which compile and run faster than array expressions do.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.block import Block, BlockState
from blocks.kernels import function_kernel, kernel_for
from runtime.compiled.writing import NotCompilableError, Writer, plain

Attribute = tuple[str, str]
HEADER = """from __future__ import annotations

import math

import numpy as np
from numba import njit

from blocks.arithmetic import added, scaled
from runtime.compiled.primitives import remainder
"""


@dataclass(frozen=True)
class Translated:
    """A block as compiled text.

    text : a Python module with one function for each of ``methods``.
    entries : what the first argument of these functions holds, as ("self" or "state", attribute).
    constants : attributes that stand in the text as they were, and what they were.
    arrays : the state's float arrays among the entries, each as the subscripts that lead to it.
    """

    text: str
    methods: dict[str, str]
    entries: tuple[Attribute, ...]
    constants: dict[Attribute, Any]
    arrays: tuple[str, ...] = ()

    def fields(self, made: Block, state: BlockState) -> tuple[Any, ...]:
        """The first argument of the functions, for a block and its state."""
        of = {"self": made, "state": state}
        return tuple(plain(getattr(of[o], name), f"{o}.{name}") for o, name in self.entries)

    def fits(self, made: Block, state: BlockState) -> bool:
        """Whether the text's constants are those of this block and state."""
        of = {"self": made, "state": state}
        return all(getattr(of[o], name) == value for (o, name), value in self.constants.items())


def translate(made: Block, state: BlockState, terms: dict[str, int], safe: bool) -> Translated:
    """Write all methods that the plan calls of a block.

    Parameters
    ----------
    made, state : the block, and its state after ``start``.
    terms : how many wires each input that takes many has.
    safe : look at every index while running, as it must be for text that no test has seen.

    Raises
    ------
    NotCompilableError : naming what stands in the way.
    """
    translator = Translator(made, state, terms)
    spec = type(made).spec
    wanted = [evaluation.method for evaluation in spec.evaluations]
    wanted += [spec.update.method] if spec.update else []
    methods = {name: translator.method(name) for name in wanted}
    options = "error_model='python', cache=True" + (", boundscheck=True" if safe else "")
    # Functions that only compiled text calls need no way in from Python.
    inner = options + ", no_cpython_wrapper=True, no_cfunc_wrapper=True"
    functions = [
        f"@njit({options if name in methods.values() else inner})\n{text}"
        for name, text in translator.functions.items()
    ]
    text = "\n\n".join([HEADER, *functions]) + "\n"
    entries = tuple(translator.attributes.values())
    arrays = tuple(
        at
        for i, (key, (owner, _)) in enumerate(translator.attributes.items())
        if owner == "state"
        for at in float_arrays(translator.fields[key], f"[{i}]")
    )
    return Translated(text, methods, entries, translator.constants, arrays)


def float_arrays(value: Any, at: str) -> Iterator[str]:
    """Where in a field, itself at ``at``, float arrays are."""
    if isinstance(value, tuple):
        for i, part in enumerate(value):
            yield from float_arrays(part, f"{at}[{i}]")
    elif isinstance(value, np.ndarray) and value.dtype == np.float64:
        yield at


class Translator:
    """Collects the functions and fields of one block."""

    def __init__(self, made: Block, state: BlockState, terms: dict[str, int]) -> None:
        self.made, self.state, self.terms = made, state, terms
        self.fields: dict[str, Any] = {}
        self.attributes: dict[str, Attribute] = {}
        self.constants: dict[Attribute, Any] = {}
        self.functions: dict[str, str] = {}
        self.names: dict[Any, str] = {}

    def method(self, name: str) -> str:
        """The function that a method becomes, written if it was not yet."""
        cls = type(self.made)
        method = getattr(cls, name)
        if isinstance(method, types.FunctionType):
            method = kernel_for(cls, method, vars(self.state)) or method
        return self.function(method, bound=True)

    def function(self, function: Callable[..., Any], bound: bool = False) -> str:
        """A name for a function in the text; writes it, and first what it calls."""
        if isinstance(function, types.FunctionType) and not bound:
            function = function_kernel(function) or function
        if function in self.names:
            return self.names[function]
        if not isinstance(function, types.FunctionType) or function.__closure__:
            raise NotCompilableError(f"'{getattr(function, '__name__', function)}' is no function")
        name = function.__name__
        while name in self.names.values():
            name += "_"
        self.names[function] = name
        writer = Writer(self, function, bound)
        self.functions[name] = ""  # keeps its place, so that recursion ends
        text = writer.written(name)
        del self.functions[name]
        self.functions[name] = text
        return name

    def field(self, owner: str, name: str, value: Any) -> str:
        """The local name of an entry of ``b``."""
        key = f"{owner}_{name}"
        if key not in self.fields:
            self.fields[key] = plain(value, f"{owner}.{name}")
            self.attributes[key] = (owner, name)
        return key
