"""The linear algebra of the implicit solver: against NumPy's, and both forms against each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.engine.rosenbrock import (
    SPARE,
    factor,
    factor_loops,
    implicit,
    implicit_loops,
    solve,
    solve_loops,
)
from runtime.engine.solvers import method_of


def banded(n: int, band: int, seed: int) -> np.ndarray:
    """A random matrix without entries further than ``band`` from the diagonal."""
    matrix = np.random.default_rng(seed).normal(size=(n, n))
    r, c = np.indices((n, n))
    return np.where(abs(r - c) <= band, matrix, 0.0)


def stored(matrix: np.ndarray) -> np.ndarray:
    """The slopes of a step whose matrix M is this one: its columns are rows 1 to n."""
    n = len(matrix)
    slopes = np.zeros((method_of("rodas4", n).slope_rows, n))
    slopes[1 : n + 1] = matrix.T
    return slopes


@given(st.integers(1, 40), st.integers(0, 40), st.integers(0, 2**32))
def test_both_forms_solve_what_numpy_solves(n: int, band: int, seed: int) -> None:
    matrix, right = banded(n, band, seed), np.random.default_rng(seed + 1).normal(size=n)
    forms = []
    for factored, solved in ((factor, solve), (factor_loops, solve_loops)):
        slopes, x = stored(matrix), right.copy()
        rows = len(slopes) - SPARE
        factored(slopes, rows)
        solved(slopes, rows, x)
        forms.append(x)
    assert np.array_equal(*forms)
    condition = np.linalg.cond(matrix)
    if condition < 1e8:
        expected = np.linalg.solve(matrix, right)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(forms[0], expected, rtol=0.0, atol=1e-13 * condition * scale)


@pytest.mark.parametrize("n", [1, 3, 12])
def test_both_forms_take_the_same_step(n: int) -> None:
    # x' = A x + sin(9 t), a full matrix; every stage of one step in each form.
    system, method = np.random.default_rng(n).normal(size=(n, n)), method_of("rodas4", n)
    ends = []
    for form in (implicit, implicit_loops):
        start = np.linspace(1.0, 2.0, n)
        states, slopes = start.copy(), np.zeros((method.slope_rows, n))
        for stage in range(method.stages):
            slopes[stage] = system @ states + np.sin(9.0 * 0.1 * method.nodes[stage])
            form(states, start, slopes, method.table, stage, 0.1)
        ends.append((states, slopes[method.stages - 1]))
    assert np.array_equal(ends[0][0], ends[1][0])
    assert np.array_equal(ends[0][1], ends[1][1])


def test_a_step_with_a_singular_matrix_is_rejected_and_not_an_error() -> None:
    slopes, right = stored(np.zeros((2, 2))), np.ones(2)
    rows = len(slopes) - SPARE
    factor(slopes, rows)
    solve(slopes, rows, right)
    assert np.all(np.abs(right) > 1e20)
