"""An estimator of the states of a nonlinear system."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    SignalType,
    State,
    Vector,
    param,
    size_of,
)
from blocks.dynamics.equations import Equations, input_count
from blocks.dynamics.kalman import covariance_problems, product, solved, transposed

# The relative step of a central difference: the cube root of the rounding error.
STEP = float(np.finfo(np.float64).eps) ** (1.0 / 3.0)


class ExtendedKalmanFilter(Block):
    """An estimate of the states of a nonlinear system from noisy measurements.

        measurement, u ─▶ [ ExtendedKalmanFilter ] ─▶ estimate

    For x(t_k+1) = f(x, u, t_k) + w, y = h(x, t_k) + v, with the covariances Q of w and R of v. At
    each tick the prediction x is corrected with H = dh/dx there: K = P H' (H P H' + R)^-1,
    estimate = x + K (y - h(x)), P becomes (I - K H) P (I - K H)' + K R K' (Joseph's form). Both are
    predicted for the next tick with F = df/dx at the estimate: x = f(estimate, u), P = F P F' + Q
    (Simon, Optimal State Estimation, 2006, section 13.2). f and h are the expressions of
    ``transition`` and ``observation``, in x[0], x[1], ... or the names of ``states``, u[0], ... and
    t; or methods of a subclass. F and H are central differences with a step of
    6e-6 (1 + abs(x_j)) in x_j, unless the subclass has methods for them.
    """

    measurement = Input(Same("Y"), doc="y, a Scalar or a Vector(p)")
    inputs = Input(
        Scalar,
        variadic=True,
        spread="inputs",
        name="u",
        doc="any signals; their components in order are u[0], u[1], ...",
    )
    estimate = Output(Vector("n"), doc="the corrected states")

    transition: tuple[str, ...] | None = param(
        None, doc="f, the states one step later: ['x + 0.1*v', 'v - 0.1*sin(x) + u[0]']"
    )
    observation: tuple[str, ...] | None = param(None, doc="h, the measurements of states: 'x**2'")
    states: tuple[str, ...] | None = param(None, doc="names of the states: [x, v]")
    constants: Mapping[str, float] | None = param(
        None, doc="names that the expressions use, with their values: {k: 2.5}"
    )
    q: FloatArray = param(shape=(None, None), name="Q", doc="covariance of the process noise")
    r: FloatArray = param(
        shape=[(None, None), ()], name="R", doc="covariance of the measurement noise"
    )
    x0: FloatArray = param(shape=[(), (None,)], doc="first prediction, one number per state")
    p0: FloatArray | None = param(
        None, shape=(None, None), name="P0", doc="its covariance; default the identity"
    )
    angles: FloatArray | None = param(
        None,
        shape=(None,),
        doc="measurements that are angles (rad), counted from 0: their errors are wrapped",
    )

    x = State("n", name="x", doc="the prediction")
    p = State("n", "n", name="P", doc="its covariance")

    def sizes(self) -> dict[str, int]:
        return {"n": self.x0.size} if "x0" in self.__dict__ else {}

    def validate(self) -> None:
        n, p = self.x0.size, self.measured
        wanted = {"Q": (self.q, n), "P0": (self.p0, n), "R": (self.r.reshape(p, -1), p)}
        problems = [
            (name, f"expected {size} x {size} numbers, got {size_of(value)}")
            for name, (value, size) in wanted.items()
            if value is not None and value.shape != (size, size)
        ]
        problems = problems or covariance_problems(self.q, self.p0, self.r.reshape(p, p))
        problems += self.equations.problems()
        for name, texts, count, method in (
            ("transition", self.transition, n, "following"),
            ("observation", self.observation, p, "observed"),
        ):
            own = getattr(type(self), method) is not getattr(ExtendedKalmanFilter, method)
            if texts is None and not own:
                problems.append((name, f"missing; expected {count} expression(s)"))
            elif texts is not None and len(texts) != count:
                what = "state (x0)" if name == "transition" else "measurement (R)"
                message = f"expected {count} expression(s), one per {what}, got {len(texts)}"
                problems.append((name, message))
        for index in self.angles if self.angles is not None else ():
            if index not in range(p):
                problems.append(("angles", f"expected numbers from 0 to {p - 1}, got {index:g}"))
        if problems:
            raise ParameterError(problems)
        self.equations.check(self.written)
        for text in self.observation or ():
            if re.search(r"\bu\b", text):
                message = f"'{text}': a measurement cannot depend on u; make that a state"
                raise ParameterError([("observation", message)])

    @property
    def measured(self) -> int:
        """The number of measurements."""
        return 1 if self.r.ndim == 0 else len(self.r)

    @property
    def equations(self) -> Equations:
        return Equations(self.x0.size, self.states or (), self.constants or {})

    @property
    def written(self) -> list[tuple[str, str]]:
        """All expressions, each with its parameter."""
        found = [("transition", text) for text in self.transition or ()]
        return found + [("observation", text) for text in self.observation or ()]

    @property
    def variables(self) -> dict[str, SignalType]:
        return {"Y": Scalar if self.measured == 1 else Vector(self.measured)}

    def validate_in(self, context: BlockContext) -> None:
        self.equations.check(self.written, input_count(context))

    def start(self, state: BlockState) -> None:
        n, p, equations = self.x0.size, self.measured, self.equations
        state.n, state.p, state.constants = n, p, equations.values
        count = len(state.context.terms["u"])
        texts = self.transition or ("0",) * n
        state.f = equations.function("transition", texts, count, "array")
        texts = self.observation or ("0",) * p
        state.h = equations.function("observation", texts, count, "array")
        state.q, state.r = self.q.copy(), self.r.reshape(p, p).copy()
        state.wrapped = np.zeros(p)
        for index in self.angles if self.angles is not None else ():
            state.wrapped[int(index)] = 1.0
        state.x[:] = self.x0
        state.P[:] = np.eye(n) if self.p0 is None else self.p0
        state.one_y = state.context.types["measurement"].form == "scalar"

    def following(
        self, state: BlockState, t: float, x: FloatArray, u: tuple[float, ...]
    ) -> FloatArray:
        """f: the states (n) one step after x."""
        found: FloatArray = state.f(t, x.tolist(), u, state.constants)
        return found

    def observed(self, state: BlockState, t: float, x: FloatArray) -> FloatArray:
        """h: the measurements (p) of x."""
        found: FloatArray = state.h(t, x.tolist(), (), state.constants)
        return found

    def following_slope(
        self, state: BlockState, t: float, x: FloatArray, u: tuple[float, ...]
    ) -> FloatArray:
        """F (n, n): row i holds the derivatives of f_i."""
        out, near = np.zeros((state.n, state.n)), x.copy()
        for j in range(state.n):
            step = STEP * (1.0 + abs(x[j]))
            near[j] = x[j] + step
            above = self.following(state, t, near, u)
            near[j] = x[j] - step
            below = self.following(state, t, near, u)
            near[j] = x[j]
            for i in range(state.n):
                out[i, j] = (above[i] - below[i]) / (2.0 * step)
        return out

    def observed_slope(self, state: BlockState, t: float, x: FloatArray) -> FloatArray:
        """H (p, n): row i holds the derivatives of h_i."""
        out, near = np.zeros((state.p, state.n)), x.copy()
        for j in range(state.n):
            step = STEP * (1.0 + abs(x[j]))
            near[j] = x[j] + step
            above = self.observed(state, t, near)
            near[j] = x[j] - step
            below = self.observed(state, t, near)
            near[j] = x[j]
            for i in range(state.p):
                out[i, j] = self.apart(state, i, above[i] - below[i]) / (2.0 * step)
        return out

    def apart(self, state: BlockState, i: int, error: float) -> float:
        """A difference of measurement i, wrapped to [-pi, pi] if it is an angle."""
        if state.wrapped[i] > 0.0:
            return math.atan2(math.sin(error), math.cos(error))
        return error

    def weights(self, state: BlockState, slope: FloatArray) -> FloatArray:
        """K (n, p)."""
        crossed = product(state.P, transposed(slope))
        spread = product(slope, crossed)
        for i in range(state.p):
            for j in range(state.p):
                spread[i, j] += state.r[i, j]
        # K S = P H', so that S' K' = H P' is solved for K'.
        return transposed(solved(transposed(spread), transposed(crossed)))

    def output(self, state: BlockState, t: float, measurement: Any) -> FloatArray:
        x = state.x.copy()
        gain = self.weights(state, self.observed_slope(state, t, x))
        expected = self.observed(state, t, x)
        out: FloatArray = x.copy()
        for k in range(state.p):
            given = measurement if state.one_y else measurement[k]
            error = self.apart(state, k, given - expected[k])
            for i in range(state.n):
                out[i] += gain[i, k] * error
        return out

    def update(
        self, state: BlockState, t: float, u: tuple[float, ...], estimate: FloatArray
    ) -> None:
        slope = self.observed_slope(state, t, state.x.copy())
        gain = self.weights(state, slope)
        kept = product(gain, slope)
        for i in range(state.n):
            for j in range(state.n):
                kept[i, j] = (1.0 if i == j else 0.0) - kept[i, j]
        after = product(product(kept, state.P), transposed(kept))
        noise = product(product(gain, state.r), transposed(gain))
        for i in range(state.n):
            for j in range(state.n):
                after[i, j] += noise[i, j]
        now = estimate.copy()
        slope = self.following_slope(state, t, now, u)
        spread = product(product(slope, after), transposed(slope))
        ahead = self.following(state, t, now, u)
        for i in range(state.n):
            state.x[i] = ahead[i]
            for j in range(state.n):
                state.P[i, j] = spread[i, j] + state.q[i, j]
