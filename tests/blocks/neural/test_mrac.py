"""Two weights in an ensemble's place: the law, and what it learns of a linear disturbance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, solve_ivp

from blocks import MRAC, AdaptiveBias, BlockContext, BlockState, FloatArray, Vector
from tests.blocks.neural.test_bias import DT, T, output

TYPES = {"input": Vector(1), "error": Vector(1), "output": Vector(1)}


def test_without_input_it_is_the_integrator() -> None:
    parameters = {"learning_rate": 1e-3, "leak": 0.7, "limit": 0.4}
    np.testing.assert_allclose(output(MRAC(**parameters)), output(AdaptiveBias(**parameters)))


def test_the_input_has_a_weight_of_its_own() -> None:
    """s = 0.6 (1 - exp(-t / tau)), b' = -g e, w' = -g e s; the output is b + w s."""
    got = output(MRAC(learning_rate=0.7, power=1.0, tau_syn=0.1), input=0.6, error=-2.0)
    s = -0.6 * np.expm1(-T / 0.1)
    expected = 1.4 * (T + s * cumulative_trapezoid(s, T, initial=0.0))
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-3)


def test_the_modification_by_the_error_levels_it_off() -> None:
    """b' = -g e - nu |e| b has its equilibrium at -g sign(e) / nu, whatever the error is."""
    for error in (-2.0, 0.5):
        block = MRAC(learning_rate=0.7, power=1.0, e_leak=20.0)
        rate = 20.0 * abs(error)
        level = -math.copysign(0.7 / 20.0, error)
        np.testing.assert_allclose(
            output(block, error=error), -level * np.expm1(-rate * T), rtol=0.0, atol=1e-3
        )


def started(block: MRAC) -> BlockState:
    arrays = {"bias": np.zeros(1), "weights": np.zeros((1, 1)), "regressor": np.zeros(1)}
    state = BlockState(BlockContext(DT, TYPES, {}), np.random.SeedSequence(0), arrays)
    block.start(state)
    return state


@pytest.mark.slow
def test_it_identifies_a_loss_and_a_bias() -> None:
    """e' = -e + u_a + 0.3 + 0.5 sin t: the weights end at -0.3 and -0.5, as the equations say."""
    block = MRAC(learning_rate=4.0, power=1.0, tau_syn=DT)
    state, error, found = started(block), 0.0, []
    for k in range(40_000):
        u = math.sin(k * DT)
        found.append((error, state.bias[0], state.weights[0, 0]))
        added = block.output(state, 0.0)[0] + 0.3 + 0.5 * u
        block.update(state, 0.0, np.array([u]), np.array([error]), 1.0)
        error += DT * (added - error)

    def law(t: float, z: FloatArray) -> list[float]:
        s = math.sin(t)
        return [-z[0] + z[1] + z[2] * s + 0.3 + 0.5 * s, -4.0 * z[0], -4.0 * z[0] * s]

    times = DT * np.arange(0, 40_000, 100)
    expected = solve_ivp(law, (0.0, 40.0), [0.0, 0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(np.array(found[::100]).T, expected.y, rtol=0.0, atol=5e-3)
    assert found[-1][1:] == pytest.approx((-0.3, -0.5), abs=2e-2)
