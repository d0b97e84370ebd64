"""Lag, delay and slip against closed forms, shifted signals and statistics."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blocks import Block, ParameterError
from blocks.core.signals import FloatArray, TwistValue
from blocks.vehicle.disturbances import ActuatorDelay, ActuatorLag, WheelSlip
from runtime import check_block
from tests.blocks.worlds import started

DT = 0.01


def drive(block: Block, commands: Iterable[TwistValue], seed: int = 0) -> FloatArray:
    """What comes out on each tick."""
    state = started(block, dt=DT, seed=seed)
    (evaluation,), update = block.spec.evaluations, block.spec.update
    assert update is not None
    rows = []
    for k, command in enumerate(commands):
        given_ = (command,) if evaluation.needs else ()
        rows.append(block.output(state, k * DT, *given_))  # type: ignore[attr-defined]
        block.update(state, k * DT, *((command,) if update.needs else ()))  # type: ignore[attr-defined]
    return np.array(rows)


@pytest.mark.parametrize("block", [ActuatorLag(tau=0.1), ActuatorDelay(delay=0.03), WheelSlip()])
def test_they_keep_the_rules_of_blocks(block: Block) -> None:
    check_block(block)
    assert block.spec.through == ("command", "actual")


@pytest.mark.parametrize("tau", [0.003, 0.1, 2.0])
def test_lag_answers_a_step_like_its_differential_equation(tau: float) -> None:
    found = drive(ActuatorLag(tau=tau), [(0.5, -2.0)] * 200)
    share = 1.0 - np.exp(-np.arange(200) * DT / tau)
    np.testing.assert_allclose(found, share[:, None] * [0.5, -2.0], rtol=1e-10, atol=1e-14)


twists = st.tuples(st.floats(-3, 3), st.floats(-5, 5))


@settings(deadline=None)
@given(st.lists(twists, min_size=1, max_size=40), st.integers(1, 12))
def test_delay_shifts_the_signal(commands: list[TwistValue], steps: int) -> None:
    found = drive(ActuatorDelay(delay=steps * DT, capacity=12), commands)
    expected = ([(0.0, 0.0)] * steps + commands)[: len(commands)]
    assert np.array_equal(found, expected)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"delay": 0.025}, "delay: must be a multiple of the block's step, 0.01 s: such as 0.02"),
        ({"delay": 0.001}, "delay: must be a multiple of the block's step, 0.01 s: such as 0.01"),
        ({"delay": 0.05, "capacity": 4}, "capacity: a delay of 0.05 s is 5 steps of 0.01 s, got 4"),
    ],
)
def test_delays_that_do_not_fit(parameters: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        started(ActuatorDelay(**parameters), dt=DT)


def test_delay_takes_steps_with_rounding() -> None:
    state = started(ActuatorDelay(delay=0.3), dt=0.1)
    assert state.steps == 3


def wheels(twist: FloatArray, base: float = 0.3) -> FloatArray:
    v, omega = twist.T
    return np.column_stack((v - 0.5 * base * omega, v + 0.5 * base * omega))


def test_each_wheel_loses_a_share_of_its_own() -> None:
    command = np.array([[0.4, 1.1]])
    found = drive(WheelSlip(slip=0.2, correlation_time=0.05), [(0.4, 1.1)] * 2000)
    share = 1.0 - wheels(found) / wheels(command)
    assert share.min() > 0.0
    assert share.max() < 0.2
    # U(0, 0.2), with about 2000 * dt / (2 tau) = 200 independent draws.
    assert share.mean(axis=0) == pytest.approx([0.1, 0.1], abs=4 * 0.2 / math.sqrt(12 * 200))
    assert abs(np.corrcoef(share.T)[0, 1]) < 4 / math.sqrt(200)


def test_shares_are_forgotten_exponentially() -> None:
    tau = 0.05
    found = drive(WheelSlip(slip=0.2, correlation_time=tau), [(1.0, 0.0)] * 20000, seed=3)
    share = wheels(found) - wheels(found).mean(axis=0)
    for lag in (1, 5, 10):
        correlation = np.mean(share[lag:] * share[:-lag]) / np.mean(share**2)
        assert correlation == pytest.approx(math.exp(-lag * DT / tau), abs=0.05)


def test_without_slip_nothing_changes() -> None:
    commands = [(0.3, 0.7), (-1.0, 0.2), (0.0, -3.0)]
    np.testing.assert_allclose(drive(WheelSlip(slip=0.0), commands), commands, atol=1e-15)
    assert np.abs(drive(WheelSlip(slip=1.0), commands)).max() > 0.0
