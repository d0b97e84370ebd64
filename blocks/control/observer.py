"""Steady-state Kalman filters: states estimated with a gain that does not change.

In: measurements, and the command of the plant. Out: an estimate of its states::

    observer: {type: SteadyStateKalman, plant: cart, measured: [position, angle],
               Q: [1e-4, 1e-2, 1e-4, 1e-2], R: [1e-4, 1e-4]}
"""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import ClassVar

import numpy as np

from blocks.control.design import Model, model_of, observer_gain, square
from blocks.control.regulator import given_model, given_problems
from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Scalar,
    State,
    Vector,
    covariance_fault,
    param,
    rate_note,
    size_of,
)
from blocks.messages import Message


class _SteadyState(Block, ABC):
    """What both filters share: the model, and the gain for it."""

    is_sampled: ClassVar[bool]

    measurement = Input(Scalar, variadic=True, spread="p", doc="y, in order")
    control = Input(Scalar, variadic=True, spread="m", doc="u; 0 without a wire")

    q: FloatArray = param(
        shape=[(None,), (None, None)],
        name="Q",
        tunable=True,
        doc="covariance of the noise on n states, or its diagonal",
    )
    r: FloatArray = param(
        shape=[(), (None,), (None, None)],
        name="R",
        tunable=True,
        doc="that of p measurements, or its diagonal",
    )
    a: FloatArray | None = param(None, shape=(None, None), name="A", doc="n rows of n numbers")
    b: FloatArray | None = param(
        None, shape=[(None, None), (None,)], name="B", doc="n rows of m numbers; default no control"
    )
    c: FloatArray | None = param(
        None, shape=[(None, None), (None,)], name="C", doc="p rows of n numbers"
    )
    plant: str | None = param(None, doc="a block with continuous states, in place of A, B and C")
    port: str = param("", name="input", doc="its input that is u; default its only one")
    measured: tuple[str, ...] | None = param(None, doc="its outputs that are measured, in order")
    x0: FloatArray | None = param(None, shape=(None,), doc="states at the operating point; 0")
    u0: FloatArray | None = param(None, shape=[(), (None,)], doc="control there; default 0")
    initial: FloatArray | None = param(None, shape=(None,), doc="first estimate; default x0")

    def sizes(self) -> dict[str, int]:
        return {"n": len(self.q)} if "q" in self.__dict__ else {}

    def validate(self) -> None:
        n = len(self.q)
        p = self.r.shape[0] if self.r.ndim else 1
        problems = given_problems(self.plant, {"A": self.a, "C": self.c})
        if self.plant is not None and not self.measured:
            problems.append(
                ("measured", Message("missing; expected outputs of the plant", "missing-value"))
            )
        if self.plant is not None and self.b is not None:
            problems.append(("B", "given with plant, which has its own; expected one of them"))
        for name, matrix, size, definite in (("Q", self.q, n, False), ("R", self.r, p, True)):
            whole = square(matrix, size)
            if whole.shape != (size, size):
                problems.append((name, f"expected {size} x {size} numbers, got {size_of(matrix)}"))
            elif fault := covariance_fault(whole, definite):
                problems.append((name, fault))
        if self.a is not None and self.a.shape != (n, n):
            problems.append(("A", f"expected {n} x {n} numbers, as of Q, got {size_of(self.a)}"))
        if self.b is not None and len(self.b) != n:
            problems.append(("B", f"expected {n} rows, as of Q, got {len(self.b)}"))
        if self.c is not None and self.c.size != p * n:
            problems.append(
                ("C", f"expected {p} x {n} numbers, as R and Q say, got {size_of(self.c)}")
            )
        if self.initial is not None and len(self.initial) != n:
            problems.append(("initial", f"expected {n} numbers, got {len(self.initial)}"))
        if problems:
            raise ParameterError(problems)

    def validate_in(self, context: BlockContext) -> None:
        _, model = self.design(context)
        given = {port: context.count(port) for port in ("measurement", "control")}
        for port, size in (("measurement", len(model.c)), ("control", model.b.shape[1])):
            if given[port] != size and (given[port] or port == "measurement"):
                message = f"has {size} numbers in {port}, but {given[port]} are wired to it"
                raise ParameterError([("plant" if self.plant is not None else "A", message)])

    def notes(self, context: BlockContext, steps: Mapping[str, tuple[float, ...]]) -> Iterable[str]:
        for i, step in enumerate(steps.get("measurement", ())):
            if context.dt * (1.0 + 1e-6) < step < math.inf:
                way = "use a KalmanFilter, whose measurements have a dt each"
                yield rate_note(f"measurement[{i}]", step, context.dt, way)

    def design(self, context: BlockContext) -> tuple[FloatArray, Model]:
        """L (n, p), and the model that it is for.

        Raises
        ------
        ParameterError : there is none.
        """
        if self.plant is not None or context.dt not in self._designs:
            if self.plant is None:
                model = given_model(self.a, self.b, self.c, self.x0, self.u0)
            else:
                names = self.measured or ()
                model = model_of(context, self.plant, self.port, names, self.x0, self.u0)
                model = model.sampled(context.dt) if self.is_sampled else model
            n, p = len(self.q), len(model.c)
            if len(model.a) != n:
                message = f"expected weights of {len(model.a)} states, as the plant has, got {n}"
                raise ParameterError([("Q", message)])
            r = square(self.r, p)
            if r.shape != (p, p):
                message = f"expected {p} x {p} numbers, as measured, got {size_of(self.r)}"
                raise ParameterError([("R", message)])
            model, q = self.augmented(model, square(self.q, n))
            gain = observer_gain(model, q, r, self.is_sampled)
            self._designs[context.dt] = gain, model
        return self._designs[context.dt]

    def augmented(self, model: Model, q: FloatArray) -> tuple[Model, FloatArray]:
        """The model with further states that are estimated, and the covariance of all of them."""
        return model, q

    @cached_property
    def _designs(self) -> dict[float, tuple[FloatArray, Model]]:
        """Designs by step."""
        return {}

    def start(self, state: BlockState) -> None:
        gain, model = self.design(state.context)
        state.gain, state.a, state.b, state.c = (
            each.copy() for each in (gain, model.a, model.b, model.c)
        )
        state.x0, state.u0, state.y0 = model.x0.copy(), model.u0.copy(), model.y0.copy()
        if self.initial is not None:
            state.x[: len(self.initial)] = self.initial - model.x0[: len(self.initial)]

    def innovation(self, state: BlockState, measurement: tuple[float, ...], i: int) -> float:
        """Number i of y - C x, of deviations."""
        total = float(measurement[i] - state.y0[i])
        for j in range(len(state.x0)):
            total -= state.c[i, j] * state.x[j]
        return total

    def following(self, state: BlockState, x: FloatArray, control: tuple[float, ...]) -> FloatArray:
        """A x + B u (n,), of deviations."""
        total = np.zeros(len(x))
        for i in range(len(total)):
            for j in range(len(total)):
                total[i] += state.a[i, j] * x[j]
            for j in range(len(control)):
                total[i] += state.b[i, j] * (control[j] - state.u0[j])
        return total


