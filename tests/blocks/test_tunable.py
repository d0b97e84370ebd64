"""Parameters that may change while a run goes on: what follows from them is no memory, and neither
the plan nor the compiled text depends on their values.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from blocks import (
    MPC,
    PID,
    Block,
    BlockState,
    Constant,
    Decoder,
    Delay,
    Gain,
    LinearMPC,
    ParameterError,
    Scalar,
    UnitDelay,
)
from blocks.core import retune, started
from blocks.library.registry import BUILTIN
from runtime.checking.bench import Bench
from runtime.checking.check import context_for
from runtime.compiler import NotCompilableError, calls_of, make_kernel
from runtime.graph.numbers import structure
from tests.runtime.engine.test_compiled_blocks import CASES, Case

TICKS = 12
FACTORS = (1.25, 0.8, 1.01, 0.5, 2.0)
# The value of the next tick is drawn already: the parameter counts from the draw after it.
DRAWN = {
    *(("WhiteNoise", "value"), ("PinkNoise", "value"), ("PinkNoise", "parts")),
    *(("PoseNoise", "noise"), ("WheelSlip", "share"), ("Lidar", "noise"), ("Lidar", "lost")),
}
# Computed once, or called from Python by the compiled engine.
MODEL = {"A": [[1.0, 0.1], [0.0, 1.0]], "B": [[0.0], [0.1]], "discrete": True}
OTHERS = {
    "Constant": [Case(Constant(value=[1.0, 2.0]))],
    "MPC": [Case(MPC())],
    "LinearMPC": [Case(LinearMPC(Q=[1.0, 1.0], R=[1.0], **MODEL))],
}
ALL = {**CASES, **OTHERS}


def tunable(name: str) -> set[str]:
    """The tunable parameters of a block, those of its settings included."""
    declared = BUILTIN[name].spec.params
    paths = set(declared)
    for case in ALL.get(name, ()):
        for key in declared:
            inner = getattr(case.block.value(key), "declared", {})
            paths |= {f"{key}.{each}" for each in inner if case.block.is_tunable(f"{key}.{each}")}
    return {p for p in paths if "." in p or declared[p].tunable}


NAMES = [
    pytest.param(name, parameter, id=f"{name}.{parameter}")
    for name in BUILTIN
    for parameter in sorted(tunable(name))
]


def others(value: Any) -> Iterator[Any]:
    """Other values of the same kind and shape, and numbers in place of none or of infinity."""
    if value is None:
        yield from (2.0, [0.3, 0.4])
    elif hasattr(value, "values"):
        for factor in FACTORS:
            yield {key: (factor * np.asarray(item)).tolist() for key, item in value.values.items()}
    elif not np.isfinite(value).all():
        yield np.copysign(1e3, value)[()]
    else:
        for factor in FACTORS:
            yield value * factor if np.any(value) else value + factor


def pairs(name: str, parameter: str) -> Iterator[tuple[Case, Block]]:
    """Cases of a block, each with a block in which one parameter has another value."""
    head, _, inner = parameter.partition(".")
    for case in ALL[name]:
        given = {key: case.block.value(key) for key in case.block.spec.params}
        setting = given[head]
        if inner and not case.block.is_tunable(parameter):
            continue
        for value in others(vars(setting)[inner] if inner else setting):
            changed = type(setting)(**{**vars(setting), inner: value}) if inner else value
            with contextlib.suppress(ParameterError):
                other = type(case.block)(**{**given, head: changed})
                case_context(case, other)
                if repr(other.value(head)) != repr(setting):
                    yield case, other
                    break


def case_context(case: Case, block: Block) -> Any:
    return context_for(block, case.types, case.dt, case.world)


@pytest.mark.parametrize(("name", "parameter"), NAMES)
def test_a_tunable_parameter_changes_no_memory_and_no_plan(name: str, parameter: str) -> None:
    checked = 0
    for case, other in pairs(name, parameter):
        context = case_context(case, case.block)
        assert structure(other, context) == structure(case.block, context)
        first, second = started(case.block, context), started(other, context)
        for key, declared in case.block.spec.states.items():
            if not declared.cached and (name, key) not in DRAWN:
                np.testing.assert_array_equal(getattr(first, key), getattr(second, key), key)
        retune(other, first)
        assert text_of(first) == text_of(second) or any(block == name for block, _ in DRAWN)
        checked += 1
    assert checked


def text_of(state: BlockState) -> dict[str, str]:
    """Attributes that ``start`` has added, as texts."""
    plain = (float, int, tuple, np.ndarray)
    return {key: repr(each) for key, each in vars(state).items() if isinstance(each, plain)}


@pytest.mark.parametrize("name", dict.fromkeys(each.values[0] for each in NAMES))
def test_parameters_that_are_set_to_what_they_are_change_nothing(name: str) -> None:
    class Retuned(Bench):
        def _resumed(self, old: BlockState, seed: int) -> BlockState:
            retune(self.block, old)
            return old

    case = ALL[name][0]
    args = (case.block, case_context(case, case.block), TICKS)
    assert list(Retuned(*args).run(1, resumed=True)) == list(Bench(*args).run(1))


@pytest.mark.parametrize(("name", "parameter"), NAMES)
def test_the_compiled_text_holds_for_other_values(name: str, parameter: str) -> None:
    for case, other in pairs(name, parameter):
        context, block = case_context(case, case.block), case.block
        state, guards = started(block, context), len(block.crossings(context))
        terms = {port: sum(flags) for port, flags in context.terms.items()}
        rates = [getattr(state, each).shape for each in block.spec.continuous]
        calls = calls_of(block.spec, block.evaluations, guards)
        if not calls:
            continue
        try:
            kernel = make_kernel(
                block, state, terms, context.types, calls, rates=rates, guards=guards
            )
        except NotCompilableError:
            continue
        retune(other, state)
        assert kernel.fitting(other, state) is not None


def test_memory_stays_and_what_follows_changes() -> None:
    context = context_for(PID(), {"error": Scalar}, 0.01)
    state = started(PID(kp=1.0, ki=2.0), context)
    state.integral[...] = 7.0
    integral = state.integral
    retune(PID(kp=3.0, ki=2.0), state)
    assert (state.kp, float(state.integral), state.i[0]) == (3.0, 7.0, 7.0)
    assert state.integral is integral


def test_a_block_that_does_not_start_leaves_the_state_as_it_was() -> None:
    class Broken(UnitDelay):
        def start(self, state: BlockState) -> None:
            state.memory[...] = 5.0
            state.extra = 1
            raise ZeroDivisionError

    context = context_for(UnitDelay(), {"input": Scalar}, 0.01)
    state = started(UnitDelay(initial=3.0), context)
    state.rng.random()
    before, drawn = dict(vars(state)), state.rng.bit_generator.state
    with pytest.raises(ZeroDivisionError):
        retune(Broken(), state)
    assert vars(state) == before and float(state.memory) == 3.0
    assert state.rng.bit_generator.state == drawn


def test_a_block_of_another_shape_is_refused() -> None:
    context = context_for(Delay(delay=0.02), {"input": Scalar}, 0.01)
    state = started(Delay(delay=0.02), context)
    with pytest.raises(ValueError, match="state 'ring' would have the shape"):
        retune(Delay(delay=0.05), state)


def test_a_declaration_says_so() -> None:
    assert Gain(gain=2.0).is_tunable("gain") and Gain(gain=[2.0, 1.0]).is_tunable("gain[1]")
    assert not UnitDelay().is_tunable("initial") and not UnitDelay().is_tunable("initail")
    assert Decoder(learning={"rule": "pes"}).is_tunable("learning.learning_rate")
    for path in ("learning", "learning.tau", "points"):
        assert not Decoder(learning={"rule": "pes"}).is_tunable(path)
    assert not Decoder(learning={"rule": "rls"}).is_tunable("learning.learning_rate")
