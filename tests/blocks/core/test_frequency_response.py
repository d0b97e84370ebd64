"""Frequency responses against closed forms, and against c (zI - A)^-1 b as it is written."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blocks.core import FloatArray, FrequencyResponse, eigenvalues
from blocks.core.frequency_response import FEW_STATES, delay_chains

W = np.geomspace(0.01, 3.0, 60)


def as_written(a: FloatArray, b: FloatArray, c: FloatArray, d: float, p: complex) -> complex:
    return complex(c @ np.linalg.solve(p * np.eye(len(a)) - a, b) + d)


def test_a_first_order_system_in_continuous_time() -> None:
    one = np.ones(1)
    got = FrequencyResponse(-np.eye(1), one, one, 0.5)(W)
    np.testing.assert_allclose(got, 0.5 + 1.0 / (1.0 + 1j * W), rtol=1e-14)


@pytest.mark.parametrize("ticks", [1, 7, 1500])
def test_a_pure_delay(ticks: int) -> None:
    b, c = np.eye(ticks)[0], np.eye(ticks)[-1]
    found = FrequencyResponse(2.0 * np.eye(ticks, k=-1), b, c, 0.0, 0.001)
    expected = 2.0 ** (ticks - 1 if ticks < 1000 else 0) * np.exp(-0.001j * ticks * W)
    if ticks < 1000:  # a gain of 2 at each step is not a number any more at 1500
        np.testing.assert_allclose(found(W), expected, rtol=1e-12)
    found = FrequencyResponse(np.eye(ticks, k=-1), b, c, 0.0, 0.001)
    np.testing.assert_allclose(found(W), np.exp(-0.001j * ticks * W), rtol=1e-12)
    assert found.delay == pytest.approx(0.001 * ticks)


def test_a_ring_of_delays_keeps_one_state() -> None:
    ring = np.roll(np.eye(5), 1, axis=0)  # x_i = x_(i-1): z^5 = 1
    chains = delay_chains(np.block([[ring, np.zeros((5, 1))], [np.eye(1, 5), 0.0]]), np.zeros(6))
    assert len(chains) == 5
    a, b, c = ring.copy(), np.eye(5)[0], np.eye(5)[2]
    got = FrequencyResponse(a, b, c, 0.0, 1.0)(W)
    z = np.exp(1j * W)
    np.testing.assert_allclose(got, z**-3 / (1.0 - z**-5), rtol=1e-12)


def test_a_pole_on_the_axis_has_no_value_and_its_neighbours_have() -> None:
    a = np.array([[0.0, 1.0], [-1.0, 0.0]])
    got = FrequencyResponse(a, np.array([0.0, 1.0]), np.array([1.0, 0.0]), 0.0)
    values = got(np.array([0.5, 1.0, 2.0]))
    np.testing.assert_allclose(values[[0, 2]], [1.0 / 0.75, -1.0 / 3.0], rtol=1e-14)
    assert not np.isfinite(values[1])


def test_many_states_with_a_delay_around_them() -> None:
    rng = np.random.default_rng(3)
    core, ticks = FEW_STATES + 15, 30
    n = core + ticks
    a = np.zeros((n, n))
    a[:core, :core] = rng.normal(size=(core, core)) * (0.6 / np.sqrt(core))
    a[core, 2] = 0.5  # the delay of a state, which is fed back, and read half way
    a[range(core + 1, n), range(core, n - 1)] = 1.0
    a[4, n - 1], a[5, core + 10] = 0.7, -0.4
    b, c = rng.normal(size=n) * (np.arange(n) < core), rng.normal(size=n)
    got = FrequencyResponse(a, b, c, 0.3, 1.0)(W)
    expected = [as_written(a, b, c, 0.3, np.exp(1j * w)) for w in W]
    np.testing.assert_allclose(got, expected, rtol=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 9), st.integers(0, 2**32 - 1), st.floats(0.1, 0.6))
def test_any_sampled_system_is_what_it_is_as_written(n: int, seed: int, share: float) -> None:
    """Sparse systems: chains, rings, states that fork, that end, and that nothing drives."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n)) * (rng.random((n, n)) < share)
    a *= 0.9 / max(0.9, np.abs(np.linalg.eigvals(a)).max())
    b, c = (rng.normal(size=n) * (rng.random(n) < 0.6) for _ in range(2))
    got = FrequencyResponse(a, b, c, 0.2, 1.0)(W)
    expected = [as_written(a, b, c, 0.2, np.exp(1j * w)) for w in W]
    np.testing.assert_allclose(got, expected, rtol=1e-8, atol=1e-9)


def test_a_delay_between_two_oscillations_has_poles_of_zero() -> None:
    turn = 0.99 * np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    a = np.eye(124, k=-1)
    a[:2, :2], a[-2:, -2:] = turn, 0.5 * turn
    found = eigenvalues(a)
    sizes = np.sort(np.abs(found))
    assert (sizes[:120] == 0.0).all()
    np.testing.assert_allclose(sizes[120:], [0.495, 0.495, 0.99, 0.99], rtol=1e-12)
