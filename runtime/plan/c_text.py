"""What printers of a plan as C share: gates as braces, calls with their arguments.

In go operations, out come statements. How signals, functions and states are called is up to the
printer. ``call b.out: Scalar = b.output(t, a.out.x)  [every 10]`` becomes, for the engine::

    if (k % 10 == 0) {
        b_output(ctx, plan->fields_b, t, plan->out_a_out[0], &plan->out_b_out);
    }
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from blocks.core import SignalType
from runtime.network import first_column
from runtime.plan.operations import ALWAYS, Call, Gate, Operation, Restore, Test, Zero
from runtime.plan.values import Argument, Signal, Source


def numbers_in(kind: SignalType) -> int:
    """How many numbers a signal has."""
    if kind.form == "array":
        return math.prod(kind.shape)
    return 1 if kind.form == "scalar" else len(kind.components)


class CText(ABC):
    """Writes operations as statements.

    Parameters
    ----------
    tick : the number of the tick, as an expression.
    depth : of the first statements.
    """

    def __init__(self, tick: str, depth: int) -> None:
        self.tick, self.depth = tick, depth
        self.lines: list[str] = []
        self.gate = ALWAYS
        self.printers: dict[type[Any], Callable[[Any], None]] = {
            Call: self.call,
            Test: self.test,
            Zero: self.zero,
            Restore: self.restore,
        }

    @abstractmethod
    def signal(self, signal: Signal) -> str:
        """A signal: a number, or an array."""

    @abstractmethod
    def absent(self, argument: Argument) -> list[str]:
        """The arguments of an open input."""

    @abstractmethod
    def sizes(self, kind: SignalType) -> list[str]:
        """The sizes that follow the address of a signal."""

    @abstractmethod
    def function(self, call: Call) -> tuple[str, list[str]]:
        """The function of a method, and its first arguments."""

    @abstractmethod
    def test(self, test: Test) -> None:
        """Leave if what a call returned is not finite."""

    @abstractmethod
    def zero(self, zero: Zero) -> None:
        """Set numbers to zero."""

    @abstractmethod
    def restore(self, restore: Restore) -> None:
        """Set states back."""

    def put(self, *lines: str) -> None:
        self.lines += ["    " * self.depth + line for line in lines]

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Statements in braces."""
        self.put(f"{head} {{".lstrip())
        self.depth += 1
        yield
        self.depth -= 1
        self.put("}")

    # Gates

    def operations(self, operations: Iterable[Operation]) -> None:
        """Write operations in order, each under its gate; those done once are left out."""
        for each in operations:
            if not each.gate.once:
                self.within(each.gate)
                self.printers[type(each)](each)
        self.within(ALWAYS)

    def within(self, gate: Gate) -> None:
        """Close the braces of the gate so far, and open those of the next one."""
        if gate == self.gate:
            return
        if self.gate.switches:
            self.close()
        if gate.rate != self.gate.rate:
            if self.gate.every > 1:
                self.close()
            if gate.every > 1:
                self.open(gate.due(self.tick).format("||"))
        if gate.switches:
            on = " && ".join(f"{self.signal(switch)} != 0.0" for switch in gate.switches)
            self.open(f"!({on})" if gate.is_off else on)
        self.gate = gate

    def open(self, condition: str) -> None:
        self.put(f"if ({condition}) {{")
        self.depth += 1

    def close(self) -> None:
        self.depth -= 1
        self.put("}")

    # Calls

    def call(self, call: Call) -> None:
        """Call a method."""
        function, given = self.function(call)
        given += ["t"] * call.takes_time + ["(double)which"] * call.takes_which
        given += [text for argument in call.arguments for text in self.argument(argument)]
        for signal in call.outputs:
            given += [self.address(Source(signal)), *self.sizes(signal.kind)]
        self.put(f"{function}({', '.join([*given, *self.rates(call)])});")

    def rates(self, call: Call) -> list[str]:
        """Where a derivative writes; an export has none."""
        return []

    def argument(self, argument: Argument) -> list[str]:
        """What a method gets: a number for a scalar, otherwise an address with its sizes."""
        if not (argument.sources or argument.is_variadic):
            return self.absent(argument)
        if argument.kind.form == "scalar":
            return [self.number(source) for source in argument.sources]
        sizes, given = self.sizes(argument.kind), []
        for source in argument.sources:
            # One number that counts for all comes as a vector of one.
            own = [str(numbers_in(source.kind))] if argument.fills else sizes
            given += [self.address(source), *own]
        return given

    def number(self, source: Source) -> str:
        """A number of a signal."""
        signal = _signal(source)
        if signal.kind.form == "scalar":
            return self.signal(signal)
        return f"{self.signal(signal)}[{first_column(signal.kind, source.component)}]"

    def address(self, source: Source) -> str:
        """The address of a signal, or of the first number of a component."""
        signal = _signal(source)
        text = self.signal(signal)
        if signal.kind.form == "scalar":
            return f"&{text}"
        first = first_column(signal.kind, source.component)
        return f"{text} + {first}" if first else text


def _signal(source: Source) -> Signal:
    if not isinstance(source.whole, Signal):
        raise TypeError(f"'{source}' is a state")
    return source.whole
