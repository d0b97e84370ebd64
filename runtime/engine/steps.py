"""The steps of a solver of continuous states: stages, and the control of their length.

In go the states and the slopes of a step, out come the states at its end and the length of the
next one. Functions without a form of NumPy are compiled as they are, so both engines take the same
steps. The solvers themselves are declared in ``runtime/solvers.py``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.engine.rosenbrock import GAMMA
from runtime.solvers import SPARE

# The entries of ``control``, the memory of a solver that chooses its own steps: the next step (s),
# tolerances, the largest and the smallest step, whether the last step was rejected, the steps
# since the last tick, how far the first step is estimated (see ``estimated``), the tick's time,
# the steps since the last tick that hardly move (see ``crawls``).
STEP, RTOL, ATOL, LARGEST, SMALLEST, REJECTED, COUNT, BEGUN, NOW, CRAWLED = range(10)
CONTROLS = 10
# The smallest step as a share of the time itself, which rounds; and where the time is zero.
ROUNDING, LEAST = 16.0 * 2.220446049250313e-16, 1e-290
MAX_SUBSTEPS = 100_000
# Where a derivative is smooth, some steps crawl at a turning point; in a sliding mode all do. So
# many in one tick move each state by less than 1e4 tolerances together.
MAX_CRAWLED = 1000
# The error of a step whose end, or whose estimated error, is not finite, in tolerances.
INFINITE = 1e300
# By how much one step can be longer and shorter than the one before.
LONGEST, SHORTEST = 5.0, 0.2
# From these ratios on, an estimate of more than that is not exact enough to be taken as it is.
FAR_LONGER, FAR_SHORTER = 5e-4**-0.2, 1e3**-0.2
# The first trial step, as a share of the largest: only its slopes are of interest.
TRIAL = 1e-8


def controls(rtol: float, atol: float, max_step: float) -> FloatArray:
    """The entries of ``control`` before the first tick."""
    return np.array([TRIAL * max_step, rtol, atol, max_step, LEAST, *[0.0] * 5])


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


# The functions below are part of the compiled plan's text; see compiled/solver_unit.py.


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


def move_states(
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
        control[CRAWLED] = 0.0
    # Steps below the rounding of the time itself are too small.
    control[SMALLEST] = max(LEAST, ROUNDING * (control[NOW] + done))
    left, step = dt - done, min(control[STEP], control[LARGEST])
    if left > 1e15 * step:
        return float(step)
    return float(left / (int(left / step - 1e-9) + 1))


def reject_step(states: FloatArray, start: FloatArray, control: FloatArray, h: float) -> float:
    """Go back to the start of a step of which a stage is not finite; the next one is shorter.

    Returns 0; -1 if no step is short enough, so that the failure is that of the run.
    """
    for i in range(len(states)):
        states[i] = start[i]
    control[REJECTED] = 1.0
    control[COUNT] += 1.0
    control[STEP] = 0.2 * h
    return -1.0 if has_failed(control) else 0.0


def accept_step(
    states: FloatArray,
    start: FloatArray,
    slopes: FloatArray,
    errors: FloatArray,
    control: FloatArray,
    exponent: float,
    done: float,
    h: float,
    dt: float,
) -> float:
    """Accept a step if its estimated error is within the tolerances; or go back to its start.

    Returns the part of the tick (s) that is done; -1 - i if no step is small enough for column i.
    """
    worst, column = 0.0, 0
    # Of an implicit method, the slope of the last stage is the estimated error.
    first = 0 if len(errors) > 1 else len(slopes) - len(states) - SPARE - 1
    for i in range(len(states)):
        error = 0.0
        for j in range(len(errors)):
            error += errors[j] * slopes[first + j, i]
        scale = control[ATOL] + control[RTOL] * max(abs(start[i]), abs(states[i]))
        ratio = abs(h * error) / scale
        if not math.isfinite(ratio) or not math.isfinite(states[i]):
            ratio = INFINITE
        if ratio > worst:
            worst, column = ratio, i
    control[COUNT] += 1.0
    following = h * growth(worst, exponent)
    if worst <= 1.0:
        if control[REJECTED] > 0.0:
            following = min(following, h)
            control[BEGUN] = 2.0
        elif control[BEGUN] < 2.0:
            estimate = first_step(states, start, slopes, errors, control, exponent, h)
            following = max(estimate, control[SMALLEST])
        control[REJECTED] = 0.0
        control[CRAWLED] += crawls(states, start, errors, control, worst)
        done += h
        if dt - done <= 1e-12 * dt:
            done = dt
    else:
        control[REJECTED] = 1.0
        for i in range(len(states)):
            states[i] = start[i]
    control[STEP] = following
    return -1.0 - column if done < dt and has_failed(control) else done


def has_failed(control: FloatArray) -> bool:
    """Whether steps are too short, too many, or too many that hardly move."""
    is_short = control[STEP] < control[SMALLEST]
    return bool(is_short or control[COUNT] > MAX_SUBSTEPS or control[CRAWLED] > MAX_CRAWLED)


def crawls(
    states: FloatArray, start: FloatArray, errors: FloatArray, control: FloatArray, worst: float
) -> float:
    """1 for a step that its error keeps short, and that moves no state by ten such errors; or 0.

    An implicit method has such errors where a derivative jumps; of explicit ones, 0.
    """
    if len(errors) > 1:
        return 0.0
    far = 0.0
    for i in range(len(states)):
        scale = control[ATOL] + control[RTOL] * max(abs(start[i]), abs(states[i]))
        far = max(far, abs(states[i] - start[i]) / scale)
    return 1.0 if worst > 0.01 and far < 10.0 * worst else 0.0


def growth(worst: float, exponent: float) -> float:
    """By how much the next step is longer after an error in tolerances; see ``Method.exponent``."""
    if worst <= 1e-250:
        return LONGEST
    ratio = worst**-exponent
    if ratio >= FAR_LONGER:
        return LONGEST
    return min(LONGEST, max(SHORTEST, 0.9 * ratio)) if ratio > FAR_SHORTER else SHORTEST


def first_step(
    states: FloatArray,
    start: FloatArray,
    slopes: FloatArray,
    errors: FloatArray,
    control: FloatArray,
    exponent: float,
    h: float,
) -> float:
    """The next one of the first steps of a run (Hairer, Norsett, Wanner I, section II.4).

    After a trial step: the one with which an explicit Euler step would change the states by a
    hundredth. After this one, explicit methods: the one for which the terms of highest order are a
    hundredth, by the change of the slopes from the first stage to the last.
    """
    is_explicit = len(errors) > 1
    share = 1.0 if is_explicit else 1.0 / (GAMMA * h)  # of slopes[0], which may be an increment
    size, speed, bend = 0.0, 0.0, 0.0
    for i in range(len(states)):
        scale = control[ATOL] + control[RTOL] * abs(start[i])
        size = max(size, abs(start[i]) / scale)
        speed = max(speed, abs(share * slopes[0, i]) / scale)
        if is_explicit:
            bend = max(bend, abs(slopes[len(errors) - 1, i] - slopes[0, i]) / (scale * h))
    control[BEGUN] += 1.0 if is_explicit else 2.0
    if control[BEGUN] != 2.0 or not is_explicit:
        if size < 1e-5 or speed < 1e-5:
            return float(1e-3 * control[LARGEST])
        return float(0.01 * size / speed)
    worst = max(speed, bend)
    if worst <= 1e-15:
        return float(max(1e-3 * control[LARGEST], 1e-3 * h))
    return float(min(100.0 * h, (0.01 / worst) ** exponent))
