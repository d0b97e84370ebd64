"""Metrics: one number from a recorded signal, each with its definition."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from blocks.params import show
from blocks.signals import FloatArray
from blocks.world import World
from runtime import wall_metrics

Checks = Iterable[tuple[str, str]]
Form = Literal["number", "place", "columns"]


@dataclass(frozen=True)
class Watched:
    """What is known of a probe before the run.

    shape : of a row. units : of its columns. every : ticks between two rows; 0 if there is one.
    """

    shape: tuple[int, ...]
    units: tuple[str, ...]
    every: int = 1

    @property
    def width(self) -> int:
        return math.prod(self.shape)


@dataclass(frozen=True)
class Series:
    """What a metric sees of a probe: times (rows,) and values (rows,) or (rows, columns)."""

    t: FloatArray
    values: FloatArray

    def after(self, start: float) -> Series:
        # Times ascend: a slice, which copies nothing.
        first = int(np.searchsorted(self.t, start - 1e-9))
        return Series(self.t[first:], self.values[first:])


@dataclass(frozen=True)
class Metric:
    """One metric of a graph; ``inputs`` maps its roles to probes (None: gone with its block)."""

    name: str
    kind: str
    inputs: Mapping[str, str | None]
    options: Mapping[str, Any] = field(default_factory=dict)

    def value(self, probes: Mapping[str, Series], world: World | None = None) -> float | None:
        """The metric's value; None where it has none (never settled, or not recorded)."""
        series = {}
        for role, name in self.inputs.items():
            if name is None or name not in probes:
                return None
            series[role] = probes[name].after(float(self.options.get("after", 0.0)))
        if any(not len(s.t) for s in series.values()):
            return None
        kind = KINDS[self.kind]
        if kind.in_world is None:
            number = kind.function(series, self.options)
        else:
            number = None if world is None else kind.in_world(world, _xy(series), self.options)
        return None if number is None or math.isnan(number) else float(number)

    def expectation(self, value: float | None) -> str:
        """What is wrong with a value under ``below`` and ``above``; '' if nothing is."""
        for key, holds in (("below", float.__lt__), ("above", float.__gt__)):
            bound = self.options.get(key)
            if bound is not None and (value is None or not holds(value, float(bound))):
                got = "none" if value is None else f"{value:g}"
                return f"metric '{self.name}': expected {key} {bound:g}, got {got}"
        return ""


@dataclass(frozen=True)
class Kind:
    """A kind of metric: its formula, the probes and the options that it takes.

    ``form`` is what it measures: one number, a place (x and y first), or any columns.
    ``in_world`` is a formula that needs the walls as well, in place of ``function``.
    """

    function: Callable[[Mapping[str, Series], Mapping[str, Any]], float | None]
    doc: str
    inputs: tuple[str, ...] = ("of",)
    options: tuple[str, ...] = ()
    required: tuple[str, ...] = ()
    forms: tuple[Form, ...] = ("number",)
    in_world: Callable[[World, FloatArray, Mapping[str, Any]], float] | None = None

    @property
    def keys(self) -> tuple[str, ...]:
        return (*self.inputs, *self.options, "after", "below", "above")

    def check(
        self, options: Mapping[str, Any], watched: Mapping[str, Watched], has_world: bool = True
    ) -> Checks:
        """Everything wrong with a metric's options and signals, as (key, text)."""
        if self.in_world is not None and not has_world:
            yield "kind", "needs a world, as in 'world: worlds/paper_room.yaml'"
        for key in ("distance", "turning_radius"):
            if key in self.options and key in options:
                value = options[key]
                if not _is_number(value) or value <= 0.0:
                    yield key, f"expected a number above 0 m, got {show(value)}"
        for key in ("after", "below", "above", "level"):
            if key in self.keys and key in options and not _is_number(options[key]):
                yield key, f"expected a number, got {show(options[key])}"
        if _is_number(options.get("after")) and options["after"] < 0.0:
            yield "after", f"expected a time from 0 s, got {options['after']:g}"
        for key in self.required:
            if key not in options:
                several = " or a list of numbers" if key in ("band", "q", "r") else ""
                yield key, f"missing; expected a number{several}"
        for role, signal in watched.items():
            said = self._misfit(signal)
            if said:
                yield role, said
        if "band" in self.options and "band" in options:
            yield from _check_band(options["band"], watched.get("of"))
        if "q" in self.options:
            yield from _check_weights(options, watched)

    def _misfit(self, signal: Watched) -> str:
        if len(signal.shape) > 1:
            return "expected a scalar, a record or a vector, got a table"
        is_place = signal.width > 1 and signal.units[0] == signal.units[1] == "m"
        if "columns" in self.forms or ("place" in self.forms and is_place):
            return ""
        if "number" not in self.forms:
            return "expected x and y in m, as in plant.pose"
        if signal.width == 1:
            return ""
        return f"expected one column, got {signal.width}; name one, as in plant.pose.theta"


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _check_band(band: Any, signal: Watched | None) -> Checks:
    bands = band if isinstance(band, list) else [band]
    if not bands or not all(_is_number(item) and item >= 0.0 for item in bands):
        yield "band", f"expected a number from 0, or one per column, got {show(band)}"
    elif isinstance(band, list) and signal is not None and len(band) != signal.width:
        yield "band", f"expected a number or {signal.width} numbers, got {show(band)}"


def _matrix(weight: Any, n: int) -> FloatArray:
    array = np.array(weight, dtype=float)
    return np.diag(array.reshape(n)) if array.shape == (n,) or n == array.size == 1 else array


