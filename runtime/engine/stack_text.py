"""The printer of a plan whose equal calls are stacks, as Python.

In go operations and stacks, out comes text. Of two ensembles that read one number each::

    stack_0_spikes = sealed(stack_0.output(t))
    a_spikes, b_spikes, = stack_0_spikes
    if not isfinite(vdot(stack_0_spikes, stack_0_spikes)):
        not_finite('a', 'output', a_spikes)
        not_finite('b', 'output', b_spikes)
    stack_0_input = array((wave_out, 0.0))
    stack_0.update(t, (stack_0_input,), (), (1.0, 1.0))

The values of all blocks are in one array, of which each has a row: where another stack reads just
these, it gets this array.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from blocks.core import Scalar, SignalType
from runtime.engine.python_text import INDENT, PythonText
from runtime.engine.python_values import absent, finite_test
from runtime.plan import ALWAYS, Argument, Gate, Port, Signal, Source, Stack, Step


class StackedText(PythonText):
    """Writes operations, and stacks of calls, line by line."""

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self.printers[Stack] = self.stack
        # Flat arrays with the values of several signals, and when they are computed.
        self.together: dict[tuple[Port | None, ...], tuple[str, Gate]] = {}

    def continues(self, before: Step | None, each: Step) -> bool:
        return not isinstance(each, Stack) and super().continues(before, each)

    def stack(self, stack: Stack) -> None:
        """Call a method of all blocks of a stack, and test what it returned."""
        given = ["t", *(self.values(stack, i) for i in range(len(stack.calls[0].arguments)))]
        text = f"stack_{stack.number}.{stack.method}({', '.join(given)})"
        if self.profiled:
            self.code("began = clock()")
        signals = [signal for call in stack.calls for signal in call.outputs]
        if not signals:
            self.code(text, stack.block)
        else:
            whole = f"stack_{stack.number}_{signals[0].port}"
            self.code(f"{whole} = sealed({text})", stack.block)
            self.code(f"{', '.join(map(self.names.of, signals))}, = {whole}")
            keys = tuple(signal.key for signal in signals)
            self.together[keys] = f"{whole}.reshape(-1)", stack.gate
        if self.profiled:
            self.code(f"spent({tuple(call.block for call in stack.calls)!r}, began)")
        if signals:
            self.code(f"if not ({finite_test({whole: signals[0].kind})}):")
        for signal in signals:
            given = [repr(signal.block), repr(stack.method), self.names.of(signal)]
            self.code(f"{INDENT}not_finite({', '.join(given)})", signal.block)

    def values(self, stack: Stack, position: int) -> str:
        """The expression of what the method gets for a port: the values of all blocks."""
        arguments = [call.arguments[position] for call in stack.calls]
        if not arguments[0].is_variadic:
            return self.column(stack, arguments, 0)
        most = max(len(argument.sources) for argument in arguments)
        columns = [self.column(stack, arguments, i) for i in range(most)]
        return f"({', '.join(columns)},)" if columns else "()"

    def column(self, stack: Stack, arguments: Sequence[Argument], term: int) -> str:
        """One value of each block: numbers as a tuple, arrays as one flat array."""
        kind, default = arguments[0].kind, arguments[0].default
        sources = [a.sources[term] if term < len(a.sources) else None for a in arguments]
        if kind.form == "scalar":
            return f"({', '.join(self.each(s, kind, default) for s in sources)},)"
        keys = tuple(_key(source) for source in sources)
        if None not in keys and keys in self.together:
            variable, gate = self.together[keys]
            if gate in (ALWAYS, stack.gate):
                return variable
        numbers = all(s is None or s.kind.form == "scalar" for s in sources)
        form = Scalar if numbers and kind.shape == (1,) else kind
        values = ", ".join(self.each(source, form, default) for source in sources)
        variable = f"stack_{stack.number}_{arguments[0].port}" + f"_{term + 1}" * (term > 0)
        self.code(f"{variable} = {'array' if form is Scalar else 'concatenate'}(({values},))")
        if None not in keys:
            self.together[keys] = variable, stack.gate
        return variable

    def each(self, source: Source | None, kind: SignalType, default: float) -> str:
        """The value of one block."""
        if source is not None:
            return self.source(source, kind)
        if kind.form == "array" and default == 0.0:
            return f"zeros[{kind.shape[0]}]"
        return absent(kind, default)


def _key(source: Source | None) -> Port | None:
    """The signal that is read as a whole."""
    if source is None or source.component or not isinstance(source.whole, Signal):
        return None
    return source.whole.key
