"""An estimator of the states of a nonlinear system, by its linearisation at each tick.

A measurement y and any signals u go in, the estimate x of the states comes out::

    filter: {type: ExtendedKalmanFilter, transition: [x - 0.1*x**3], observation: [x**2],
             states: [x], Q: [[0.01]], R: 0.1, x0: 1}
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    Equations,
    FloatArray,
    Input,
    Names,
    Output,
    ParameterError,
    Same,
    Scalar,
    SignalType,
    State,
    Vector,
    param,
    size_of,
    wrong_size,
)
from blocks.dynamics.kalman import (
    corrected_covariance,
    covariance_problems,
    kalman_gain,
    propagated,
)

# The relative step of a central difference: the cube root of the rounding error.
STEP = float(np.finfo(np.float64).eps) ** (1.0 / 3.0)


class ExtendedKalmanFilter(Equations):
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
    estimate = Output(Vector("n"), doc="the corrected states")

    f: tuple[str, ...] | None = param(
        None,
        name="transition",
        doc="f, the states one step later: ['x + 0.1*v', 'v - 0.1*sin(x) + u[0]']",
    )
    h: tuple[str, ...] | None = param(
        None, name="observation", doc="h, the measurements of states: 'x**2'"
    )
    states: Names | None = param(
        None, doc="names of the states: [x, v], or with units: {x: m, v: m/s}"
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

    arguments: ClassVar[tuple[str, ...]] = ("t", "x", "u", "c")

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
        if self.states is not None and self.states.size != n:
            message = f"expected {n} name(s), one per state, got {self.states.size}"
            problems.append(("states", message))
        problems += self.name_problems({}, self.states or ())
        for name, texts, count in (("transition", self.f, n), ("observation", self.h, p)):
            # The expressions, or a subclass with a method of the same name in their place.
            own = getattr(type(self), name) is not getattr(ExtendedKalmanFilter, name)
            if texts is None and not own:
                problems.append((name, f"missing; expected {count} expression(s)"))
        for index in self.angles if self.angles is not None else ():
            if index not in range(p):
                problems.append(("angles", f"expected numbers from 0 to {p - 1}, got {index:g}"))
        if problems:
            raise ParameterError(problems)
        self._check(None)
        if self.uses_inputs(self.h or ()):
            message = "a measurement cannot depend on u; make that a state"
            raise ParameterError([("observation", message)])

    def own_names(self) -> dict[str, Any]:
        # Not of x.tolist(), which compiles for up to three states only.
        parts = [f"float(x[{i}])" for i in range(self.x0.size)]
        return {"x": parts, **(self.states.of(parts) if self.states else {})}

    @property
    def measured(self) -> int:
        """The number of measurements."""
        return 1 if self.r.ndim == 0 else len(self.r)

    def _check(self, count: int | None) -> None:
        """Check all expressions with so many components in u; None as far as they are known."""
        whole = {"transition": (self.f, self.x0.size), "observation": (self.h, self.measured)}
        what = {"transition": "state (x0)", "observation": "measurement (R)"}
        sizes = self.sizes_of({name: texts for name, (texts, _) in whole.items() if texts}, count)
        problems = [
            (name, wrong_size(whole[name][0] or (), whole[name][1], got, what[name]))
            for name, got in sizes.items()
            if got != whole[name][1]
        ]
        if problems:
            raise ParameterError(problems)

    @property
    def variables(self) -> dict[str, SignalType]:
        return {"Y": Scalar if self.measured == 1 else Vector(self.measured)}

    def validate_in(self, context: BlockContext) -> None:
        self._check(self.input_count(context))

    def start(self, state: BlockState) -> None:
        n, p = self.x0.size, self.measured
        state.n, state.p, state.constants = n, p, self.constant_values
        count = len(state.context.terms["u"])
        texts = self.f or ("0",) * n
        state.f = self.function("transition", texts, count)
        texts = self.h or ("0",) * p
        state.h = self.function("observation", texts, count)
        state.q, state.r = self.q.copy(), self.r.reshape(p, p).copy()
        state.wrapped = np.zeros(p)
        for index in self.angles if self.angles is not None else ():
            state.wrapped[int(index)] = 1.0
        state.x[:] = self.x0
        state.P[:] = np.eye(n) if self.p0 is None else self.p0
        state.one_y = state.context.types["measurement"].form == "scalar"

    def transition(
        self, state: BlockState, t: float, x: FloatArray, u: tuple[float, ...]
    ) -> FloatArray:
        """f: the states (n) one step after x."""
        after: FloatArray = state.f(t, x, u, state.constants)
        return after

    def observation(self, state: BlockState, t: float, x: FloatArray) -> FloatArray:
        """h: the measurements (p) of x."""
        expected: FloatArray = state.h(t, x, (), state.constants)
        return expected

    def transition_jacobian(
        self, state: BlockState, t: float, x: FloatArray, u: tuple[float, ...]
    ) -> FloatArray:
        """F (n, n): row i holds the derivatives of f_i."""
        out, near = np.zeros((state.n, state.n)), x.copy()
        for j in range(state.n):
            step = STEP * (1.0 + abs(x[j]))
            near[j] = x[j] + step
            above = self.transition(state, t, near, u)
            near[j] = x[j] - step
            below = self.transition(state, t, near, u)
            near[j] = x[j]
            for i in range(state.n):
                out[i, j] = (above[i] - below[i]) / (2.0 * step)
        return out

    def observation_jacobian(self, state: BlockState, t: float, x: FloatArray) -> FloatArray:
        """H (p, n): row i holds the derivatives of h_i."""
        out, near = np.zeros((state.p, state.n)), x.copy()
        for j in range(state.n):
            step = STEP * (1.0 + abs(x[j]))
            near[j] = x[j] + step
            above = self.observation(state, t, near)
            near[j] = x[j] - step
            below = self.observation(state, t, near)
            near[j] = x[j]
            for i in range(state.p):
                # An angle can pass from pi to -pi within the step.
                out[i, j] = self.innovation(state, i, above[i], below[i]) / (2.0 * step)
        return out

    def innovation(self, state: BlockState, i: int, measurement: float, expected: float) -> float:
        """What measurement i differs by, wrapped to [-pi, pi] if it is an angle."""
        difference = measurement - expected
        if state.wrapped[i] > 0.0:
            return math.atan2(math.sin(difference), math.cos(difference))
        return difference

    def gain(self, state: BlockState, jacobian: FloatArray) -> FloatArray:
        """K (n, p) of H (p, n)."""
        return kalman_gain(state.P, jacobian, state.r)

    def output(self, state: BlockState, t: float, measurement: Any) -> FloatArray:
        x = state.x.copy()
        weight = self.gain(state, self.observation_jacobian(state, t, x))
        expected = self.observation(state, t, x)
        out: FloatArray = x.copy()
        for k in range(state.p):
            y = measurement if state.one_y else measurement[k]
            error = self.innovation(state, k, y, expected[k])
            for i in range(state.n):
                out[i] += weight[i, k] * error
        return out

    def update(
        self, state: BlockState, t: float, u: tuple[float, ...], estimate: FloatArray
    ) -> None:
        # H and K are computed again: an output keeps nothing, since it may be asked for again.
        jacobian = self.observation_jacobian(state, t, state.x.copy())
        weight = self.gain(state, jacobian)
        after = corrected_covariance(state.P, jacobian, weight, state.r)
        now = estimate.copy()
        state.P[...] = propagated(self.transition_jacobian(state, t, now, u), after, state.q)
        state.x[:] = self.transition(state, t, now, u)
