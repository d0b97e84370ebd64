"""The quadratic programs of predictive control: condensed once, and solved in each tick.

In: a linear model, weights, a horizon, and in each tick a state and bounds. Out: the best
commands::

    program = QuadraticProgram.of(a, b, q, r, steps)         # at the start: constant matrices
    u = minimum(*program.arrays, x, bounds)                  # in a tick; it is compiled
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blocks.control.lqr import riccati
from blocks.core import FloatArray, product, small_times, solve

SLACK = 1e-9  # by which rounding may pass a bound
PARALLEL = 1e-20  # squared sine of the angle to other rows below which a row depends on them
ROUNDS = 1000  # of the active-set method, which needs about one per limit that is reached


@dataclass(frozen=True)
class QuadraticProgram:
    """A condensed quadratic program: minimise u'Hu/2 + (F x)'u subject to G u <= g.

    u (m N,) holds the m commands of each of N steps; it is written free x + root z, where z = 0 is
    the minimum without bounds. ``free`` is -H^-1 F (m N, n), ``root`` a lower triangular matrix
    with root root' = H^-1, ``of_x`` is G free (4 m N, n) and ``of_z`` G root (4 m N, m N). The rows
    of G bound all u from above, then from below, then their changes upwards and downwards, then of
    each limited state x_1 to x_N from above and from below.

    A state is limited softly: by x <= bound + e, with penalty e^2 / 2 added to what is minimised,
    so that there is always a solution. Its e is one more column of z, the same for all N steps.
    """

    free: FloatArray
    root: FloatArray
    of_x: FloatArray
    of_z: FloatArray

    @classmethod
    def of(
        cls,
        a: FloatArray,
        b: FloatArray,
        q: FloatArray,
        r: FloatArray,
        steps: int,
        limited: Sequence[int] = (),
        penalty: float = 1.0,
    ) -> QuadraticProgram:
        """Eliminate the states of x_k+1 = A x_k + B u_k; ``limited`` are indices of states.

        The last state's weight solves the Riccati equation, so that without limits the first
        command is the LQR's, for any number of steps.
        """
        n, m = b.shape
        powers: list[FloatArray] = [np.eye(n)]
        for _ in range(steps):
            powers.append(product(a, powers[-1]))
        forced = np.zeros((n * steps, m * steps))
        for k in range(steps):
            for j in range(k + 1):
                forced[n * k : n * (k + 1), m * j : m * (j + 1)] = product(powers[k - j], b)
        weight = np.zeros((n * steps, n * steps))
        weight[:] = np.kron(np.eye(steps), q)
        weight[-n:, -n:] = riccati(a, b, q, r)
        weighted = product(forced.T, weight)
        h = product(weighted, forced) + np.kron(np.eye(steps), r)
        f = product(weighted, np.concatenate(powers[1:]))
        eye = np.eye(m * steps)
        # Symmetric but for rounding, here and before the Cholesky factor.
        inverse = solve(0.5 * (h + h.T), eye)
        change = eye - np.eye(m * steps, k=-m)
        rows = np.vstack((eye, -eye, change, -change))
        free, root = -product(inverse, f), _cholesky(0.5 * (inverse + inverse.T))
        program = cls(free, root, product(rows, free), product(rows, root))
        for i in limited:
            program = program._with_state(
                np.concatenate([each[i : i + 1] for each in powers[1:]]), forced[i::n], penalty
            )
        return program

    def _with_state(
        self, from_x: FloatArray, from_u: FloatArray, penalty: float
    ) -> QuadraticProgram:
        """With the rows of a state that is from_x x + from_u u in the N steps."""
        n, m = len(from_x), len(self.free)
        of_x = from_x + product(from_u, self.free)
        of_z = np.zeros((n, self.root.shape[1]))
        of_z[:, :m] = product(from_u, self.root[:, :m])
        slack = np.concatenate((np.zeros(len(self.of_z)), np.full(2 * n, -1 / math.sqrt(penalty))))
        return QuadraticProgram(
            self.free,
            np.column_stack((self.root, np.zeros(m))),
            np.concatenate((self.of_x, of_x, -of_x)),
            np.column_stack((np.concatenate((self.of_z, of_z, -of_z)), slack)),
        )

    @property
    def arrays(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """What ``minimum`` takes: free, root, of_x, of_z."""
        return self.free, self.root, self.of_x, self.of_z


def minimum(
    free: FloatArray,
    root: FloatArray,
    of_x: FloatArray,
    of_z: FloatArray,
    x: FloatArray,
    bounds: FloatArray,
) -> FloatArray:
    """The minimiser u (m N,) of a program for a state x (n,) and bounds g (4 m N,), some infinite.

    Raises
    ------
    ArithmeticError : no command satisfies the bounds.
    """
    return small_times(free, x) + small_times(root, nearest(of_z, bounds - small_times(of_x, x)))


def nearest(rows: FloatArray, room: FloatArray) -> FloatArray:
    """The z (d,) of smallest norm with rows z <= room, for rows (k, d) and room (k,).

    The dual active-set method of Goldfarb and Idnani (A numerically stable dual method for solving
    strictly convex quadratic programs, 1983). From z = 0 on, the row that is passed by most is made
    to hold with equality; an earlier one whose multiplier would become negative on the way leaves.
    ``basis`` holds orthonormal directions of the rows that are at their bound, and ``upper`` their
    coordinates in it: row j is the sum of upper[i, j] basis[i] over i <= j.

    Raises
    ------
    ArithmeticError : no z satisfies all rows.
    """
    d = rows.shape[1]
    z, count = np.zeros(d), 0
    at_bound, multipliers = np.zeros(d), np.zeros(d)
    basis, upper = np.zeros((d, d)), np.zeros((d, d))
    worst, pressure = -1, 0.0
    for _ in range(ROUNDS):
        if worst < 0:
            worst, pressure = most_passed(rows, room, z), 0.0
            if worst < 0:
                return z
        row = rows[worst]
        inside, rest = split(basis, count, row)
        slope = dot(rest, rest)
        turned = back_substituted(upper, count, inside)
        # How far to go until the row holds, and until the first multiplier is 0.
        full = (dot(row, z) - room[worst]) / slope if slope > PARALLEL * dot(row, row) else math.inf
        leaving, partial = first_at_zero(multipliers, turned, count)
        if full == math.inf and partial == math.inf:
            raise ArithmeticError("no command satisfies the limits")
        length = min(full, partial)
        for j in range(count):
            multipliers[j] -= length * turned[j]
        pressure += length
        if full < math.inf:
            z -= length * rest
        if full <= partial:
            at_bound[count], multipliers[count] = worst, pressure
            upper[:, count] = inside
            upper[count, count] = math.sqrt(slope)
            basis[count] = rest / math.sqrt(slope)
            count += 1
            worst = -1
        else:
            remove(leaving, count, rows, at_bound, multipliers, basis, upper)
            count -= 1
    raise ArithmeticError("the active-set method has not found which limits are reached")


def first_at_zero(multipliers: FloatArray, turned: FloatArray, count: int) -> tuple[int, float]:
    """Which of the multipliers becomes 0 first as all sink by ``turned``, and after how far."""
    leaving, partial = -1, math.inf
    for j in range(count):
        if turned[j] > 0.0 and multipliers[j] < partial * turned[j]:
            leaving, partial = j, multipliers[j] / turned[j]
    return leaving, partial


def remove(
    leaving: int,
    count: int,
    rows: FloatArray,
    at_bound: FloatArray,
    multipliers: FloatArray,
    basis: FloatArray,
    upper: FloatArray,
) -> None:
    """Take one of ``count`` rows out; the basis of those after it is computed again."""
    for j in range(leaving, count - 1):
        at_bound[j], multipliers[j] = at_bound[j + 1], multipliers[j + 1]
    for j in range(leaving, count - 1):
        inside, rest = split(basis, j, rows[int(at_bound[j])])
        upper[:, j] = inside
        upper[j, j] = math.sqrt(dot(rest, rest))
        basis[j] = rest / upper[j, j]


def most_passed(rows: FloatArray, room: FloatArray, z: FloatArray) -> int:
    """The row for which rows z exceeds room by most, or -1 if all hold."""
    passed, worst, most = small_times(rows, z) - room, -1, SLACK
    for i in range(len(passed)):
        if passed[i] > most:
            worst, most = i, passed[i]
    return worst


def split(basis: FloatArray, count: int, row: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The coordinates of a row (d,) in the first directions of a basis, and what is left of it."""
    inside, rest = np.zeros(len(row)), row.copy()
    for _ in range(2):  # once more: what rounding leaves in a basis' direction is not small enough
        for i in range(count):
            part = dot(basis[i], rest)
            inside[i] += part
            rest -= part * basis[i]
    return inside, rest


def back_substituted(upper: FloatArray, count: int, inside: FloatArray) -> FloatArray:
    """The first ``count`` coefficients c with sum_j upper[i, j] c[j] = inside[i]."""
    out = np.zeros(len(inside))
    for i in range(count - 1, -1, -1):
        total = inside[i]
        for j in range(i + 1, count):
            total -= upper[i, j] * out[j]
        out[i] = total / upper[i, i]
    return out


def dot(a: FloatArray, b: FloatArray) -> float:
    """The sum of a[i] b[i] from left to right."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


def _cholesky(matrix: FloatArray) -> FloatArray:
    """The lower triangular factor of a definite matrix, by the same bits on every machine."""
    n = len(matrix)
    lower = np.zeros((n, n))
    for j in range(n):
        past = lower[j:, :j] * lower[j, :j]
        column = matrix[j:, j] - np.add.reduce(past, 1)
        lower[j:, j] = column / math.sqrt(column[0])
    return lower
