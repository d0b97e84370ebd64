"""Least squares from several starts, confidence intervals, and what the data cannot tell apart.

In: a :class:`Model`. Out: a :class:`Fit`. The search works on u in [0, 1]^n, where 0 and 1 are the
ends of each range (of its logarithm, for ``log(...)``), so that numbers of any size are alike::

    fit_model(model, starts=4)  ->  Fit(parameters=[arm.damping = 0.3 [0.29, 0.31]], ...)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from blocks.core import FloatArray, IntArray
from runtime.errors import GraphError, SimulationError, UsageError
from runtime.experiments.design import Range, own_value
from runtime.fitting.model import Model
from runtime.fitting.noise import Noise, noise_of, variances

# Steps of the differences, as a share of a range: in the search only the direction matters, and
# one more run per number gives it; at the end central differences, whose error is their square.
SEARCH_STEP, FINAL_STEP = 1e-5, 1e-4
CONFIDENCE = 0.95
# A direction along which the residuals change by less than this share of what they change along
# the best one is one that the data say nothing about.
SINGULAR = 1e-5
# The share of a number in a direction from which on it is said to be part of it.
INVOLVED = 0.01
CORRELATED = 0.99
# Starts whose cost is within this share of the best one have reached the same minimum.
SAME = 0.01
# Of a run that fails, so that the search goes back; a measured signal has a scale of 1.
FAILED = 1e6


@dataclass(frozen=True)
class Parameter:
    """A fitted number with its confidence interval, which is infinite if the data do not tell."""

    path: str
    value: float
    low: float
    high: float
    at_end: bool


@dataclass(frozen=True)
class Fit:
    """What a fit has found.

    simulated : each series with the fitted numbers, in the order of ``model.series``.
    rms : the root mean square of each series' difference, in its unit.
    starts : the cost (half of the sum of squared residuals) that each start has reached.
    effective : measured values that are independent, judged by how the residuals follow each other.
    notes : what a reader must know, as sentences.
    """

    model: Model
    parameters: tuple[Parameter, ...]
    simulated: tuple[FloatArray, ...]
    starts: tuple[float, ...]
    effective: float
    notes: tuple[str, ...] = field(default=())

    @property
    def values(self) -> dict[str, float]:
        return {each.path: each.value for each in self.parameters}

    @property
    def rms(self) -> tuple[float, ...]:
        pairs = zip(self.simulated, self.model.series, strict=True)
        return tuple(float(np.sqrt(np.mean((y - one.values) ** 2))) for y, one in pairs)


def fit_model(
    model: Model,
    starts: int = 4,
    progress: Callable[[int, int, str], None] = lambda done, total, note: None,
) -> Fit:
    """Find the numbers within their ranges that minimise the sum of squared residuals.

    By scipy's ``least_squares`` (trust region reflective), from the graph's own numbers and from
    points of a Sobol sequence. Intervals are those of linear regression at the minimum (Seber and
    Wild, Nonlinear Regression, section 5.1), with a variance of its own for each signal, and the
    correlation of its residuals from one value to the next (:mod:`runtime.fitting.noise`).

    Parameters
    ----------
    progress : called before each run with the starts that are done, their number, and a note.

    Raises
    ------
    UsageError : there are fewer values than numbers to find, or no start can run.
    """
    from scipy.optimize import least_squares

    size = sum(len(series.t) for series in model.series)
    if size <= len(model.ranges):
        raise UsageError(f"{size} measured values cannot determine {len(model.ranges)} numbers")
    search = _Search(model)
    costs, best = [], None
    for i, start in enumerate(_starts(model, starts)):
        search.progress = partial(progress, i, starts)
        if not search.runs_at(start):
            continue
        found = least_squares(
            search.residuals, start, jac=search.jacobian, bounds=(0.0, 1.0), xtol=1e-12, ftol=1e-12
        )
        costs.append(float(found.cost))
        if best is None or found.cost < best.cost:
            best = found
    if best is None:
        raise UsageError(f"the graph runs at none of the starts: {search.failure}")
    u = np.clip(best.x, 0.0, 1.0)
    return _Judged(model, u, search.residuals(u), search.slopes(u, FINAL_STEP)).fit(costs)


@dataclass
class _Search:
    """The residuals as a function of u, for the optimiser."""

    model: Model
    progress: Callable[[str], None] = lambda note: None
    failure: str = ""
    lowest: float = math.inf

    def residuals(self, u: FloatArray) -> FloatArray:
        """Large where the graph cannot run."""
        try:
            found = self.model.residuals(_values(self.model.ranges, u))
        except (SimulationError, GraphError) as error:
            self.failure = str(error)
            return np.full(sum(len(series.t) for series in self.model.series), FAILED)
        cost = 0.5 * float(found @ found)
        if not math.isfinite(cost):
            return np.full(len(found), FAILED)
        self.lowest = min(self.lowest, cost)
        rms = math.sqrt(2.0 * self.lowest / len(found))
        self.progress(f"{self.model.count} runs; rms of the data's deviation {rms:.4g}")
        return found

    def runs_at(self, u: FloatArray) -> bool:
        return bool(self.residuals(u)[0] != FAILED)

    def jacobian(self, u: FloatArray) -> FloatArray:
        """Differences to one side, away from the nearer end."""
        base = self.residuals(u)
        columns = []
        for i, each in enumerate(u):
            step = SEARCH_STEP if each < 0.5 else -SEARCH_STEP
            columns.append((self.residuals(_move(u, i, step)) - base) / step)
        return np.column_stack(columns)

    def slopes(self, u: FloatArray, step: float) -> FloatArray:
        """Central differences; to one side at the ends of a range."""
        columns = []
        for i, each in enumerate(u):
            up, down = min(step, 1.0 - each), min(step, each)
            high, low = self.residuals(_move(u, i, up)), self.residuals(_move(u, i, -down))
            columns.append((high - low) / (up + down))
        return np.column_stack(columns)


def _move(u: FloatArray, i: int, step: float) -> FloatArray:
    moved = u.copy()
    moved[i] += step
    return moved


def _values(ranges: tuple[Range, ...], u: FloatArray) -> dict[str, float]:
    return {each.path: _between(each, float(x)) for each, x in zip(ranges, u, strict=True)}


def _between(each: Range, u: float) -> float:
    # Not Range.at, which rounds to twelve digits: differences would see the rounding.
    if each.scale == "log":
        return float(each.low * (each.high / each.low) ** u)
    return each.low + u * (each.high - each.low)


def _slope(each: Range, u: float) -> float:
    """How the number changes with u."""
    if each.scale == "log":
        return _between(each, u) * math.log(each.high / each.low)
    return each.high - each.low


def _starts(model: Model, count: int) -> Iterator[FloatArray]:
    """The graph's own numbers where they are in their ranges, then a Sobol sequence."""
    from scipy.stats import qmc

    graph, own = model.runs[0].graph, []
    for each in model.ranges:
        value = own_value(graph, each.path)
        u = 0.5
        if isinstance(value, (int, float)) and each.low <= value <= each.high:
            ends = (math.log, each.low, each.high) if each.scale == "log" else (float,)
            low, high, at = (ends[0](x) for x in (each.low, each.high, value))
            u = (at - low) / (high - low)
        own.append(u)
    # A start on an end could not move away from it.
    yield np.clip(own, 1e-3, 1.0 - 1e-3)
    if count > 1:
        sobol = qmc.Sobol(len(own), scramble=False)
        sobol.fast_forward(1)  # its first point is a corner
        power = math.ceil(math.log2(count))
        yield from np.clip(sobol.random(2**power)[: count - 1], 1e-3, 1.0 - 1e-3)


