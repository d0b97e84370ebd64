"""Where the signals of a compiled plan are, and the test of their numbers.

In go signals and tests as a printer meets them; out come the C expressions of signals, members of
the plan's struct, and one test for the outputs of several calls, without which a chain of 120 gains
takes 1.1 times as long::

    block_0__output(ctx, &places->fields_gain, t, plan->out_clock_time, &plan->out_gain_out);
    block_1__output(ctx, &places->fields_sum, t, plan->out_gain_out, &plan->out_sum_out);
    if (!isfinite(plan->out_gain_out + plan->out_sum_out)) {
        if (!(isfinite(plan->out_gain_out))) { ctx->at = 0; ctx->index = 0; return 1; }
        if (!(isfinite(plan->out_sum_out))) { ctx->at = 1; ctx->index = 0; return 1; }
    }
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from enum import IntEnum

from runtime.compiler import Kernel
from runtime.engine.compiled.struct import Struct
from runtime.engine.naming import Names
from runtime.plan import Call, CText, Gate, Operation, Plan, Port, Signal, Test, numbers_in


class Ending(IntEnum):
    """What a call of a plan returns.

    An output is not finite, a block failed, the solver cannot integrate (a rate of change is not
    finite, or its tolerance is not met), the run's condition to stop holds, or an algebraic loop
    has no solution.
    """

    FINISHED, NOT_FINITE, FAILED, NOT_INTEGRATED, STOPPED, UNSOLVED = range(6)


FINISHED, NOT_FINITE, FAILED, NOT_INTEGRATED, STOPPED, UNSOLVED = map(int, Ending)
FEW = 8  # numbers of an array that are tested like those of records
MANY = 12  # numbers that are tested at once: they wait in registers


class SignalText(CText):
    """Writes signals and tests.

    Parameters
    ----------
    outside : signals that something else computes, but for constants.
    """

    def __init__(
        self,
        plan: Plan,
        names: Names,
        kernels: Mapping[str, Kernel],
        outside: Collection[Port] = (),
    ) -> None:
        super().__init__("k", depth=2)
        self.plan, self.kernels = plan, kernels
        once = [call for call in plan.evaluations if call.gate.once]
        constants = {signal.key for call in once for signal in call.outputs}
        self.struct = Struct(names, constants.union(outside))
        self.calls: list[Call] = []
        self.waiting: list[tuple[int, Test]] = []

    def signal(self, signal: Signal) -> str:
        return self.struct.signal(signal)

    def operations(self, operations: Iterable[Operation]) -> None:
        super().operations(operations)
        self.tested()

    def call(self, call: Call) -> None:
        # Updates change states, and a loop that waits for a number might wait for NaN for ever.
        if not call.outputs or self.kernels[call.block].has_while:
            self.tested()
        super().call(call)
        if self.kernels[call.block].failures:
            self.put(leaves(FAILED))

    def within(self, gate: Gate) -> None:
        if gate != self.gate:
            self.tested()
        super().within(gate)

    def test(self, test: Test) -> None:
        at = len(self.calls) - 1
        while (self.calls[at].block, self.calls[at].method) != (test.block, test.method):
            at -= 1  # of a loop, the tests follow all its calls
        self.waiting.append((at, test))
        if sum(numbers_in(each.kind) for _, test in self.waiting for each in test.outputs) >= MANY:
            self.tested()

    def tested(self) -> None:
        """Test what the calls since the last test returned.

        All at once, by the sum of the numbers: one by one only where it is not finite, since the
        sum of large numbers may be infinite, too, and to tell which call it was. In ticks that
        fail, later calls get such numbers; these ticks run again under Python.
        """
        waiting, self.waiting = self.waiting, []
        numbers: list[str] = []
        exact: list[str] = []
        for at, test in waiting:
            places = [signal.key for signal in self.calls[at].outputs]
            for signal in test.outputs:
                found = f"ctx->at = {at}; ctx->index = {places.index(signal.key)};"
                wrong = f"{{ {found} return {NOT_FINITE}; }}"
                kind, name, count = signal.kind, self.signal(signal), numbers_in(signal.kind)
                if kind.form == "array" and (count > FEW or not kind.finite):
                    function = "all_finite" if kind.finite else "no_nan"
                    self.put(f"if (!{function}({name}, {count})) {wrong}")
                    continue
                own = [name] if kind.form == "scalar" else [f"{name}[{i}]" for i in range(count)]
                if not kind.finite:
                    self.put(f"if ({' || '.join(f'isnan({n})' for n in own)}) {wrong}")
                    continue
                exact.append(f"if (!({' && '.join(f'isfinite({n})' for n in own)})) {wrong}")
                numbers += own
        if numbers:
            with self.block(f"if (!isfinite({_sum(numbers)}))"):
                self.put(*exact)


def leaves(code: int) -> str:
    """The way out after a call that failed; nothing where failures jump."""
    return f"LEAVE({code});"


def _sum(numbers: Sequence[str]) -> str:
    """The sum in pairs, which a processor adds side by side."""
    if len(numbers) == 1:
        return numbers[0]
    half = (len(numbers) + 1) // 2
    first, second = _sum(numbers[:half]), _sum(numbers[half:])
    return f"{first} + ({second})" if len(numbers) > 2 else f"{first} + {second}"
