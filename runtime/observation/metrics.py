"""Metrics: one number from recorded signals; METRIC_KINDS is the registry of their kinds.

In: a metric of a graph and the recorded probes. Out: its value, None if it has none::

    miss: {kind: rms, of: error.lateral, after: 2, below: 0.05}
    metric = Metric("miss", "rms", {"of": "error.lateral"}, {"after": 2, "below": 0.05})
    metric.value(probes)    # 0.021
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core import FloatArray, param
from blocks.library.extensions import Registry
from blocks.world import World
from runtime.document import in_time
from runtime.observation import (
    control_metrics,
    neural_metrics,
    response_metrics,
    wall_metrics,
)
from runtime.observation.metric_kinds import (
    POSITIVE,
    SHARE,
    Bounds,
    Checks,
    MetricKind,
    MetricOptions,
    NumberOptions,
    alike,
)
from runtime.observation.metric_kinds import ProbeInfo as ProbeInfo
from runtime.observation.metric_kinds import Series as Series
from runtime.streaming import row_blocks

# The kinds of metrics whose values are not those of a signal.
STOP_TIME, CRASHED = "stop_time", "crashed"
OF_RUN = (STOP_TIME, CRASHED)
REFERENCE = "reference"
# A switch such as ``explore.engaged`` is on above this level.
ENGAGED = 0.5


@dataclass(frozen=True)
class Metric:
    """One metric of a graph; ``inputs`` maps its roles to probes, None if its block is removed.

    ``own`` is its kind if a Python file of the graph defines it.
    """

    name: str
    kind: str
    inputs: Mapping[str, str | None]
    options: Mapping[str, Any] = field(default_factory=dict)
    own: MetricKind | None = None

    @property
    def definition(self) -> MetricKind:
        """Its kind."""
        return METRIC_KINDS[self.kind] if self.own is None else self.own

    @cached_property
    def _read(self) -> dict[str, Any]:
        """The options as numbers, read once for all trials of an experiment."""
        return self.definition.options.read(self.options)

    def value(self, probes: Mapping[str, Series], world: World | None = None) -> float | None:
        """The metric's value; None if it has none (never settled, or not recorded)."""
        if not self.is_recorded(probes):
            return None
        after, until = self._read.get("after", 0.0), self._read.get("until")
        end = math.inf if until is None else until
        if any(_ends_before(probes[name].t, end) for name in self.inputs.values() if name):
            return None  # the run stopped before: a shorter window would be another quantity
        series = {
            # A reference that is constant has one row, at the start.
            role: probes[name]
            if role == REFERENCE and len(probes[name].t) == 1
            else probes[name].between(after, end)
            for role, name in self.inputs.items()
            if name
        }
        if any(not len(s.t) for s in series.values()):
            return None
        if "engaged" in series:
            # From the first row in which the switch is on, with which a robot's wandering before is
            # left out.
            engaged = first_time({"of": series["engaged"]}, {"level": ENGAGED})
            series["of"] = series["of"].between(math.inf if engaged is None else engaged)
        number = self.definition.measured(series, self._read, world)
        return None if number is None or math.isnan(number) else float(number)

    def beyond(self, end: float, time_unit: str) -> str:
        """Why a run that ends at this time (s) gives it no value; '' if it can have one."""
        after, until = self.options.get("after"), self.options.get("until")
        text = f"metric '{self.name}' has no value: it looks at times"
        if isinstance(after, (int, float)) and after > end:
            return f"{text} after {after:g} {time_unit}"
        if isinstance(until, (int, float)) and until > end + 1e-9:
            return f"{text} until {until:g} {time_unit}, and the run ends at {end:g} {time_unit}"
        return ""

    @property
    def never(self) -> str:
        """What it means that it has no value, where that is worse than any; see MetricKind."""
        return self.definition.never

    def is_recorded(self, probes: Container[str]) -> bool:
        """Whether all signals that it measures are recorded."""
        return all(name is not None and name in probes for name in self.inputs.values())

    def unit(self, units: Mapping[str, tuple[str, ...]], time_unit: str) -> str:
        """The unit of its value, given the units of the probes' columns; '' if it has none."""
        unit_of_kind = self.definition.unit
        columns = units.get(self.inputs.get("of") or "", ())
        first, *rest = unit_of_kind.split() or [""]
        own = columns[0] if columns and not self.options.get("expression") else ""
        if first == "of²":
            # The square of m/s is (m/s)², of m is m².
            first = f"({own})²" if re.search(r"\W", own) else f"{own}²" if own else ""
        else:
            first = own if first == "of" else in_time(first, time_unit)
        return " ".join([first, *(in_time(word, time_unit) for word in rest)]).strip()

    def expectation(self, value: float | None) -> str:
        """How a value violates ``below`` or ``above``; '' if it does not."""
        for key, holds in (("below", float.__lt__), ("above", float.__gt__)):
            level = self.options.get(key)
            if level is not None and (value is None or not holds(value, float(level))):
                got = "none" if value is None else f"{value:g}"
                return f"metric '{self.name}': expected {key} {level:g}, got {got}"
        return ""


