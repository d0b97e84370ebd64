"""One compiled block without a plan: its methods as functions of Python values."""

from __future__ import annotations

import builtins
import ctypes
from dataclasses import replace
from typing import Any

import numpy as np

from blocks import Block, BlockState, SignalType
from runtime.checking.check import context_for
from runtime.compiler import PROJECT, make_kernel, written
from runtime.engine.compiled.memory import Context, Words
from runtime.toolchain import TranslationUnit, build

# Calls a method so that a failure returns here.
CALLER = """
#include <setjmp.h>
#include <stdint.h>
int64_t guarded(void (*method)(void *, void *, void **), void *ctx, void *self, void **values);
int64_t guarded(void (*method)(void *, void *, void **), void *ctx, void *self, void **values)
{
    jmp_buf resume;
    *(void **)ctx = &resume;
    if (setjmp(resume)) return 1;
    method(ctx, self, values);
    return 0;
}
"""


class CompiledBlock:
    """The compiled methods of a block.

    Parameters
    ----------
    made, state : the block, and its state after ``start``.
    terms : the number of wires of each variadic input.
    checked : check every index that may be outside of its array.
    """

    def __init__(
        self, made: Block, state: BlockState, terms: dict[str, int], checked: bool = False
    ) -> None:
        spec = type(made).spec
        given = {n: k for n, k in state.context.types.items() if n in spec.inputs}
        context = context_for(made, given, state.context.dt, state.context.world)
        self.terms, self.kinds = terms, dict(context.types)
        calls = [
            replace(each, needs=tuple(port for port in each.needs if port not in made.indirect))
            for each in spec.evaluations
        ]
        calls += [each for each in (spec.update, spec.derivative) if each is not None]
        calls += [PROJECT] if spec.projects else []
        self.calls = {call.method: call for call in calls}
        self.rates = [getattr(state, name).shape for name in spec.continuous]
        self.kernel = make_kernel(made, state, terms, self.kinds, calls, checked, self.rates)
        adapters = "\n".join(map(self._adapter, self.calls))
        unit = self.kernel.unit
        text = f"{unit.text}\n{CALLER}\n{adapters}"
        self.library = build([TranslationUnit(unit.name, text, unit.level)]).functions
        self.memory = Context()
        self.fields(made, state)

    def fields(self, made: Block, state: BlockState) -> None:
        """Use the parameters and states of another run of the block."""
        self.words = Words(len(self.kernel.words))
        self.words.fill(self.kernel.fields(made, state))

    def _inputs(self, method: str) -> list[SignalType]:
        """The types of a method's arguments, each wire on its own."""
        inputs = [[self.kinds[p]] * self.terms.get(p, 1) for p in self.calls[method].needs]
        return [kind for each in inputs for kind in each]

    def _shapes(self, method: str) -> list[tuple[int, ...]]:
        """The shapes of what a method returns."""
        if method == "derivative":
            return self.rates
        kinds = [self.kinds[port] for port in self.calls[method].outputs]
        return [k.shape if k.form == "array" else (len(k.components) or 1,) for k in kinds]

    def _adapter(self, method: str) -> str:
        """A C function that passes pointers to values on to a method."""
        taken, made = self._inputs(method), self._shapes(method)
        shapes = [(1,), *[k.shape if k.form == "array" else () for k in taken], *made]
        given: list[str] = []
        for i, shape in enumerate(shapes[1:], 1):
            number = i <= len(taken) and taken[i - 1].form == "scalar"
            given.append(f"{'*' if number else ''}(double *)v[{i}]")
            known = enumerate(written(shape))
            table = f"((int64_t *)v[{len(shapes) + i}])"
            given += [f"{table}[{axis}]" for axis, size in known if size is None]
        time = [] if method == "project" else ["*(double *)v[0]"]
        arguments = ", ".join(["ctx", "self", *time, *given])
        head = f"void call_{method}(void *ctx, void *self, void **v)"
        return f"{head};\n{head}\n{{\n    {self.kernel.symbols[method]}({arguments});\n}}\n"

    def call(self, method: str, t: float, *arguments: Any) -> Any:
        """Call a method; returns its outputs as Python values."""
        call = self.calls[method]
        flat: list[Any] = []
        for port, argument in zip(call.needs, arguments, strict=True):
            flat += argument if port in self.terms else [argument]
        arrays = [np.array(v, dtype=float) for v in (t, *flat)]
        outputs = [np.full(shape, np.nan) for shape in self._shapes(method)]
        values = [*arrays, *outputs]
        shapes = [np.array(value.shape, dtype=np.int64) for value in values]
        pointers = [a.ctypes.data for a in (*values, *shapes)]
        table = (ctypes.c_void_p * len(pointers))(*pointers)
        method_ = getattr(self.library, f"call_{method}")
        self.memory.ints[1] = -1
        addresses = [ctypes.c_void_p(w.address) for w in (self.memory, self.words)]
        if self.library.guarded(method_, *addresses, table):
            kind, message, file, line = self.kernel.failures[self.memory.failure]
            raise getattr(builtins, kind)(f"{message} ({file}:{line})")
        found: list[Any] = list(outputs)
        if method != "derivative":
            found = [_python(self.kinds[p], v) for p, v in zip(call.outputs, outputs, strict=True)]
        return found[0] if len(found) == 1 else tuple(found)


def _python(kind: SignalType, value: np.ndarray) -> Any:
    if kind.form == "array":
        return value
    return tuple(value.tolist()) if kind.form == "record" else float(value[0])
