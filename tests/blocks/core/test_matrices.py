"""Linear algebra against its definition, and each function against its kernel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blocks.core import (
    FloatArray,
    dot,
    eliminate,
    function_kernel,
    kron,
    product,
    small_eliminate,
    small_product,
    solve,
    times,
    transposed,
)

seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 7)


def with_pivots(rng: np.random.Generator, n: int) -> FloatArray:
    """A regular matrix (n, n) with zeros, in which rows have to be exchanged."""
    a = rng.standard_normal((n, n))
    a[rng.random((n, n)) < 0.3] = 0.0
    return np.asarray(a + 3.0 * np.eye(n)[rng.permutation(n)])


@settings(deadline=None)
@given(seeds, st.integers(1, 12), st.integers(1, 4))
def test_solve_is_the_solution(seed: int, n: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    a, x = with_pivots(rng, n), rng.standard_normal((n, m))
    b, before = a @ x, a.copy()
    atol = 1e-13 * np.linalg.cond(a) * np.abs(x).max()
    np.testing.assert_allclose(solve(a, b), x, rtol=0.0, atol=atol)
    assert np.array_equal(a, before)
    in_place = b.copy()
    assert small_eliminate(a.copy(), in_place)
    np.testing.assert_allclose(in_place, x, rtol=0.0, atol=atol)


@pytest.mark.parametrize("elimination", [eliminate, small_eliminate])
def test_a_singular_matrix_is_told(elimination: Callable[..., bool]) -> None:
    singular = np.array([[1.0, 2.0], [2.0, 4.0]])
    assert not elimination(singular.copy(), np.eye(2))
    with pytest.raises(np.linalg.LinAlgError, match="Singular"):
        solve(singular, np.eye(2))


def test_product_is_that_of_exact_numbers() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.integers(-9, 9, (3, 7, 5)).astype(float), rng.integers(-9, 9, (5, 4)).astype(float)
    assert np.array_equal(product(a, b), a @ b)


@settings(deadline=None)
@given(seeds, sizes, sizes, sizes)
def test_kernels_are_their_functions(seed: int, m: int, k: int, n: int) -> None:
    # Small integers have exact sums and products, whatever the order.
    rng = np.random.default_rng(seed)
    a, b = rng.integers(-9, 9, (m, k)).astype(float), rng.integers(-9, 9, (k, n)).astype(float)
    assert np.array_equal(small_product(a, b), product(a, b))
    assert dot(a[0], b[:, 0]) == product(a, b)[0, 0]
    for function, given_ in ((times, (a, b[:, 0])), (kron, (a, b))):
        kernel = function_kernel(function)
        assert kernel is not None
        assert np.array_equal(kernel(*given_), function(*given_))
    assert np.array_equal(transposed(a), a.T) and transposed(a).flags.c_contiguous
