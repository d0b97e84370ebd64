"""Signals that interpolate given values over time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Output,
    ParameterError,
    Same,
    Scalar,
    SignalType,
    Vector,
    check_ascending,
    param,
    piece,
)

METHODS = ("hold", "linear", "cubic")


class Table(Block, ABC):
    """A source whose value follows rows of numbers over time."""

    out = Output(Same("T"), doc="the interpolated value")

    @property
    @abstractmethod
    def rows(self) -> tuple[FloatArray, FloatArray]:
        """Times (n,) and values (n,) or (n, k)."""

    @property
    @abstractmethod
    def how(self) -> str:
        """One of METHODS."""

    @property
    def stepwise(self) -> bool:
        return self.how == "hold"

    def edges(self, until: float) -> FloatArray:
        return self.rows[0] if self.how == "hold" else self.rows[0][[0, -1]]

    @property
    def stated(self) -> SignalType | None:
        """The output's type, if it is stated."""
        return None

    @cached_property
    def resolved(self) -> SignalType:
        """The output's type: a number, or as many components as there are columns."""
        values = self.rows[1]
        kind = self.stated or (Scalar if values.ndim == 1 else Vector(values.shape[1]))
        return kind.sized(values.shape[-1]) if kind.symbol and values.ndim == 2 else kind

    @property
    def variables(self) -> dict[str, SignalType]:
        return {"T": self.resolved}

    def check_type(self, parameter: str) -> None:
        """Check that the stated type has one component per column, and fits the values.

        Raises
        ------
        ParameterError : it has not, or a value of ``parameter`` is infinite where the type has no
            misses, or where it would be interpolated.
        """
        values = self.rows[1]
        if self.resolved.symbol or self.resolved.shape != values.shape[1:]:
            count = values.shape[1] if values.ndim == 2 else 1
            message = f"expected a type of {count} component(s), one per column, got {self.stated}"
            raise ParameterError([("signal", message)])
        problem = self.resolved.wrong(values)
        if not problem and self.how != "hold" and np.isinf(values).any():
            problem = "there are infinite values, between which only 'method: hold' has values"
        if problem:
            raise ParameterError([(parameter, problem)])

    @property
    def coefficients(self) -> FloatArray:
        """Of each segment (n - 1, 4, k): the value and its derivatives, divided by factorials."""
        times, values = self.rows
        table = values.reshape(len(times), -1)
        coefficients = np.zeros((len(times) - 1, 4, table.shape[1]))
        coefficients[:, 0] = table[:-1]
        if self.how == "linear":
            coefficients[:, 1] = np.diff(table, axis=0) / np.diff(times)[:, None]
        elif self.how == "cubic":
            from scipy.interpolate import CubicSpline

            coefficients[:] = CubicSpline(times, table).c[::-1].transpose(1, 0, 2)
        return coefficients

    def start(self, state: BlockState) -> None:
        times, values = self.rows
        kind = self.resolved
        state.form, state.pack = kind.form, kind.pack
        state.size = kind.shape[0] if kind.shape else 1
        state.times, state.last = times.copy(), values.reshape(len(times), -1)[-1].copy()
        state.table = self.coefficients
        # Ticks are k * dt with rounding: a value that changes at a tick must not come a tick late.
        state.early = 1e-9 * state.dt

    def output(self, state: BlockState, t: float) -> Any:
        return self.at(state, t)

    def at(self, state: BlockState, t: float) -> Any:
        """The value at a time."""
        i = self.segment(state, t + state.early)
        # Before the first time, and for the rounding above, the value is that of the row itself.
        x = max(0.0, t - state.times[i])
        if state.form == "scalar":
            return self.column(state, i, 0, x)
        out = np.empty(state.size)
        for j in range(state.size):
            out[j] = self.column(state, i, j, x)
        if state.form == "array":
            return out
        return state.pack(out)

    def segment(self, state: BlockState, t: float) -> int:
        """The row before t, by bisection; the first one before all, the last one after."""
        last = len(state.times) - 1
        return last if t >= state.times[last] else piece(state.times, t)

    def column(self, state: BlockState, i: int, j: int, x: float) -> float:
        """One component, x seconds after row i."""
        if i == len(state.times) - 1:
            return float(state.last[j])
        c0, c1 = state.table[i, 0, j], state.table[i, 1, j]
        c2, c3 = state.table[i, 2, j], state.table[i, 3, j]
        return float(((c3 * x + c2) * x + c1) * x + c0)


class Piecewise(Table):
    """Given values at given times, and what lies between.

        [ Piecewise ] ─▶ out

    out(times[i]) = values[i]. Between two times the value holds, or changes linearly, or along the
    cubic spline through all points (scipy's CubicSpline, not-a-knot). Before the first time out is
    the first value, after the last one the last.
    """

    times: FloatArray = param(unit="s", shape=(None,), doc="times, in ascending order")
    values: FloatArray = param(
        shape=[(None,), (None, None)],
        finite=False,
        tunable=True,
        doc="a number per time, or a list of numbers per time",
    )
    method: str = param("hold", choices=METHODS, doc="what lies between two times")
    kind: SignalType | None = param(
        None, name="signal", doc="the output's type; default Scalar, or Vector for lists"
    )

    def validate(self) -> None:
        check_ascending(self.times, "times", "times", "s")
        if len(self.values) != len(self.times):
            message = f"expected {len(self.times)} values, one per time, got {len(self.values)}"
            raise ParameterError([("values", message)])
        self.check_type("values")

    @property
    def rows(self) -> tuple[FloatArray, FloatArray]:
        return self.times, self.values

    @property
    def how(self) -> str:
        return self.method

    @property
    def stated(self) -> SignalType | None:
        return self.kind

    def edges(self, until: float) -> FloatArray:
        return self.times if self.method == "linear" else super().edges(until)
