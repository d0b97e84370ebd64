"""The filter of linear systems in discrete time.

A measurement y and a control u go in, the estimate x of the states comes out, at each tick::

    filter: {type: KalmanFilter, A: [[1, 0.05], [0, 1]], C: [1, 0], Q: [[0.01, 0], [0, 0.01]], R: 1}
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    ParameterError,
    Scalar,
    param,
    size_of,
)
from blocks.dynamics.covariances import propagated
from blocks.dynamics.filtering import Filter
from blocks.dynamics.measurements import Measurement
from blocks.messages import Message


class KalmanFilter(Filter):
    """The best estimate of the states of a linear system from noisy measurements.

        measurement, stamp, control ─▶ [ KalmanFilter ] ─▶ estimate

    For x(t_k+1) = A x + B u + w, y = C x + v, with the covariances Q of w and R of v. At each tick
    the prediction is corrected with the gain K = P C' (C P C' + R)^-1: estimate = x + K (y - C x),
    P becomes (I - K C) P (I - K C)' + K R K' (Joseph's form); both are then predicted for the next
    tick (Simon, Optimal State Estimation, 2006, section 5.1). Several ``measurements`` have a C and
    an R each, and a rate: C x then has the rows of those that are new at the tick, and where none
    is, the estimate is the prediction. One that comes late counts where it was measured.
    """

    control = Input(Scalar, variadic=True, spread="m", doc="u; 0 without a wire")

    a: FloatArray = param(shape=(None, None), name="A", doc="n rows of n numbers, for one step")
    b: FloatArray | None = param(
        None, shape=[(None, None), (None,)], name="B", doc="n rows of m numbers; default no control"
    )
    c: FloatArray | None = param(
        None, shape=[(None, None), (None,)], name="C", doc="p rows of n numbers; or measurements"
    )
    x0: FloatArray | None = param(None, shape=(None,), doc="first prediction; default 0")

    model = "C"

    def sizes(self) -> dict[str, int]:
        return {"n": len(self.a)} if "a" in self.__dict__ else {}

    @property
    def order(self) -> int:
        return len(self.a)

    def single(self) -> Measurement:
        c = None if self.c is None else np.atleast_2d(self.c)
        return Measurement("measurement", self.own_r, c=c)

    def validate(self) -> None:
        n = len(self.a)
        problems = []
        if self.a.shape != (n, n):
            problems.append(("A", f"expected {n} x {n} numbers, got {size_of(self.a)}"))
        if self.b is not None and len(self.b) != n:
            problems.append(("B", f"expected {n} rows, as A has, got {len(self.b)}"))
        if self.x0 is not None and len(self.x0) != n:
            problems.append(("x0", f"expected {n} numbers, one per state, got {len(self.x0)}"))
        if self.several is None and self.c is None:
            problems.append(
                (
                    "C",
                    Message(
                        "missing; expected rows of n numbers, or measurements", "missing-value"
                    ),
                )
            )
        else:
            problems += self.covariance_problems()
            known = self.several is not None or self.r is not None
            problems += [
                each for kind in (self.kinds if known else ()) for each in self.misfit(kind)
            ]
        if problems:
            raise ParameterError(problems)

    def misfit(self, kind: Measurement) -> list[tuple[str, str]]:
        """Where a measurement does not fit the states, or R its C."""
        n, c = len(self.a), kind.c
        if c is None or kind.observation is not None:
            return [
                (
                    self.address(kind, "C"),
                    Message("missing; expected rows of n numbers, in place of h", "missing-value"),
                )
            ]
        if c.shape[1] != n:
            text = f"expected {n} columns, as A has, got {size_of(c)}"
            return [(self.address(kind, "C"), text)]
        p = len(c)
        if kind.size != p:
            given = size_of(kind.r if self.r is None else self.r)
            return [(self.address(kind, "R"), f"expected {p} x {p} numbers, got {given}")]
        return []

    def controls(self, context: BlockContext) -> int:
        return 1 if self.b is None else self.b.size // len(self.a)

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        given, wanted = context.count("control"), self.controls(context)
        if given not in (0, wanted) or (given and self.b is None):
            text = f"expected {wanted if self.b is not None else 0} number(s) in control, "
            raise ParameterError([("B", f"{text}got {given}")])

    def start(self, state: BlockState) -> None:
        super().start(state)
        n = len(self.a)
        state.a, state.c = self.a.copy(), np.vstack([np.asarray(k.c) for k in self.kinds])
        state.b = np.zeros((n, 1)) if self.b is None else self.b.reshape(n, -1).copy()
        state.x[:] = 0.0 if self.x0 is None else self.x0
        state.is_controlled = state.context.count("control") > 0

    def slopes(self, state: BlockState, t: float, x: FloatArray) -> FloatArray:
        rows: FloatArray = state.c
        return rows

    def errors(self, state: BlockState, t: float, y: FloatArray, x: FloatArray) -> FloatArray:
        out = y.copy()
        for k in range(state.y):
            for j in range(state.n):
                out[k] -= state.c[k, j] * x[j]
            if state.wrapped[k] > 0.0:
                out[k] = math.atan2(math.sin(out[k]), math.cos(out[k]))
        return out

    def predict(
        self, state: BlockState, t: float, u: FloatArray, x: FloatArray, p: FloatArray
    ) -> None:
        p[...] = propagated(state.a, p, state.q)
        now = x.copy()
        for i in range(state.n):
            total = 0.0
            for j in range(state.n):
                total += state.a[i, j] * now[j]
            for j in range(state.u):
                total += state.b[i, j] * u[j]
            x[i] = total

    def update(
        self,
        state: BlockState,
        t: float,
        measurement: tuple[float, ...],
        stamp: tuple[float, ...],
        control: tuple[float, ...],
    ) -> None:
        u = np.zeros(state.u)
        if state.is_controlled:
            for j in range(state.u):
                u[j] = control[j]
        self.step(state, t, measurement, stamp, u)