def _ends_before(t: FloatArray, end: float) -> bool:
    """Whether rows at times t (s) end before a window does; a constant has one row."""
    return len(t) > 1 and math.isfinite(end) and 2.0 * t[-1] - t[-2] < end - 1e-9


def _matrix(weight: Any, n: int) -> FloatArray:
    array = np.array(weight, dtype=float)
    return np.diag(array.reshape(n)) if array.shape == (n,) or n == array.size == 1 else array


class SettlingOptions(response_metrics.TargetOptions):
    """When a signal is settled."""

    band: FloatArray = param(
        at_least=0.0,
        shape=[(), ("columns",)],
        doc="largest size that is settled, or per column",
    )
    hold: float = param(
        1.0, unit="s", at_least=0.0, doc="how long before the end of the run it must be settled"
    )


class LevelOptions(NumberOptions):
    """The level that a signal is compared with."""

    level: float = param(0.5, doc="the level")


class TimeOptions(NumberOptions):
    """The time at which a signal is read."""

    at: float = param(unit="s", at_least=0.0, doc="the time; between two rows it is interpolated")


class CrashOptions(Bounds):
    """What counts as a crash."""

    stop: bool = param(True, doc="whether a run that `run.stop` ended counts, too")


class WeightOptions(MetricOptions):
    """The weights of the paper's cost: one number per column, or a matrix."""

    q: FloatArray = param(shape=[(), ("state",), ("state", "state")], doc="weights Q of the state")
    r: FloatArray = param(
        shape=[(), ("command",), ("command", "command")], doc="weights R of the command"
    )
    q_final: FloatArray | None = param(
        None, shape=[(), ("state",), ("state", "state")], doc="weights Q_f of the last state"
    )


def _same_rows(options: Mapping[str, Any], probes: Mapping[str, ProbeInfo]) -> Checks:
    """A single number weights only one column; state and command need the same rate."""
    for key, role in (("q", "state"), ("r", "command"), ("q_final", "state")):
        n = probes[role].width if role in probes else 1
        weight = options[key]
        if weight is not None and n != 1 and np.ndim(weight) == 0:
            message = f"expected {WeightOptions.declared[key].describe({role: n})}"
            yield key, f"{message.replace('a number or ', '')}, got {float(weight):g}"
    rates = {role: (signal.every, signal.first) for role, signal in probes.items()}
    if len(set(rates.values())) > 1:
        text = " and ".join(
            f"{role} {f'every {n} ticks' if n else 'once'}{f' from {first}' if first else ''}"
            for role, (n, first) in rates.items()
        )
        yield "command", f"the two are recorded at different times, {text}; probe both alike"


def _flat(series: Mapping[str, Series]) -> FloatArray:
    return series["of"].values.reshape(len(series["of"].t))


