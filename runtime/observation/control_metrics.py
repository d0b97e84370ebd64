"""Metrics of control: what a controller spends, how smooth it is, and how it recovers.

In: recorded commands or errors, (rows,) or (rows, columns). Out: one number, as the root mean
square of ``[lqr.command.v, lqr.command.omega]``, each divided by its limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from blocks.core import FloatArray, param, show
from runtime.observation.metric_kinds import (
    POSITIVE,
    SHARE,
    Checks,
    MetricKind,
    MetricOptions,
    ProbeInfo,
    Series,
)


class ScaleOptions(MetricOptions):
    """The size by which each column is divided."""

    scale: FloatArray = param(
        1.0,
        above=0.0,
        shape=[(), ("columns",)],
        doc="what each column is divided by, such as its limit",
    )


class LimitOptions(MetricOptions):
    """The limits of a command."""

    limit: FloatArray = param(
        above=0.0, shape=[(), ("columns",)], doc="the largest possible size, or per column"
    )


class RecoveryOptions(MetricOptions):
    """A step in a fault, and when a signal has recovered from it."""

    at: float = param(unit="s", at_least=0.0, doc="time of the step")
    band: FloatArray = param(
        at_least=0.0,
        shape=[(), ("columns",)],
        doc="largest size that counts as recovered, or per column",
    )
    hold: float = param(
        1.0, unit="s", at_least=0.0, doc="how long before `until` it must have recovered"
    )


def _columns(series: Mapping[str, Series]) -> FloatArray:
    s = series["of"]
    return s.values.reshape(len(s.t), -1)


def effort(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """Root mean square of the columns' Euclidean norm, each divided by ``scale``."""
    scaled = _columns(series) / np.atleast_1d(options["scale"])
    return float(np.sqrt(np.mean(np.sum(scaled**2, axis=1))))


def effort_change(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """The same of the change from one row to the next; None with a single row."""
    changes = np.diff(_columns(series), axis=0) / np.atleast_1d(options["scale"])
    return float(np.sqrt(np.mean(np.sum(changes**2, axis=1)))) if len(changes) else None


def smoothness(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """Total variation per second: sum |u_k+1 - u_k| / duration (Skogestad, 2003)."""
    t = series["of"].t
    changes = np.abs(np.diff(_columns(series), axis=0)) / np.atleast_1d(options["scale"])
    return float(changes.sum() / (t[-1] - t[0])) if len(changes) else None


def saturation(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """Share of the rows in which a column is at its limit or beyond."""
    # A clipped command equals its limit up to rounding.
    reached = np.abs(_columns(series)) >= np.atleast_1d(options["limit"]) * (1.0 - 1e-9)
    return float(reached.any(axis=1).mean())


def recovery_time(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """Time (s) from ``at`` after which all columns stay within +-band up to ``until``.

    None if they are not within it for the last ``hold`` (s) before ``until``. NaN is outside.
    """
    t = series["of"].t
    last = t[-1] if options["until"] is None else options["until"]
    first, end = np.searchsorted(t, (options["at"] - 1e-9, last - 1e-9)).tolist()
    end = len(t) if options["until"] is None else end
    # Not `>`: a comparison with NaN is false, and NaN is outside.
    outside = ~(np.abs(_columns(series)[first:end]) <= np.atleast_1d(options["band"]))
    late = np.flatnonzero(outside.any(axis=1))
    first_inside = first + (int(late[-1]) + 1 if len(late) else 0)
    if first_inside >= end or t[end - 1] - t[first_inside] < options["hold"] - 1e-9:
        return None
    return max(0.0, float(t[first_inside]) - float(options["at"]))


def _check_times(options: Mapping[str, Any], probes: Mapping[str, ProbeInfo]) -> Checks:
    if options["until"] is not None and options["until"] <= options["at"]:
        message = f"must lie after at = {options['at']:g} s, got {show(options['until'])}"
        yield "until", message


CONTROL_KINDS: Mapping[str, MetricKind] = {
    "effort": MetricKind(
        effort,
        "root of the mean square of a command, its columns taken together, each divided by `scale`",
        options=ScaleOptions,
        forms=("columns",),
        ends=POSITIVE,
    ),
    "effort_change": MetricKind(
        effort_change,
        "the same of the change from one recorded row to the next",
        options=ScaleOptions,
        forms=("columns",),
        ends=POSITIVE,
    ),
    "smoothness": MetricKind(
        smoothness,
        "total variation per second: the sum of the sizes of all changes, each column divided by "
        "`scale`; smaller is smoother",
        options=ScaleOptions,
        unit="1/s",
        forms=("columns",),
        ends=POSITIVE,
    ),
    "saturation": MetricKind(
        saturation,
        "share of the rows in which a column is at its `limit` or beyond",
        options=LimitOptions,
        forms=("columns",),
        ends=SHARE,
    ),
    "recovery_time": MetricKind(
        recovery_time,
        "time (s) after the step `at` from which all columns stay within ±`band` up to `until`, "
        "for `hold` at least; null if never",
        options=RecoveryOptions,
        unit="s",
        forms=("columns",),
        agrees=_check_times,
        never="never recovered",
        ends=POSITIVE,
    ),
}