class SteadyStateKalman(_SteadyState):
    """The best estimate of the states of a linear system, with a gain that does not change.

        measurement, control ─▶ [ SteadyStateKalman ] ─▶ estimate

    x' = A x + B u + L (y - C x), with L = P C' R^-1 and A P + P A' - P C' R^-1 C P + Q = 0: the
    filter of Kalman and Bucy (1961) after its transients, for x' = A x + B u + w, y = C x + v and
    white noise with the densities Q of w and R of v. A, B and C are given, or are those of the
    block ``plant`` at x0, u0, an equilibrium; x, u and y are deviations from it. Solved by scipy.
    ``measurement`` and ``control`` take numbers, records and vectors.
    """

    is_sampled = False

    estimate = Output(Vector("n"), doc="the states")

    x = State("n", name="x", continuous=True, doc="the estimate, from x0")

    def output(self, state: BlockState, t: float) -> FloatArray:
        out: FloatArray = state.x0.copy()
        for i in range(len(out)):
            out[i] += state.x[i]
        return out

    def derivative(
        self,
        state: BlockState,
        t: float,
        measurement: tuple[float, ...],
        control: tuple[float, ...],
    ) -> FloatArray:
        rates = self.following(state, state.x, control)
        for k in range(len(state.y0)):
            error = self.innovation(state, measurement, k)
            for i in range(len(rates)):
                rates[i] += state.gain[i, k] * error
        return rates


class SampledObserver(_SteadyState, ABC):
    """A filter that corrects its prediction at each tick: x_k+1 = A (x_k + L (y - C x_k)) + B u."""

    is_sampled = True

    x: State

    def corrected(self, state: BlockState, measurement: tuple[float, ...]) -> FloatArray:
        """The prediction with what the measurements say, from x0."""
        out: FloatArray = state.x.copy()
        for k in range(len(state.y0)):
            error = self.innovation(state, measurement, k)
            for i in range(len(out)):
                out[i] += state.gain[i, k] * error
        return out

    def update(
        self,
        state: BlockState,
        t: float,
        measurement: tuple[float, ...],
        control: tuple[float, ...],
    ) -> None:
        after = self.following(state, self.corrected(state, measurement), control)
        for i in range(len(after)):
            state.x[i] = after[i]


class DiscreteSteadyStateKalman(SampledObserver):
    """The best estimate of the states of a sampled linear system, with a gain that does not change.

        measurement, control ─▶ [ DiscreteSteadyStateKalman ] ─▶ estimate

    estimate = x + L (y - C x), and x(t_k+1) = A estimate + B u, with L = P C' (C P C' + R)^-1 of
    the steady P of a KalmanFilter: A P A' - P - A P C' (C P C' + R)^-1 C P A' + Q = 0, solved by
    scipy. A, B and C are given for one step of the block, or are those of the block ``plant`` at
    x0, u0, discretised for a held u; Q and R are covariances of the noise at each tick.
    ``measurement`` and ``control`` take numbers, records and vectors.
    """

    estimate = Output(Vector("n"), doc="the states")

    x = State("n", name="x", doc="the prediction, from x0")

    def output(self, state: BlockState, t: float, measurement: tuple[float, ...]) -> FloatArray:
        out = self.corrected(state, measurement)
        for i in range(len(out)):
            out[i] += state.x0[i]
        return out