def first_time(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """First time (s) at which the signal is above ``level``; None if never."""
    over = _flat(series) > options["level"]
    return float(series["of"].t[int(np.argmax(over))]) if over.any() else None


def share_above(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """Share of the recorded rows in which the signal is above ``level``."""
    return float((_flat(series) > options["level"]).mean())


def settling_time(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """First time (s) from which every column stays within +-band to the end; None if never.

    A signal that reaches the band less than ``hold`` (s) before the last sample may leave it later:
    it is not settled.
    """
    s = response_metrics.deviation(series, options)
    band = np.broadcast_to(np.atleast_1d(options["band"]), (1, *s.values.shape[1:]))
    first = 0
    # In blocks, since the recording may be larger than memory; the last row outside decides.
    for rows, (values,) in row_blocks(s.values):
        outside = ~(np.abs(values) <= band)  # NaN is outside, too
        late = np.flatnonzero(outside.reshape(len(values), -1).any(axis=1))
        first = rows.start + int(late[-1]) + 1 if len(late) else first
    if first == len(s.t) or s.t[-1] - s.t[first] < float(options["hold"]) - 1e-9:
        return None
    return float(s.t[first])


def value_at(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """The value at a time (s); None if the recording ends before it, or begins later."""
    t, values = series["of"].t, _flat(series)
    if not t[0] - 1e-9 <= options["at"] <= t[-1] + 1e-9:
        return None
    return float(np.interp(options["at"], t, values))


def _resultant(series: Mapping[str, Series]) -> complex:
    """The mean of unit vectors in the directions of a signal (Mardia and Jupp, 2000, 2.2)."""
    return complex(np.exp(1j * _flat(series)).mean())


def circular_mean(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """The mean direction (rad); None if the directions cancel each other."""
    mean = _resultant(series)
    return float(np.angle(mean)) if abs(mean) > 1e-12 else None


def circular_deviation(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """The circular standard deviation sqrt(-2 ln R) (rad); R is the length of the mean vector."""
    return math.sqrt(max(0.0, -2.0 * math.log(max(abs(_resultant(series)), 1e-300))))


def of_run(
    kind: str, options: Mapping[str, Any], stopped_at: float | None, failed: bool = False
) -> float | None:
    """A metric of the run itself: when ``run.stop`` ended it, or whether it crashed."""
    if kind == STOP_TIME:
        return stopped_at
    stops = stopped_at is not None and CrashOptions.read(options)["stop"]
    return float(failed or stops)


def path_length(series: Mapping[str, Series], options: Mapping[str, Any]) -> float:
    """Length (m) of the path of a pose's x and y."""
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
    last = options["q_final"]
    q_final = _matrix(np.zeros(x.shape[1]) if last is None else last, x.shape[1])
    running = np.einsum("ki,ij,kj->", x[:-1], q, x[:-1]) + np.einsum(
        "ki,ij,kj->", u[:-1], r, u[:-1]
    )
    return float(0.5 * (running + np.einsum("i,ij,j->", x[-1], q_final, x[-1])))


_OWN: dict[str, MetricKind] = {
    "settling_time": MetricKind(
        settling_time,
        "first time (s) from which all columns stay within ±`band` of `target` or of the signal "
        "`reference` to the end, for `hold` at least; null if never",
        options=SettlingOptions,
        optional=(REFERENCE,),
        agrees=alike,
        unit="s",
        forms=("columns",),
        never="never settled",
        ends=POSITIVE,
    ),
    "mean_abs": MetricKind(
        lambda s, o: float(np.abs(_flat(s)).mean()),
        "mean of the absolute value",
        unit="of",
        ends=POSITIVE,
    ),
    "rms": MetricKind(
        lambda s, o: float(np.sqrt(np.mean(_flat(s) ** 2))),
        "root of the mean square; with `length`, of the Euclidean length: the squares of the "
        "components are added, not averaged",
        unit="of",
        ends=POSITIVE,
    ),
    "max_abs": MetricKind(
        lambda s, o: float(np.abs(_flat(s)).max()),
        "largest absolute value",
        unit="of",
        ends=POSITIVE,
    ),
    "mean": MetricKind(lambda s, o: float(_flat(s).mean()), "mean value", unit="of"),
    "max": MetricKind(lambda s, o: float(_flat(s).max()), "largest value", unit="of"),
    "min": MetricKind(lambda s, o: float(_flat(s).min()), "smallest value", unit="of"),
    "final": MetricKind(lambda s, o: float(_flat(s)[-1]), "last value", unit="of"),
    "first_time": MetricKind(
        first_time,
        "first time (s) above `level`; null if never",
        options=LevelOptions,
        unit="s",
        ends=POSITIVE,
    ),
    STOP_TIME: MetricKind(
        lambda s, o: None,
        "time (s) at which `run.stop` ended the run; null if it did not",
        options=Bounds,
        inputs=(),
        unit="s",
        ends=POSITIVE,
    ),
    CRASHED: MetricKind(
        lambda s, o: None,
        "1 if the run failed (an exception, NaN or infinity) or `run.stop` ended it, else 0; its "
        "mean over seeds is the share of crashes",
        options=CrashOptions,
        inputs=(),
        ends=SHARE,
    ),
    "value_at": MetricKind(
        value_at,
        "value at the time `at`; null if the run ended before",
        options=TimeOptions,
        unit="of",
    ),
    "circular_mean": MetricKind(circular_mean, "mean direction of an angle (rad)", unit="rad"),
    "circular_deviation": MetricKind(
        circular_deviation,
        "circular standard deviation of an angle (rad): sqrt(-2 ln R) of the mean length R",
        unit="rad",
        ends=POSITIVE,
    ),
    "share_above": MetricKind(
        share_above,
        "share of the time above `level`",
        options=LevelOptions,
        ends=SHARE,
    ),
    "path_length": MetricKind(
        path_length,
        "length of the path of a pose (m)",
        options=MetricOptions,
        forms=("position",),
        unit="m",
        ends=POSITIVE,
    ),
    "displacement": MetricKind(
        displacement,
        "last value minus first; for a pose the straight distance",
        options=MetricOptions,
        forms=("number", "position"),
        unit="of",
    ),
    "lqr_cost": MetricKind(
        lqr_cost,
        "the paper's J: 1/2 sum (x'Qx + u'Ru) + 1/2 x_N' Q_f x_N",
        inputs=("state", "command"),
        options=WeightOptions,
        forms=("columns",),
        agrees=_same_rows,
    ),
    **response_metrics.RESPONSE_KINDS,
    **control_metrics.CONTROL_KINDS,
    **neural_metrics.NEURAL_KINDS,
    **wall_metrics.WALL_KINDS,
}

# Those of the library, and by their names those of packages.
METRIC_KINDS: Registry[MetricKind] = Registry("metrics", MetricKind, "a MetricKind", own=_OWN)