def _check_weights(options: Mapping[str, Any], watched: Mapping[str, Watched]) -> Checks:
    for key, role in (("q", "state"), ("r", "command"), ("q_final", "state")):
        if key not in options:
            continue
        n = watched[role].width if role in watched else 0
        rows = options[key] if isinstance(options[key], list) else [options[key]]
        flat = [item for row in rows for item in (row if isinstance(row, list) else [row])]
        good = all(map(_is_number, flat))
        if good and n:
            try:
                good = _matrix(options[key], n).shape == (n, n)
            except ValueError:
                good = False
        if not good:
            size = f"{n} numbers or {n}x{n}" if n else "numbers"
            yield key, f"expected {size}, got {show(options[key])}"
    rates = {role: signal.every for role, signal in watched.items()}
    if len(set(rates.values())) > 1:
        told = " and ".join(
            f"{role} {f'every {n} ticks' if n else 'once'}" for role, n in rates.items()
        )
        yield "command", f"the two are recorded at different times, {told}; probe both alike"


def _flat(series: Mapping[str, Series]) -> FloatArray:
    return series["of"].values.reshape(len(series["of"].t))


def _xy(series: Mapping[str, Series]) -> FloatArray:
    return series["of"].values[:, :2]


def first_time(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """First time (s) at which the signal is above ``level``; None if never."""
    over = _flat(series) > float(options.get("level", 0.5))
    return float(series["of"].t[int(np.argmax(over))]) if over.any() else None


def share_above(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """Share of the recorded rows in which the signal is above ``level``."""
    return float((_flat(series) > float(options.get("level", 0.5))).mean())


def settling_time(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """First time (s) from which every column stays within +-band to the end; None if never."""
    s = series["of"]
    band = np.broadcast_to(
        np.atleast_1d(np.array(options["band"], dtype=float)), (1, *s.values.shape[1:])
    )
    outside = np.abs(s.values) > band
    late = np.flatnonzero(outside.reshape(len(s.t), -1).any(axis=1))
    if not len(late):
        return float(s.t[0])
    return None if late[-1] + 1 == len(s.t) else float(s.t[late[-1] + 1])


def path_length(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """Length (m) of the way that x and y of a pose have gone."""
    steps = np.diff(series["of"].values[:, :2], axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def displacement(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """Last value minus first; for a pose, the straight distance between the two."""
    values = series["of"].values
    change = values[-1] - values[0]
    if values.ndim == 1 or len(change) == 1:
        return float(np.squeeze(change))
    return float(np.hypot(change[0], change[1]))


def lqr_cost(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """The paper's J = 1/2 sum_{k=1}^{N-1} (x'Qx + u'Ru) + 1/2 x_N' Q_f x_N (section III-B)."""
    x, u = (s.values.reshape(len(s.t), -1) for s in (series["state"], series["command"]))
    q = _matrix(options["q"], x.shape[1])
    r = _matrix(options["r"], u.shape[1])
    q_final = _matrix(options.get("q_final", np.zeros(x.shape[1]).tolist()), x.shape[1])
    running = np.einsum("ki,ij,kj->", x[:-1], q, x[:-1]) + np.einsum(
        "ki,ij,kj->", u[:-1], r, u[:-1]
    )
    return float(0.5 * (running + x[-1] @ q_final @ x[-1]))


KINDS: dict[str, Kind] = {
    "settling_time": Kind(
        settling_time,
        "time from which all columns stay within +-band to the end (s); none if never",
        options=("band",),
        required=("band",),
        forms=("columns",),
    ),
    "mean_abs": Kind(lambda s, o: float(np.abs(_flat(s)).mean()), "mean of the absolute value"),
    "rms": Kind(lambda s, o: float(np.sqrt(np.mean(_flat(s) ** 2))), "root of the mean square"),
    "max_abs": Kind(lambda s, o: float(np.abs(_flat(s)).max()), "largest absolute value"),
    "min": Kind(lambda s, o: float(_flat(s).min()), "smallest value"),
    "final": Kind(lambda s, o: float(_flat(s)[-1]), "last value"),
    "first_time": Kind(
        first_time,
        "first time above level, 0.5 if not given (s); none if never",
        options=("level",),
    ),
    "share_above": Kind(
        share_above, "share of the time above level, 0.5 if not given", options=("level",)
    ),
    "path_length": Kind(path_length, "length of the way gone by a pose (m)", forms=("place",)),
    "displacement": Kind(
        displacement,
        "last value minus first; for a pose the straight distance",
        forms=("number", "place"),
    ),
    "lqr_cost": Kind(
        lqr_cost,
        "the paper's J: 1/2 sum (x'Qx + u'Ru) + 1/2 x_N' Q_f x_N",
        inputs=("state", "command"),
        options=("q", "r", "q_final"),
        required=("q", "r"),
        forms=("columns",),
    ),
    **{
        function.__name__: Kind(
            lambda s, o: None,
            (function.__doc__ or "").split(".")[0],
            options=("distance", *more),
            required=("distance", *more),
            forms=("place",),
            in_world=function,
        )
        for function, *more in (
            (wall_metrics.distance_mae,),
            (wall_metrics.distance_mae_cylinders,),
            (wall_metrics.distance_mae_reachable, "turning_radius"),
            (wall_metrics.distance_floor, "turning_radius"),
            (wall_metrics.strayed,),
            (wall_metrics.loops,),
        )
    },
}
