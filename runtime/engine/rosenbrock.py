"""The stages of a linearly implicit method (Rosenbrock), for stiff systems.

In go the slopes of n states that the plan computes stage by stage; out come the states at which it
computes the next ones. A step of n = 2 states, by stage:

    0        f(x)                          the slope at the start of the step
    1, 2     f(x + d e_1), f(x + d e_2)    the Jacobian J, one column each, by differences
    3        f(x, t + d)                   the derivative by time; M = 1/(gamma h) - J is factored
    3 to 8   M k_i = f_i + ...             six increments with the same M

M is factored once per step, in place of J, and only within its band: neighbours in a diffusion
make it tridiagonal, which costs n operations where a full matrix costs n^3. The band is found in
the numbers of each step, since an entry can be zero at one time only.
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import FloatArray

GAMMA = 0.25
# The share of the step after which the derivative by time is estimated.
SHIFT = 1e-5
# The rounding of a float64, of which the root is the best step of a difference.
DIFFERENCE = 2.220446049250313e-16
# Rows of the slopes below those of the stages: which rows of M were exchanged, and its band.
SPARE = 2
# Loops over so narrow a band are faster in Python than NumPy's calls.
NARROW = 8


def implicit(
    states: FloatArray,
    start: FloatArray,
    slopes: FloatArray,
    table: FloatArray,
    stage: int,
    h: float,
) -> None:
    """Move the states to the next stage; the Python engine's form.

    Of n states, stages 1 to n give the columns of the Jacobian J by differences, and stage n + 1
    the derivative by time f_t. The increments k_i solve (1 / (gamma h) - J) k_i = f_i +
    sum C_ij k_j / h + h d_i f_t, and replace the slopes f_i of their stages. The last is the
    estimated error of the step; it is kept as a slope, k / h.
    """
    n = len(states)
    i = stage - n - 1
    if 0 < stage <= n:
        slopes[stage] = (slopes[stage] - slopes[0]) / (states[stage - 1] - start[stage - 1])
    states[:] = start
    if stage < n:
        states[stage] += math.sqrt(DIFFERENCE * max(1e-5, abs(start[stage])))
    if i < 0:
        return
    rows = len(slopes) - SPARE
    row = 0 if i == 0 else stage
    if i == 0:
        slopes[stage] = (slopes[stage] - slopes[0]) / (SHIFT * h)
        slopes[1 : n + 1] *= -1.0
        slopes[1 : n + 1].flat[:: n + 1] += 1.0 / (GAMMA * h)
        factor(slopes, rows)
    earlier = [0, *range(n + 2, stage)][:i]
    right = slopes[row] + table[rows + i, 5] * h * slopes[n + 1]
    for m, k in enumerate(earlier):
        right += table[rows + i, m] / h * slopes[k]
    solve(slopes, rows, right)
    slopes[row] = right
    for m, k in enumerate([0, *range(n + 2, stage + 1)][: i + 1]):
        states += table[stage, m] * slopes[k]
    if i == 5:
        slopes[stage] = right / h


def factor(slopes: FloatArray, rows: int) -> None:
    """Factor M into triangles in place, with partial pivoting: M[r, c] is ``slopes[c + 1, r]``.

    Rows of the lower triangle are not exchanged again later; :func:`solve` exchanges as it goes.
    """
    n = slopes.shape[1]
    columns = slopes[1 : n + 1]
    at = np.nonzero(columns)
    band = int(np.abs(at[0] - at[1]).max(initial=0))
    slopes[rows + 1, 0] = band
    for k in range(n):
        # Exchanges widen the upper triangle's band to twice that of M, and not the lower one's.
        below, right = min(n, k + band + 1), min(n, k + 2 * band + 1)
        best = k + int(np.abs(columns[k, k:below]).argmax())
        slopes[rows, k] = best
        if best != k:
            columns[k:right, [k, best]] = columns[k:right, [best, k]]
        if columns[k, k] == 0.0:
            # The step is far too long, and rejected for its large increments.
            columns[k, k] = 1e-30
        columns[k, k + 1 : below] /= columns[k, k]
        columns[k + 1 : right, k + 1 : below] -= (
            columns[k + 1 : right, k, None] * columns[k, k + 1 : below]
        )


def solve(slopes: FloatArray, rows: int, right: FloatArray) -> None:
    """Solve M k = right in place, with the triangles of :func:`factor`."""
    n, band = slopes.shape[1], int(slopes[rows + 1, 0])
    if band < NARROW:
        solve_loops(slopes, rows, right)
        return
    columns = slopes[1 : n + 1]
    for k in range(n):
        best, below = int(slopes[rows, k]), min(n, k + band + 1)
        right[k], right[best] = right[best], right[k]
        right[k + 1 : below] -= columns[k, k + 1 : below] * right[k]
    terms = np.empty(n + 1)
    for k in range(n - 1, -1, -1):
        ahead = min(n, k + 2 * band + 1)
        terms[0] = right[k]
        np.multiply(columns[k + 1 : ahead, k], right[k + 1 : ahead], terms[1 : ahead - k])
        # One term after the other: a dot product would add them in another order than C does.
        right[k] = np.subtract.reduce(terms[: ahead - k]) / columns[k, k]


# The functions below do the same in loops, bit for bit, for the compiled plan.


def implicit_loops(
    states: FloatArray,
    start: FloatArray,
    slopes: FloatArray,
    table: FloatArray,
    stage: int,
    h: float,
) -> None:
    """What :func:`implicit` does."""
    n = len(states)
    i = stage - n - 1
    if 0 < stage <= n:
        moved_by = states[stage - 1] - start[stage - 1]
        for r in range(n):
            slopes[stage, r] = (slopes[stage, r] - slopes[0, r]) / moved_by
    for r in range(n):
        states[r] = start[r]
    if stage < n:
        states[stage] += math.sqrt(DIFFERENCE * max(1e-5, abs(start[stage])))
    if i >= 0:
        row = 0 if i == 0 else stage
        rows = len(slopes) - SPARE
        if i == 0:
            for r in range(n):
                slopes[stage, r] = (slopes[stage, r] - slopes[0, r]) / (SHIFT * h)
            for c in range(n):
                for r in range(n):
                    slopes[c + 1, r] = -slopes[c + 1, r]
                slopes[c + 1, c] += 1.0 / (GAMMA * h)
            factor_loops(slopes, rows)
        right = np.zeros(n)
        for r in range(n):
            total = slopes[row, r] + table[rows + i, 5] * h * slopes[n + 1, r]
            for m in range(i):
                total += table[rows + i, m] / h * slopes[0 if m == 0 else n + 1 + m, r]
            right[r] = total
        solve_loops(slopes, rows, right)
        for r in range(n):
            slopes[row, r] = right[r]
        for r in range(n):
            for m in range(i + 1):
                states[r] += table[stage, m] * slopes[0 if m == 0 else n + 1 + m, r]
            if i == 5:
                slopes[stage, r] = right[r] / h


def factor_loops(slopes: FloatArray, rows: int) -> None:
    """What :func:`factor` does."""
    n = slopes.shape[1]
    band = 0
    for c in range(n):
        for r in range(n):
            if slopes[c + 1, r] != 0.0:
                band = max(band, abs(r - c))
    slopes[rows + 1, 0] = band
    for k in range(n):
        below, right = min(n, k + band + 1), min(n, k + 2 * band + 1)
        best = k
        for r in range(k + 1, below):
            if abs(slopes[k + 1, r]) > abs(slopes[k + 1, best]):
                best = r
        slopes[rows, k] = best
        if best != k:
            for c in range(k, right):
                upper = slopes[c + 1, k]
                slopes[c + 1, k] = slopes[c + 1, best]
                slopes[c + 1, best] = upper
        if slopes[k + 1, k] == 0.0:
            slopes[k + 1, k] = 1e-30
        for r in range(k + 1, below):
            slopes[k + 1, r] /= slopes[k + 1, k]
        for c in range(k + 1, right):
            weight = slopes[c + 1, k]
            if weight != 0.0:
                for r in range(k + 1, below):
                    slopes[c + 1, r] -= weight * slopes[k + 1, r]


def solve_loops(slopes: FloatArray, rows: int, right: FloatArray) -> None:
    """What :func:`solve` does."""
    n, band = slopes.shape[1], int(slopes[rows + 1, 0])
    for k in range(n):
        best = int(slopes[rows, k])
        upper = right[k]
        right[k] = right[best]
        right[best] = upper
        for r in range(k + 1, min(n, k + band + 1)):
            right[r] -= slopes[k + 1, r] * right[k]
    for k in range(n - 1, -1, -1):
        total = right[k]
        for c in range(k + 1, min(n, k + 2 * band + 1)):
            total -= slopes[c + 1, k] * right[c]
        right[k] = total / slopes[k + 1, k]
