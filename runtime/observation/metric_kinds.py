"""What a kind of metric declares: its formula, its options and its signals.

In: the options and signals of an entry. Out: their errors before the run, and the value after it::

    RMS = MetricKind(lambda series, options: math.sqrt((series["of"].values ** 2).mean()),
                     "root of the mean square", unit="of", ends=POSITIVE)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from blocks.core import ExpressionError, FloatArray, Options, expression_function, param, show
from blocks.world import World
from runtime.observation.kinds import NEEDS_WORLD

Checks = Iterable[tuple[str, str]]
Form = Literal["number", "position", "columns"]
ENGAGED = "engaged"  # the role of a switch that begins what is measured
# Where the values of a metric may lie.
ANY, POSITIVE, SHARE = (-math.inf, math.inf), (0.0, math.inf), (0.0, 1.0)


@dataclass(frozen=True)
class ProbeInfo:
    """A probe as it is known before the run.

    shape : of a row. units : of its columns. every : ticks between two rows; 0 for a constant.
    first : the tick of the first row.
    """

    shape: tuple[int, ...]
    units: tuple[str, ...]
    every: int = 1
    first: int = 0

    @property
    def width(self) -> int:
        return math.prod(self.shape)


@dataclass(frozen=True)
class Series:
    """The rows of a probe for a metric: times (rows,), values (rows,) or (rows, columns)."""

    t: FloatArray
    values: FloatArray

    # Times are k * dt: a row at 0.30000000000000004 s is one at 0.3 s.
    def between(self, start: float, end: float = math.inf) -> Series:
        """The rows from ``start`` on and before ``end`` (s), up to rounding."""
        # Times ascend, so a slice is enough; it copies nothing.
        first, last = np.searchsorted(self.t, (start - 1e-9, end - 1e-9)).tolist()
        return Series(self.t[first:last], self.values[first:last])


class Bounds(Options):
    """The options of every metric."""

    below: float | None = param(None, doc="expectation: the value is smaller than this")
    above: float | None = param(None, doc="expectation: the value is larger than this")


class MetricOptions(Bounds):
    """The options of metrics of signals."""

    after: float = param(0.0, unit="s", at_least=0.0, doc="rows before this time do not count")
    until: float | None = param(
        None,
        unit="s",
        above=0.0,
        doc="rows from this time on do not count; a run that ends before has no value; "
        "default: the end",
    )


class NumberOptions(MetricOptions):
    """The options of metrics of one number."""

    length: bool = param(
        False, doc="of several columns of one unit, as those of a vector, measure the length"
    )
    expression: str | None = param(
        None, doc="measure this number of the columns `u` and the time `t`, as `u[0] - 2*u[1]`"
    )
    wrap: bool = param(
        False, doc="the signal, or its deviation, is an angle in rad: wrap it to -pi to pi"
    )


def alike(options: Mapping[str, Any], probes: Mapping[str, ProbeInfo]) -> Checks:
    """Errors of a signal and its reference; a constant reference fits signals of any rate."""
    of, reference = probes.get("of"), probes.get("reference")
    if of is None or reference is None:
        return
    if of.width != reference.width:
        message = f"has {reference.width} columns and 'of' has {of.width}; expected as many"
        yield "reference", message
    if of.every != reference.every and reference.every:
        yield "reference", "is recorded at another rate than 'of'; give both the same 'every'"
    elif of.first != reference.first and reference.every:
        yield "reference", "is recorded on other ticks than 'of'; give both probes 'every: 1'"


@dataclass(frozen=True)
class MetricKind:
    """A kind of metric: its formula, its signals and its options.

    ``options`` declares the options; shapes in it may name the roles in ``inputs``, which stand
    for the number of columns of that signal, or ``columns`` for those of ``of``. ``optional`` are
    roles that may be missing. ``forms`` are the signals it accepts: one number, a position (x and
    y first), or any columns. ``in_world`` is a formula that also needs the walls, instead of
    ``function``. ``agrees`` checks conditions across options, with their defaults, and signals.
    ``unit`` is that of the value; ``of`` stands for the unit of the signal. ``ends`` are the least
    and the largest value that it can have. ``never`` says what no value means where that is worse
    than any value, as of a time until something good (``never settled``); experiments count it as
    infinite.
    """

    function: Callable[[Mapping[str, Series], Mapping[str, Any]], float | None]
    doc: str
    options: type[Options] = NumberOptions
    inputs: tuple[str, ...] = ("of",)
    optional: tuple[str, ...] = ()
    forms: tuple[Form, ...] = ("number",)
    in_world: Callable[[World, FloatArray, Mapping[str, Any]], float] | None = None
    agrees: Callable[[Mapping[str, Any], Mapping[str, ProbeInfo]], Checks] | None = None
    unit: str = ""
    never: str = ""
    ends: tuple[float, float] = ANY

    @property
    def keys(self) -> tuple[str, ...]:
        return (*self.inputs, *self.optional, *self.options.declared)

    def value(
        self,
        series: Mapping[str, Series],
        written: Mapping[str, Any],
        world: World | None = None,
    ) -> float | None:
        """The metric of some series, with the options as written."""
        return self.measured(series, self.options.read(written), world)

    def measured(
        self, series: Mapping[str, Series], options: Mapping[str, Any], world: World | None = None
    ) -> float | None:
        """The metric of some series, with options that were read."""
        if options.get("expression"):
            series = {**series, "of": computed(series["of"], options["expression"])}
        if "target" not in options:  # else of the deviation from it
            if options.get("length"):
                series = {role: length_of(each) for role, each in series.items()}
            if options.get("wrap"):
                series = {role: wrapped(each) for role, each in series.items()}
        if self.in_world is None:
            return self.function(series, options)
        positions = series["of"].values[:, :2]
        return None if world is None else self.in_world(world, positions, options)

    def check(
        self, options: Mapping[str, Any], probes: Mapping[str, ProbeInfo], has_world: bool = True
    ) -> Checks:
        """All errors in a metric's options and signals, as (key, text)."""
        if self.in_world is not None and not has_world:
            yield "kind", NEEDS_WORLD
        sizes = {role: signal.width for role, signal in probes.items()}
        # Shapes of options say 'columns' for as many as the signal has.
        if "of" in sizes:
            sizes["columns"] = sizes["of"]
        faults = dict(self.options.check(options, sizes))
        yield from faults.items()
        # Options that are wrong cannot be read, and what they mean together is then unknown.
        window = self.options.read(options) if not faults else {}
        if window.get("until") is not None and window["until"] <= window["after"]:
            yield (
                "until",
                f"must lie after after = {window['after']:g}, got {show(window['until'])}",
            )
        expression = window.get("expression")
        if expression and "of" in probes:
            try:
                expression_function(expression, {"u": sizes["of"], "t": None})
            except ExpressionError as error:
                yield "expression", str(error)
        for role, signal in probes.items():
            if expression and role == "of" and len(signal.shape) < 2:
                continue
            message = self._misfit(role, signal, window.get("length") is True)
            if message:
                yield role, message
        if self.agrees is not None and not faults:
            yield from self.agrees(window, probes)

    def _misfit(self, role: str, signal: ProbeInfo, is_length: bool) -> str:
        if len(signal.shape) > 1:
            return "expected a scalar, a record or a vector, got a table"
        if is_length:
            units = dict.fromkeys(signal.units)
            if len(units) == 1:
                return ""
            return f"columns in {', '.join(map(repr, units))} have no common length; name some"
        if role == ENGAGED:
            return "" if signal.width == 1 else "expected one column, as in explore.engaged"
        is_position = signal.width > 1 and signal.units[0] == signal.units[1] == "m"
        if "columns" in self.forms or ("position" in self.forms and is_position):
            return ""
        if "number" not in self.forms:
            return "expected x and y in m, as in plant.pose"
        if signal.width == 1:
            return ""
        has_length = "length" in self.options.declared and len(set(signal.units)) == 1
        return (
            f"expected one column, got {signal.width}; name one, as in plant.pose.theta"
            f"{', or write length: true' * has_length}"
        )


def length_of(series: Series) -> Series:
    """The Euclidean norm of each row."""
    rows = series.values.reshape(len(series.t), -1)
    return Series(series.t, np.sqrt(np.square(rows).sum(axis=1)))


def wrapped(series: Series) -> Series:
    """Angles (rad) between -pi and pi."""
    return Series(series.t, np.remainder(series.values + math.pi, math.tau) - math.pi)


def computed(series: Series, expression: str) -> Series:
    """A number of each row: an expression of its columns ``u`` and the time ``t``."""
    rows = series.values.reshape(len(series.t), -1)
    function = expression_function(expression, {"u": rows.shape[1], "t": None})
    values = [function(row, t) for row, t in zip(rows.tolist(), series.t.tolist(), strict=True)]
    return Series(series.t, np.array(values, dtype=float))
