"""Metrics of a response: how a signal approaches a target, and integrals of what is left.

In: a signal and its target or reference. Out: one number. A step from 0 to a target of 2 whose
largest value is 2.3 has an overshoot of 0.15.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from blocks.core import FloatArray, param, show
from runtime.observation.metric_kinds import (
    POSITIVE,
    Checks,
    MetricKind,
    MetricOptions,
    NumberOptions,
    ProbeInfo,
    Series,
    alike,
    length_of,
    wrapped,
)


class TargetOptions(MetricOptions):
    """Where a signal should go."""

    target: float = param(0.0, doc="where the signal should go, if there is no `reference`")


class DeviationOptions(NumberOptions):
    """Where a signal should go, of which the deviation is one number."""

    target: float = param(0.0, doc="where the signal should go, if there is no `reference`")


class SteadyOptions(DeviationOptions):
    """The end of a response."""

    window: float = param(1.0, unit="s", above=0.0, doc="the mean is over so long before the end")


class RiseOptions(TargetOptions):
    """Two shares of a step."""

    low: float = param(0.1, at_least=0.0, below=1.0, doc="share of the step where the rise begins")
    high: float = param(0.9, above=0.0, at_most=1.0, doc="share of the step where it ends")


def deviation(series: Mapping[str, Series], options: Mapping[str, Any]) -> Series:
    """The signal minus its reference, or minus ``target``."""
    of, reference = series["of"], series.get("reference")
    target = options["target"] if reference is None else reference.values
    difference = Series(of.t, of.values - target) if reference is not None or target else of
    difference = wrapped(difference) if options.get("wrap") else difference
    return length_of(difference) if options.get("length") else difference


def _flat(series: Series) -> FloatArray:
    return series.values.reshape(len(series.t))


def _trapezoid(y: FloatArray, t: FloatArray) -> float:
    """The integral by the trapezoidal rule; numpy's function has another name in version 1."""
    return 0.5 * float(((y[1:] + y[:-1]) * np.diff(t)).sum())


def _integral(series: Mapping[str, Series], options: Mapping[str, Any], power: int) -> float:
    """The integral of t^power |deviation| dt by the trapezoidal rule, t from the first row."""
    s = deviation(series, options)
    return _trapezoid(np.abs(_flat(s)) * (s.t - s.t[0]) ** power, s.t)


def ise(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """The integral of the squared deviation."""
    s = deviation(series, options)
    return _trapezoid(_flat(s) ** 2, s.t)


def energy(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """The integral of the squared Euclidean norm of all columns."""
    of = series["of"]
    return _trapezoid(np.square(of.values.reshape(len(of.t), -1)).sum(axis=1), of.t)


def steady_state_error(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """Absolute value of the mean deviation over the last ``window``; None in a shorter signal."""
    s = deviation(series, options)
    if s.t[-1] - s.t[0] < options["window"] - 1e-9:
        return None
    return abs(float(_flat(s.between(float(s.t[-1]) - options["window"])).mean()))


def overshoot(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """How far the signal goes beyond its target, as a share of the step; None without a step.

    The step goes from the first value to the target at the end.
    """
    error = _flat(deviation(series, options))
    if error[0] == 0.0:
        return None
    # The deviation begins at error[0] and has the other sign beyond the target.
    return max(0.0, float((error / -error[0]).max()))


def rise_time(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """Time (s) from ``low`` to ``high`` of the step, linear between rows; None if not reached."""
    s = deviation(series, options)
    error = _flat(s)
    if error[0] == 0.0:
        return 0.0
    progress = 1.0 - error / error[0]
    at = []
    for share in (options["low"], options["high"]):
        k = int(np.argmax(progress >= share))
        if not progress[k] >= share:
            return None
        # Between the rows before and after the crossing; row 0 has none before.
        part = (share - progress[k - 1]) / (progress[k] - progress[k - 1]) if k else 1.0
        at.append(s.t[k] if not k else s.t[k - 1] + part * (s.t[k] - s.t[k - 1]))
    return float(at[1] - at[0])


def _rising(options: Mapping[str, Any], probes: Mapping[str, ProbeInfo]) -> Checks:
    yield from alike(options, probes)
    if options["high"] <= options["low"]:
        yield "high", f"must be above low = {options['low']:g}, got {show(options['high'])}"


def _kind(formula: Any, doc: str, unit: str, **more: Any) -> MetricKind:
    """A metric of the deviation of a signal from its target or its reference."""
    arguments = {"options": DeviationOptions, "agrees": alike, "ends": POSITIVE, **more}
    return MetricKind(formula, doc, unit=unit, optional=("reference",), **arguments)


RESPONSE_KINDS: Mapping[str, MetricKind] = {
    "overshoot": _kind(
        overshoot,
        "how far the signal goes beyond `target` or the signal `reference`, as a share of the "
        "step from its first value; null without a step",
        "",
        options=TargetOptions,
    ),
    "rise_time": _kind(
        rise_time,
        "time (s) from the share `low` to the share `high` of the step from the first value to "
        "`target` or the signal `reference`; null if never",
        "s",
        options=RiseOptions,
        agrees=_rising,
        never="never reached",
    ),
    "steady_state_error": _kind(
        steady_state_error,
        "absolute value of the mean deviation from `target` or the signal `reference` over the "
        "last `window`",
        "of",
        options=SteadyOptions,
    ),
    "iae": _kind(
        lambda s, o: _integral(s, o, 0),
        "integral of the absolute deviation from `target` or the signal `reference`",
        "of s",
    ),
    "ise": _kind(ise, "integral of the squared deviation, likewise", "of² s"),
    "itae": _kind(
        lambda s, o: _integral(s, o, 1),
        "integral of time times the absolute deviation, likewise; time counts from `after`",
        "of s²",
    ),
    "energy": MetricKind(
        energy,
        "integral of the square of a signal, its columns taken together",
        options=MetricOptions,
        forms=("columns",),
        unit="of² s",
        ends=POSITIVE,
    ),
}
