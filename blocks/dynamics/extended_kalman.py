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
    Names,
    ParameterError,
    items,
    param,
    wrong_size,
)
from blocks.dynamics.covariances import propagated
from blocks.dynamics.filtering import Filter
from blocks.dynamics.measurements import Measurement
from blocks.messages import Message

# The relative step of a central difference: the cube root of the rounding error.
STEP = float(np.finfo(np.float64).eps) ** (1.0 / 3.0)


class ExtendedKalmanFilter(Filter, Equations):
    """An estimate of the states of a nonlinear system from noisy measurements.

        measurement, stamp, u ─▶ [ ExtendedKalmanFilter ] ─▶ estimate

    For x(t_k+1) = f(x, u, t_k) + w, y = h(x, t_k) + v, with the covariances Q of w and R of v. At
    each tick the prediction x is corrected with H = dh/dx there: K = P H' (H P H' + R)^-1,
    estimate = x + K (y - h(x)), P becomes (I - K H) P (I - K H)' + K R K' (Joseph's form). Both are
    predicted for the next tick with F = df/dx at the estimate: x = f(estimate, u), P = F P F' + Q
    (Simon, Optimal State Estimation, 2006, section 13.2). Several ``measurements`` have an
    observation and an R each, and a rate: h then has the components of those that are new at the
    tick, and where none is, the estimate is the prediction. One that comes late counts where it was
    measured. f and h are the expressions of ``transition`` and ``observation``, in x[0], x[1], ...
    or the names of ``states``, u[0], ... and t; or methods of a subclass. F and H are central
    differences with a step of 6e-6 (1 + abs(x_j)) in x_j, unless the subclass has methods for them.
    """

    f: tuple[str, ...] | None = param(
        None,
        name="transition",
        doc="f, the states one step later: ['x + 0.1*v', 'v - 0.1*sin(x) + u[0]']",
    )
    h: tuple[str, ...] | None = param(
        None, name="observation", doc="h, the measurements of states: 'x**2'; or measurements"
    )
    states: Names | None = param(
        None, doc="names of the states: [x, v], or with units: {x: m, v: m/s}"
    )
    x0: FloatArray = param(shape=[(), (None,)], doc="first prediction, one number per state")
    angles: FloatArray | None = param(
        None,
        shape=(None,),
        doc="measurements that are angles (rad), counted from 0: their errors are wrapped",
    )

    arguments: ClassVar[tuple[str, ...]] = ("t", "x", "u", "c")
    model = "observation"

    def sizes(self) -> dict[str, int]:
        return {"n": self.x0.size} if "x0" in self.__dict__ else {}

    @property
    def order(self) -> int:
        return self.x0.size

    def single(self) -> Measurement:
        angles = () if self.angles is None else tuple(self.angles.tolist())
        return Measurement("measurement", self.own_r, observation=self.h, angles=angles)

    def validate(self) -> None:
        n, problems = self.order, self.covariance_problems()
        if self.several is not None and self.angles is not None:
            problems.append(("angles", "given with measurements, which have their own"))
        if self.states is not None and self.states.size != n:
            message = f"expected {n} name(s), one per state, got {self.states.size}"
            problems.append(("states", message))
        problems += self.name_problems({}, self.states or ())
        if self.f is None and not self._is_own("transition"):
            problems.append(
                ("transition", Message(f"missing; expected {n} expression(s)", "missing-value"))
            )
        if not problems:
            problems += [
                (
                    self.address(kind, "observation"),
                    Message(f"missing; expected {kind.size} expression(s)", "missing-value"),
                )
                for kind in self.kinds
                if (kind.observation is None or kind.c is not None)
                and not self._is_own("observation")
            ]
        if problems:
            raise ParameterError(problems)
        self._check(None)
        if self.uses_inputs(text for _, text in self.observations):
            message = "a measurement cannot depend on u; make that a state"
            raise ParameterError([(self.address(self.kinds[0], "observation"), message)])

    def _is_own(self, name: str) -> bool:
        """Whether a subclass has a method in place of expressions."""
        return getattr(type(self), name) is not getattr(ExtendedKalmanFilter, name)

    @property
    def observations(self) -> list[tuple[str, str]]:
        """The expressions of all measurements, each with its address."""
        return [
            each
            for kind in self.kinds
            for each in items(self.address(kind, "observation"), kind.observation or ())
        ]

    def own_names(self) -> dict[str, Any]:
        # Not of x.tolist(), which compiles for up to three states only.
        parts = [f"float(x[{i}])" for i in range(self.x0.size)]
        return {"x": parts, **(self.states.of(parts) if self.states else {})}

    def _check(self, count: int | None) -> None:
        """Check all expressions with so many components in u; None as far as they are known."""
        whole = {"transition": (self.f or (), self.order, "state (x0)")}
        for kind in self.kinds:
            given = (kind.observation or (), kind.size, "measurement (R)")
            whole[self.address(kind, "observation")] = given
        written = {name: texts for name, (texts, _, _) in whole.items() if texts}
        problems = []
        for name, got in self.sizes_of(written, count).items():
            texts, size, what = whole[name]
            if got != size:
                problems.append((name, wrong_size(texts, size, got, what)))
        if problems:
            raise ParameterError(problems)

    def controls(self, context: BlockContext) -> int:
        return len(context.terms["u"])

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        self._check(self.input_count(context))

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.constants = self.constant_values
        count = len(state.context.terms["u"])
        # As floats: those of NumPy would give infinity where a division by zero is an error.
        controls = [f"float(u[{i}])" for i in range(count)]
        state.f = self.function("transition", self.f or ("0",) * state.n, controls)
        written = self.observations or [("observation", "0")] * state.y
        state.h = self.function_of(written, controls)
        state.x[:] = self.x0
        state.is_controlled = count > 0

    def transition(self, state: BlockState, t: float, x: FloatArray, u: FloatArray) -> FloatArray:
        """f: the states (n) one step after x."""
        after: FloatArray = state.f(t, x, u, state.constants)
        return after

    def observation(self, state: BlockState, t: float, x: FloatArray) -> FloatArray:
        """h: all measurements (p) of x, in order."""
        expected: FloatArray = state.h(t, x, np.zeros(1), state.constants)
        return expected

    def transition_jacobian(
        self, state: BlockState, t: float, x: FloatArray, u: FloatArray
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
        out, near = np.zeros((state.y, state.n)), x.copy()
        for j in range(state.n):
            step = STEP * (1.0 + abs(x[j]))
            near[j] = x[j] + step
            above = self.observation(state, t, near)
            near[j] = x[j] - step
            below = self.observation(state, t, near)
            near[j] = x[j]
            for i in range(state.y):
                # An angle can pass from pi to -pi within the step.
                out[i, j] = self.innovation(state, i, above[i], below[i]) / (2.0 * step)
        return out

    def innovation(self, state: BlockState, i: int, measurement: float, expected: float) -> float:
        """What measurement i differs by, wrapped to [-pi, pi] if it is an angle."""
        difference = measurement - expected
        if state.wrapped[i] > 0.0:
            return math.atan2(math.sin(difference), math.cos(difference))
        return difference

    def slopes(self, state: BlockState, t: float, x: FloatArray) -> FloatArray:
        return self.observation_jacobian(state, t, x)

    def errors(self, state: BlockState, t: float, y: FloatArray, x: FloatArray) -> FloatArray:
        out = self.observation(state, t, x)
        for i in range(state.y):
            out[i] = self.innovation(state, i, y[i], out[i])
        return out

    def predict(
        self, state: BlockState, t: float, u: FloatArray, x: FloatArray, p: FloatArray
    ) -> None:
        now = x.copy()
        p[...] = propagated(self.transition_jacobian(state, t, now, u), p, state.q)
        x[:] = self.transition(state, t, now, u)

    def update(
        self,
        state: BlockState,
        t: float,
        measurement: tuple[float, ...],
        stamp: tuple[float, ...],
        u: tuple[float, ...],
    ) -> None:
        controls = np.zeros(max(state.u, 1))
        if state.is_controlled:
            for j in range(state.u):
                controls[j] = u[j]
        self.step(state, t, measurement, stamp, controls)
