"""Newton's method for algebraic loops, one evaluation of the loop at a time.

In go the unknowns as a plan tried them and as its calls then computed them, out come the unknowns
to try next. Of ``x = 1 - 4 x``, from the last solution x = 0:

    try 0         computes  1       residual  1
    try 1.5e-8    computes  1 - 6e-8          the slope of the residual, -5, by a difference
    try 0.2       computes  0.2     residual 1e-9: the same slope will do
    try 0.2       computes  0.2     solved

The slopes, a matrix for several unknowns, are computed again where the residual falls by less than
a hundredth. Where it grows or is not finite, the step is halved (Dennis and Schnabel, Numerical
methods for unconstrained optimization and nonlinear equations, 1996, section 6.3).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any, NoReturn

import numpy as np

from blocks.core import FloatArray
from runtime.engine.values import NotFiniteError
from runtime.plan import Plan, Solve

# The rows of a loop's memory: unknowns to try, what they came out as, the best so far, its
# residual, the step from there, and after these the matrix of slopes, transposed.
TRY, RESULT, BEST, REST, MOVE, SLOPES = range(6)
# The entries of its control: what the next result is for, evaluations of the matrix so far, the
# residual of the best, and the share of the step that is tried.
PHASE, ROUNDS, NORM, SHARE = range(4)
# Phases below 0; from 0, a column of the matrix.
FIRST, STEP, LAST = -3.0, -2.0, -1.0
MAX_ROUNDS = 50
# A step this small, relative and in all, is the last one; and one that is small enough to stop at
# where rounding lets the residual fall no further.
RELATIVE, ABSOLUTE, ROUNDING = 1e-9, 1e-15, 1e-7
# What `newton` returns.
SOLVED, GOING, UNSOLVED, SINGULAR = 0.0, 1.0, -1.0, -2.0


def memory_shape(loop: Solve) -> tuple[int, int]:
    """The shape of a loop's memory, which belongs to the state of a run."""
    return SLOPES + loop.size, loop.size


def loop_names(plan: Plan, arrays: Mapping[str, FloatArray]) -> dict[str, Any]:
    """What the text of a plan refers to, for its loops.

    Parameters
    ----------
    arrays : of the state of the run; a loop's search begins with the last solution.
    """
    found: dict[str, Any] = {"begun": begun, "newton": newton} if plan.loops else {}
    for loop in plan.loops:
        name = f"loop_{loop.number}"
        memory, control = arrays[f"run/{name}"], np.zeros(4)
        raising = partial(unsolved, loop, memory, control, plan.time_unit)
        found |= {name: memory, f"{name}_control": control, f"unsolved_{loop.number}": raising}
    return found


def unsolved(
    solve: Solve, memory: FloatArray, control: FloatArray, unit: str, result: float, t: float
) -> NoReturn:
    """Raise the error of a loop that has no solution; called by the plan."""
    names = ", ".join(map(str, solve.unknowns))
    best = int(np.abs(memory[REST]).argmax())
    why = (
        f"after {control[ROUNDS]:.0f} steps of Newton's method the residual is "
        f"{memory[REST, best]:.3g} at {memory[BEST, best]:.6g}"
    )
    if result == SINGULAR:
        why = "its unknowns do not determine each other (the matrix of slopes is singular)"
    raise NotFiniteError(
        f"the algebraic loop of {names} ({solve.path}) has no solution at t = {t:g} {unit}: {why}",
        solve.unknowns[0].block,
    )


# The functions below are part of the compiled plan's text; see compiled/solver_unit.py.


def begun(memory: FloatArray, control: FloatArray) -> float:
    """Begin with the solution that was found last."""
    for i in range(memory.shape[1]):
        memory[TRY, i] = memory[BEST, i]
    control[PHASE] = FIRST
    control[ROUNDS] = 0.0
    return GOING


