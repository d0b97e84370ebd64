"""Solvers of the continuous states: Runge-Kutta methods as their coefficients."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import FloatArray


@dataclass(frozen=True)
class Method:
    """An explicit Runge-Kutta method (Hairer, Norsett, Wanner, Solving ODEs I, section II.1).

    nodes : the time of each stage as a share of the step.
    rows : how the slopes of the stages so far are weighted to reach the next stage; the last row
        gives the end of the step.
    order : the error of a whole run is proportional to this power of the step.
    errors : weights of the slopes in the estimated error of a step; none for a fixed step.
    """

    nodes: tuple[float, ...]
    rows: tuple[tuple[float, ...], ...]
    order: int
    errors: tuple[float, ...] = ()

    @property
    def stages(self) -> int:
        return len(self.nodes)

    @property
    def terms(self) -> tuple[tuple[tuple[int, float], ...], ...]:
        """The rows as (stage, weight) where the weight is not zero."""
        return tuple(tuple((j, w) for j, w in enumerate(row) if w) for row in self.rows)

    @property
    def table(self) -> FloatArray:
        """The rows as an array of one row per stage; the last column holds the nodes."""
        table = np.zeros((self.stages, self.stages + 1))
        for i, row in enumerate(self.rows):
            table[i, : len(row)] = row
        table[:, -1] = self.nodes
        return table


METHODS = {
    "euler": Method((0.0,), ((1.0,),), 1),
    "heun": Method((0.0, 1.0), ((1.0,), (0.5, 0.5)), 2),
    "rk4": Method(
        (0.0, 0.5, 0.5, 1.0),
        ((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
        4,
    ),
    # Dormand and Prince, A family of embedded Runge-Kutta formulae (1980): table 2.
    "dopri5": Method(
        (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0),
        (
            (1 / 5,),
            (3 / 40, 9 / 40),
            (44 / 45, -56 / 15, 32 / 9),
            (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
            (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
            (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
            (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
        ),
        5,
        (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),
    ),
}
# The entries of ``control``, the memory of a solver that chooses its own steps: the next step (s),
# tolerances, the largest and the smallest step, whether the last step was rejected, and the steps
# since the last tick.
STEP, RTOL, ATOL, LARGEST, SMALLEST, REJECTED, COUNT = range(7)
MAX_SUBSTEPS = 100_000


def controls(rtol: float, atol: float, max_step: float, until: float) -> FloatArray:
    """The entries of ``control`` before the first tick.

    Steps below the rounding of the time itself are too small.
    """
    smallest = 16.0 * np.finfo(np.float64).eps * until
    return np.array([max_step, rtol, atol, max_step, smallest, 0.0, 0.0])


def blend(
    states: FloatArray,
    start: FloatArray,
    slopes: FloatArray,
    terms: tuple[tuple[tuple[int, float], ...], ...],
    stage: int,
    h: float,
) -> None:
    """Move the states to the next stage: start + h times the weighted slopes so far."""
    (j, weight), *rest = terms[stage]
    total = slopes[j] * (h * weight)
    for j, weight in rest:
        total += slopes[j] * (h * weight)
    np.add(start, total, states)


def joined(rates: Any) -> FloatArray:
    """The rates of change of several states, or of a table, as one row."""
    parts = rates if isinstance(rates, tuple) else (rates,)
    return np.concatenate([np.ravel(part) for part in parts])


# The functions below are part of the compiled plan's text; see compiled/stages.py.


def keep(start: FloatArray, states: FloatArray) -> None:
    """Remember where the step starts."""
    for i in range(len(states)):
        start[i] = states[i]


def first_bad(slopes: FloatArray, stage: int) -> int:
    """The first column of a stage that is not finite; -1 if there is none."""
    for i in range(slopes.shape[1]):
        if not math.isfinite(slopes[stage, i]):
            return i
    return -1


def moved(
    states: FloatArray,
    start: FloatArray,
    slopes: FloatArray,
    table: FloatArray,
    stage: int,
    h: float,
) -> None:
    """What :func:`blend` does, in loops."""
    for i in range(len(states)):
        total = 0.0
        for j in range(stage + 1):
            total += slopes[j, i] * (h * table[stage, j])
        states[i] = start[i] + total


def substep(control: FloatArray, done: float, dt: float) -> float:
    """The next step (s) of a solver that has done this part of a tick, so that it lands on dt."""
    if done == 0.0 and control[REJECTED] == 0.0:
        control[COUNT] = 0.0
    left = dt - done
    return left / (int(left / min(control[STEP], control[LARGEST]) - 1e-9) + 1)


def judged(
    states: FloatArray,
    start: FloatArray,
    slopes: FloatArray,
    errors: FloatArray,
    control: FloatArray,
    done: float,
    h: float,
    dt: float,
) -> float:
    """Accept a step if its estimated error is within the tolerances; or go back to its start.

    Returns the part of the tick (s) that is done; -1 - i if no step is small enough for column i.
    """
    worst, column = 0.0, 0
    for i in range(len(states)):
        error = 0.0
        for j in range(len(errors)):
            error += errors[j] * slopes[j, i]
        scale = control[ATOL] + control[RTOL] * max(abs(start[i]), abs(states[i]))
        ratio = abs(h * error) / scale
        if not ratio <= worst:
            worst, column = ratio, i
    control[COUNT] += 1.0
    factor = 0.2
    if worst <= 5e-4:
        factor = 5.0
    elif worst < 1e3:
        factor = min(5.0, max(0.2, 0.9 * worst**-0.2))
    if worst <= 1.0:
        if control[REJECTED] > 0.0:
            factor = min(factor, 1.0)
        control[REJECTED] = 0.0
        done += h
        if dt - done <= 1e-12 * dt:
            done = dt
    else:
        control[REJECTED] = 1.0
        for i in range(len(states)):
            states[i] = start[i]
    control[STEP] = h * factor
    if done < dt and (control[STEP] < control[SMALLEST] or control[COUNT] > MAX_SUBSTEPS):
        return -1.0 - column
    return done
