"""Metrics of a response: how a signal approaches a target, and integrals of what is left."""

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
)


class Target(MetricOptions):
    """Where a signal should go."""

    target: float = param(0.0, doc="where the signal should go, if there is no `reference`")


class Deviation(NumberOptions):
    """Where a signal should go, of which the deviation is one number."""

    target: float = param(0.0, doc="where the signal should go, if there is no `reference`")


class Steady(Deviation):
    """The end of a response."""

    window: float = param(1.0, unit="s", above=0.0, doc="the mean is over so long before the end")


class Rise(Target):
    """Two shares of a step."""

    low: float = param(0.1, at_least=0.0, below=1.0, doc="share of the step where the rise begins")
    high: float = param(0.9, above=0.0, at_most=1.0, doc="share of the step where it ends")


def deviation(series: Mapping[str, Series], options: Mapping[str, Any]) -> Series:
    """The signal minus its reference, or minus ``target``."""
    of, reference = series["of"], series.get("reference")
    wanted = options["target"] if reference is None else reference.values
    found = Series(of.t, of.values - wanted) if reference is not None or wanted else of
    return length_of(found) if options.get("length") else found


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
    left = _flat(deviation(series, options))
    if left[0] == 0.0:
        return None
    return max(0.0, float((left / -left[0]).max()))


def rise_time(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """Time (s) from ``low`` to ``high`` of the step, linear between rows; None if not reached."""
    s = deviation(series, options)
    left = _flat(s)
    if left[0] == 0.0:
        return 0.0
    done = 1.0 - left / left[0]
    at = []
    for share in (options["low"], options["high"]):
        k = int(np.argmax(done >= share))
        if not done[k] >= share:
            return None
        part = (share - done[k - 1]) / (done[k] - done[k - 1]) if k else 1.0
        at.append(s.t[k] if not k else s.t[k - 1] + part * (s.t[k] - s.t[k - 1]))
    return float(at[1] - at[0])


def _rising(options: Mapping[str, Any], probes: Mapping[str, ProbeInfo]) -> Checks:
    yield from alike(options, probes)
    found = Rise.read(options)
    if found["high"] <= found["low"]:
        yield "high", f"must be above low = {found['low']:g}, got {show(found['high'])}"


def _kind(formula: Any, doc: str, unit: str, **more: Any) -> MetricKind:
    """A metric of the deviation of a signal from its target or its reference."""
    kept = {"options": Deviation, "agrees": alike, "ends": POSITIVE, **more}
    return MetricKind(formula, doc, unit=unit, optional=("reference",), **kept)


RESPONSE_KINDS: Mapping[str, MetricKind] = {
    "overshoot": _kind(
        overshoot,
        "how far the signal goes beyond `target` or the signal `reference`, as a share of the "
        "step from its first value; null without a step",
        "",
        options=Target,
    ),
    "rise_time": _kind(
        rise_time,
        "time (s) from the share `low` to the share `high` of the step from the first value to "
        "`target` or the signal `reference`; null if never",
        "s",
        options=Rise,
        agrees=_rising,
        never="never reached",
    ),
    "steady_state_error": _kind(
        steady_state_error,
        "absolute value of the mean deviation from `target` or the signal `reference` over the "
        "last `window`",
        "of",
        options=Steady,
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
