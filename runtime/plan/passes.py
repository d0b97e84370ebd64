"""Passes over operations: what they use, and what two memories exchange around them.

In go operations, out come operations or names; nothing is printed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from operator import or_

from runtime.plan.coupling import Columns
from runtime.plan.operations import (
    Call,
    Integrate,
    Load,
    Operation,
    Record,
    Solve,
    Stop,
    Store,
    Test,
    Zero,
    calls_in,
)
from runtime.plan.values import Port, Row, Signal


def signals_of(operations: Iterable[Operation]) -> set[Port]:
    """The signals that operations read or write."""
    found: set[Port] = set()
    for each in operations:
        values: list[object] = list(each.gate.switches)
        if isinstance(each, (Call, Solve)):
            values += [*each.reads, *each.outputs]
        elif isinstance(each, (Test, Zero)):
            values += each.outputs
        elif isinstance(each, (Record, Stop)):
            values.append(each.source.whole)
        elif isinstance(each, (Load, Store)):
            values += each.signals
        elif isinstance(each, Integrate):
            found |= signals_of(each.between)
        found |= {value.key for value in values if isinstance(value, Signal)}
    return found


def exchanged(operations: Sequence[Operation]) -> list[Operation]:
    """Operations that Python does, with what it takes from compiled code and hands back.

    ``call b.out = b.output(t, a.out)`` becomes::

        load      a.out
        call      b.out = b.output(t, a.out)
        store     b.out
    """
    loads: list[Signal] = []
    rate = operations[0].gate.rate
    done: list[Operation] = []
    for each in operations:
        if isinstance(each, Integrate):
            calls = list(calls_in(each.between))
            stops = [c.guards.source.whole for c in each.crossings if isinstance(c.guards, Stop)]
            loads += [whole for whole in stops if isinstance(whole, Signal)]
            stage, watch, after = map(_stored, (each.stage, each.watch, each.after))
            done.append(replace(each, stage=stage, watch=watch, after=after))
        else:
            calls = list(calls_in([each]))
            done.append(each)
        for call in calls:
            # A call that a switch leaves out stores the outputs as they were.
            before = call.outputs if call.gate.switches else ()
            loads += [*call.reads, *call.gate.switches, *before]
    first = operations[0]
    taken = Load(first.block, tuple(dict.fromkeys(loads)), rate)
    return [taken, *(done if isinstance(first, Integrate) else _stored(done))]


def _stored(operations: Sequence[Operation]) -> tuple[Operation, ...]:
    """Operations, with the outputs of each call stored after its tests."""
    done: list[Operation] = []
    waiting: list[Store] = []
    for each in operations:
        if isinstance(each, (Call, Solve)):
            done += waiting
            waiting = [Store(each.block, each.outputs, each.gate.rate)]
        done.append(each)
    return (*done, *waiting)


def coupled(
    row: Row, stage: Iterable[Operation], own: Mapping[str, Sequence[Collection[int]] | None]
) -> list[Columns]:
    """For each continuous state the columns of those that its rate of change depends on.

    Parameters
    ----------
    stage : the operations that compute all rates, in order.
    own : by block, what ``Block.couplings`` says of those that have continuous states.
    """
    whole = {name: _range(slots[0].start, slots[-1].stop) for name, slots in row.by_block.items()}
    # What no operation of the stage computes holds its value there, and depends on nothing.
    signals: dict[Port, Columns] = {}
    rates = [0] * row.size
    for call in stage:
        if isinstance(call, Solve):
            # Each depends on all that any of them reads.
            of = [signals.get(signal.key, 0) for signal in call.reads]
            of += [whole.get(block, 0) for block in call.blocks]
            signals |= dict.fromkeys((s.key for s in call.outputs), reduce(or_, of, 0))
        if not isinstance(call, Call):
            continue
        read = 0
        for signal in call.reads:
            read |= signals.get(signal.key, 0)
        for signal in call.outputs:
            signals[signal.key] = read | whole.get(call.block, 0)
        for slot in call.rates:
            first = row.of(call.block)[0].start
            couplings = own.get(call.block)
            for r in range(slot.start, slot.stop):
                named = None if couplings is None else couplings[r - first]
                direct = whole[call.block]
                if named is not None:
                    direct = sum(1 << (first + c) for c in set(named))
                rates[r] |= read | direct
    return rates


def _range(start: int, stop: int) -> Columns:
    return (1 << stop) - (1 << start)
