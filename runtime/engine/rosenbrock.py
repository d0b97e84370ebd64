"""The stages of a linearly implicit method (Rosenbrock), for stiff systems.

In go the slopes of n states that the plan computes stage by stage; out come the states at which it
computes the next ones. Two states that no equation contains together share a stage of the
Jacobian J ("colours", Curtis, Powell and Reid 1974): a diffusion of any length needs three. A step
with 3 of them, by stage:

    0        f(x)                      the slope at the start of the step
    1 to 3   f(x + d e_0 + d e_3 ...)  the columns of J by differences, all of one colour at once
    4        f(x, t + d)               the derivative by time; M = 1/(gamma h) - J is factored
    4 to 9   M k_i = f_i + ...         six increments with the same M

M is factored once per step, and only within its band: neighbours in a diffusion make it
tridiagonal, which costs n operations where a full matrix costs n^3. Where another order of the
states makes the band much narrower, M has its rows and columns in that order ("places").
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import FloatArray
from runtime.solvers import SHIFT, SPARE

GAMMA = 0.25
# The rounding of a float64, of which the root is the best step of a difference.
DIFFERENCE = 2.220446049250313e-16
# Increments of a step, each with a stage.
INCREMENTS = 6
# The arrays of a ``Coupling`` that :func:`implicit` takes.
STRUCTURE = "colours", "pattern", "places"
# Loops over so narrow a band are faster in Python than NumPy's calls.
NARROW = 8


def implicit(
    states: FloatArray,
    start: FloatArray,
    slopes: FloatArray,
    table: FloatArray,
    stage: int,
    h: float,
    colours: FloatArray,
    pattern: FloatArray,
    places: FloatArray,
) -> None:
    """Move the states to the next stage; the Python engine's form.

    The increments k_i solve (1 / (gamma h) - J) k_i = f_i + sum C_ij k_j / h + h d_i f_t, and
    replace the slopes f_i of their stages. The last is the estimated error of the step; it is kept
    as a slope, k / h.

    Parameters
    ----------
    colours : of each state, (n,): from 0.
    pattern : row and column of each entry of J that may differ from zero, (m, 2).
    places : of each state, (n,): its row and column in M.
    """
    n = len(states)
    rows = len(slopes) - n - SPARE
    first = rows - INCREMENTS
    i = stage - first
    states[:] = start
    if i <= 0:
        steps = start + np.sqrt(DIFFERENCE * np.maximum(1e-5, np.abs(start)))
        np.copyto(states, steps, where=colours == stage)  # of no state for i = 0
    if i < 0:
        return
    row = 0 if i == 0 else stage
    place = places.astype(int)
    if i == 0:
        slopes[stage] = (slopes[stage] - slopes[0]) / (SHIFT * h)
        r, c = pattern.astype(int).T
        columns = slopes[rows : rows + n]
        columns[:] = 0.0
        changes = slopes[1 + colours[c].astype(int), r] - slopes[0, r]
        columns[place[c], place[r]] = -(changes / (steps - start)[c])
        columns.flat[:: n + 1] += 1.0 / (GAMMA * h)
        slopes[rows + n + 1, 0] = np.abs(place[r] - place[c]).max(initial=0)
        factor(slopes, rows)
    right = slopes[row] + table[rows + i, 5] * h * slopes[first]
    for m in range(i):
        right += table[rows + i, m] / h * slopes[0 if m == 0 else first + m]
    placed = np.empty(n)
    placed[place] = right
    solve(slopes, rows, placed)
    slopes[row] = right = placed[place]
    for m in range(i + 1):
        states += table[stage, m] * slopes[0 if m == 0 else first + m]
    if i == INCREMENTS - 1:
        slopes[stage] = right / h


def factor(slopes: FloatArray, rows: int) -> None:
    """Factor M into triangles in place, with partial pivoting: M[r, c] is ``slopes[rows + c, r]``.

    Rows of the lower triangle are not exchanged again later; :func:`solve` exchanges as it goes.
    """
    n = slopes.shape[1]
    band = int(slopes[rows + n + 1, 0])
    columns = slopes[rows : rows + n]
    for k in range(n):
        # Exchanges widen the upper triangle's band to twice that of M, and not the lower one's.
        below, right = min(n, k + band + 1), min(n, k + 2 * band + 1)
        best = k + int(np.abs(columns[k, k:below]).argmax())
        slopes[rows + n, k] = best
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
    n = slopes.shape[1]
    band = int(slopes[rows + n + 1, 0])
    if band < NARROW:
        solve_loops(slopes, rows, right)
        return
    columns = slopes[rows : rows + n]
    for k in range(n):
        best, below = int(slopes[rows + n, k]), min(n, k + band + 1)
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
    colours: FloatArray,
    pattern: FloatArray,
    places: FloatArray,
) -> None:
    """What :func:`implicit` does."""
    n = len(states)
    rows = len(slopes) - n - SPARE
    first = rows - INCREMENTS
    i = stage - first
    for r in range(n):
        states[r] = start[r]
        if colours[r] == stage:
            states[r] += difference(start[r])
    if i >= 0:
        row = 0 if i == 0 else stage
        if i == 0:
            for r in range(n):
                slopes[stage, r] = (slopes[stage, r] - slopes[0, r]) / (SHIFT * h)
            fill(slopes, rows, start, colours, pattern, places, h)
            factor_loops(slopes, rows)
        right = np.zeros(n)
        for r in range(n):
            total = slopes[row, r] + table[rows + i, 5] * h * slopes[first, r]
            for m in range(i):
                total += table[rows + i, m] / h * slopes[0 if m == 0 else first + m, r]
            right[int(places[r])] = total
        solve_loops(slopes, rows, right)
        for r in range(n):
            slopes[row, r] = right[int(places[r])]
        for r in range(n):
            for m in range(i + 1):
                states[r] += table[stage, m] * slopes[0 if m == 0 else first + m, r]
            if i == INCREMENTS - 1:
                slopes[stage, r] = right[int(places[r])] / h


def difference(x: float) -> float:
    """By how much a state is moved for the Jacobian."""
    return math.sqrt(DIFFERENCE * max(1e-5, abs(x)))


def fill(
    slopes: FloatArray,
    rows: int,
    start: FloatArray,
    colours: FloatArray,
    pattern: FloatArray,
    places: FloatArray,
    h: float,
) -> None:
    """Write M = 1 / (gamma h) - J from the differences of each colour, and its band."""
    n, band = slopes.shape[1], 0
    for m in range(len(pattern)):
        r, c = int(pattern[m, 0]), int(pattern[m, 1])
        band = max(band, abs(int(places[r]) - int(places[c])))
    for c in range(n):
        for r in range(max(0, c - 2 * band), min(n, c + band + 1)):
            slopes[rows + c, r] = 0.0
    for m in range(len(pattern)):
        r, c = int(pattern[m, 0]), int(pattern[m, 1])
        change = slopes[1 + int(colours[c]), r] - slopes[0, r]
        step = start[c] + difference(start[c]) - start[c]
        slopes[rows + int(places[c]), int(places[r])] = -(change / step)
    for r in range(n):
        slopes[rows + r, r] += 1.0 / (GAMMA * h)
    slopes[rows + n + 1, 0] = band


def factor_loops(slopes: FloatArray, rows: int) -> None:
    """What :func:`factor` does."""
    n = slopes.shape[1]
    band = int(slopes[rows + n + 1, 0])
    for k in range(n):
        below, right = min(n, k + band + 1), min(n, k + 2 * band + 1)
        best = k
        for r in range(k + 1, below):
            if abs(slopes[rows + k, r]) > abs(slopes[rows + k, best]):
                best = r
        slopes[rows + n, k] = best
        if best != k:
            for c in range(k, right):
                upper = slopes[rows + c, k]
                slopes[rows + c, k] = slopes[rows + c, best]
                slopes[rows + c, best] = upper
        if slopes[rows + k, k] == 0.0:
            slopes[rows + k, k] = 1e-30
        for r in range(k + 1, below):
            slopes[rows + k, r] /= slopes[rows + k, k]
        for c in range(k + 1, right):
            weight = slopes[rows + c, k]
            if weight != 0.0:
                for r in range(k + 1, below):
                    slopes[rows + c, r] -= weight * slopes[rows + k, r]


def solve_loops(slopes: FloatArray, rows: int, right: FloatArray) -> None:
    """What :func:`solve` does."""
    n = slopes.shape[1]
    band = int(slopes[rows + n + 1, 0])
    for k in range(n):
        best = int(slopes[rows + n, k])
        upper = right[k]
        right[k] = right[best]
        right[best] = upper
        for r in range(k + 1, min(n, k + band + 1)):
            right[r] -= slopes[rows + k, r] * right[k]
    for k in range(n - 1, -1, -1):
        total = right[k]
        for c in range(k + 1, min(n, k + 2 * band + 1)):
            total -= slopes[rows + c, k] * right[c]
        right[k] = total / slopes[rows + k, k]