@dataclass
class _Judged:
    """The minimum, and what the residuals there say about each number."""

    model: Model
    u: FloatArray
    residuals: FloatArray
    slopes: FloatArray

    def fit(self, costs: list[float]) -> Fit:
        values = _values(self.model.ranges, self.u)
        notes = list(self._note_unidentified())
        reached = sum(cost <= min(costs) * (1.0 + SAME) + 1e-20 for cost in costs)
        if len(costs) > 1 and reached == 1:
            notes.append("only one start reached this minimum; try --starts with more")
        half = self._half_widths()
        parameters = []
        for i, each in enumerate(self.model.ranges):
            value, width = values[each.path], half[i] * abs(_slope(each, float(self.u[i])))
            at_end = bool(min(self.u[i], 1.0 - self.u[i]) < 1e-6)
            if at_end:
                notes.append(f"{each.path} is at the end of its range; widen it")
            low, high = value - width, value + width
            if each.scale == "log" and math.isfinite(half[i]):
                spread = math.exp(half[i] * math.log(each.high / each.low))
                low, high = value / spread, value * spread
            parameters.append(Parameter(each.path, value, low, high, at_end))
        seen = max(noise.seen for noise in self._noises)
        if seen > 0.2:
            notes.append(
                f"each difference is like the one before it (r = {seen:.2f}): the "
                "graph lacks something that is in the data; the intervals take it into account"
            )
        pairs = zip(self._parts(), self.model.series, strict=True)
        simulated = tuple(series.values + part * series.scale for part, series in pairs)
        effective = sum(noise.independent for noise in self._noises)
        return Fit(self.model, tuple(parameters), simulated, tuple(costs), effective, tuple(notes))

    @property
    def _ends(self) -> IntArray:
        return np.cumsum([len(series.t) for series in self.model.series])[:-1]

    def _parts(self) -> list[FloatArray]:
        return np.split(self.residuals, self._ends)

    @cached_property
    def _noises(self) -> list[Noise]:
        """Of each series."""
        slopes = np.split(self.slopes, self._ends)
        return [noise_of(*each) for each in zip(self._parts(), slopes, strict=True)]

    def _half_widths(self) -> FloatArray:
        """Half of each confidence interval of u; infinite along what the data do not determine."""
        from scipy.stats import t

        left, sizes, directions = np.linalg.svd(self.slopes, full_matrices=False)
        is_seen = sizes > SINGULAR * max(sizes[0], 1e-300)
        inverse = (left[:, is_seen] / sizes[is_seen]) @ directions[is_seen]
        spread, free = variances(self._noises, np.split(inverse, self._ends))
        half: FloatArray = t.ppf(0.5 + CONFIDENCE / 2.0, free) * np.sqrt(spread)
        for direction in directions[~is_seen]:
            half[np.abs(direction) > INVOLVED] = math.inf
        return half

    def _directions(self) -> tuple[FloatArray, FloatArray]:
        """How much the residuals change along each of the directions of u, largest first."""
        _, sizes, directions = np.linalg.svd(self.slopes, full_matrices=False)
        return sizes, directions

    def _note_unidentified(self) -> Iterator[str]:
        names = [each.path for each in self.model.ranges]
        sizes, directions = self._directions()
        for size, direction in zip(sizes, directions, strict=True):
            if size > SINGULAR * max(sizes[0], 1e-300):
                continue
            involved = [name for name, x in zip(names, direction, strict=True) if abs(x) > INVOLVED]
            if len(involved) == 1:
                yield f"the data do not depend on {involved[0]}"
            else:
                listed = f"{', '.join(involved[:-1])} and {involved[-1]}"
                yield f"the data do not tell {listed} apart: fix one of them"
        if sizes[-1] <= SINGULAR * max(sizes[0], 1e-300):
            return
        covariance = np.linalg.inv(self.slopes.T @ self.slopes)
        scale = np.sqrt(np.diag(covariance))
        for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
            r = float(covariance[i, j] / (scale[i] * scale[j]))
            if abs(r) > CORRELATED:
                yield f"{names[i]} and {names[j]} can hardly be told apart (correlation {r:.3f})"