def newton(memory: FloatArray, control: FloatArray) -> float:
    """Go on from a result: set the unknowns to try next, and say whether they are solved."""
    n = memory.shape[1]
    if control[PHASE] == LAST:
        for i in range(n):
            memory[BEST, i] = memory[TRY, i]
        return SOLVED
    if control[PHASE] >= 0.0:
        return column(memory, control, int(control[PHASE]))
    norm = 0.0
    for i in range(n):
        norm += abs(memory[RESULT, i] - memory[TRY, i])
    if control[PHASE] == STEP and not norm < control[NORM]:
        return shorter(memory, control)
    if not math.isfinite(norm):
        return UNSOLVED
    falls = control[PHASE] == STEP and norm <= 0.01 * control[NORM]
    control[NORM] = norm
    for i in range(n):
        memory[BEST, i] = memory[TRY, i]
        memory[REST, i] = memory[RESULT, i] - memory[TRY, i]
    if norm == 0.0:
        return SOLVED
    if falls:
        return move(memory, control)
    control[ROUNDS] += 1.0
    if control[ROUNDS] > MAX_ROUNDS:
        return UNSOLVED
    control[PHASE] = 0.0
    memory[TRY, 0] += shift(memory, 0)
    return GOING


def shift(memory: FloatArray, j: int) -> float:
    """By how much an unknown is changed for a column of the matrix."""
    size = max(abs(memory[BEST, j]), abs(memory[REST, j]))
    return 1.5e-8 * size if size > 0.0 else 1.5e-8


def column(memory: FloatArray, control: FloatArray, j: int) -> float:
    """Store a column of the matrix; after the last one, make a step."""
    n = memory.shape[1]
    change = memory[TRY, j] - memory[BEST, j]
    for i in range(n):
        rest = memory[RESULT, i] - memory[TRY, i]
        memory[SLOPES + j, i] = (rest - memory[REST, i]) / change
        if not math.isfinite(memory[SLOPES + j, i]):
            return UNSOLVED
    memory[TRY, j] = memory[BEST, j]
    if j + 1 < n:
        control[PHASE] = j + 1.0
        memory[TRY, j + 1] += shift(memory, j + 1)
        return GOING
    return move(memory, control)


def move(memory: FloatArray, control: FloatArray) -> float:
    """Try the solution of the linear equations."""
    n = memory.shape[1]
    if not linear(memory):
        return SINGULAR
    small = True
    for i in range(n):
        small = small and abs(memory[MOVE, i]) <= RELATIVE * abs(memory[BEST, i]) + ABSOLUTE
        memory[TRY, i] = memory[BEST, i] + memory[MOVE, i]
    control[SHARE] = 1.0
    control[PHASE] = LAST if small else STEP
    return GOING


def shorter(memory: FloatArray, control: FloatArray) -> float:
    """Try half of the step after a residual that is not smaller than the one before."""
    n = memory.shape[1]
    largest = 0.0
    for i in range(n):
        largest = max(largest, abs(memory[BEST, i]))
    rounding = True
    for i in range(n):
        rounding = rounding and abs(memory[MOVE, i]) <= ROUNDING * largest
    control[SHARE] *= 0.5
    if control[SHARE] < 1e-6 and not rounding:
        return UNSOLVED
    for i in range(n):
        share = 0.0 if rounding else control[SHARE]
        memory[TRY, i] = memory[BEST, i] + share * memory[MOVE, i]
    control[PHASE] = LAST if rounding else STEP
    return GOING


def linear(memory: FloatArray) -> bool:
    """Solve for the step, by elimination with pivots; False if the matrix is singular."""
    n = memory.shape[1]
    a = np.empty((n, n + 1))
    for i in range(n):
        for j in range(n):
            a[i, j] = memory[SLOPES + j, i]
        a[i, n] = -memory[REST, i]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        # Differences have errors of 1e-8: what is smaller is a zero.
        if abs(a[best, k]) < 1e-7:
            return False
        for j in range(k, n + 1):
            value = a[k, j]
            a[k, j] = a[best, j]
            a[best, j] = value
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            for j in range(k, n + 1):
                a[i, j] -= factor * a[k, j]
    for back in range(n):
        k = n - 1 - back
        total = a[k, n]
        for j in range(k + 1, n):
            total -= a[k, j] * memory[MOVE, j]
        memory[MOVE, k] = total / a[k, k]
    return True
