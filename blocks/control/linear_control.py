"""Predictive and adaptive control of any linear system, or of a plant near an operating point.

In: the states of a plant. Out: its command, or what to add to that of another controller::

    mpc: {type: LinearMPC, plant: cart, Q: [1, 1, 10, 1], R: 0.1, low: -5, high: 5, dt: 0.02}
    l1: {type: LinearL1, plant: cart, filter: 5.0, dt: 0.01}    # between a controller and the cart
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, final

import numpy as np

from blocks.control.design import Model, model_of, square
from blocks.control.observer import SampledObserver
from blocks.control.quadratic_program import QuadraticProgram, minimum
from blocks.control.regulator import LinearQuadraticRegulator, given_model, given_problems
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
    product,
    size_of,
    solve,
)
from blocks.core.portable import flush, flush_due

SIZED = [(), (None,)]


@final
class LinearMPC(LinearQuadraticRegulator):
    """Model predictive control of a linear system: the best commands over a horizon.

        states, reference ─▶ [ LinearMPC ] ─▶ command

    min sum_{k<N} (x_k' Q x_k + u_k' R u_k) + x_N' P x_N  with  x_k+1 = A x_k + B u_k, x the states
    - x0 - reference, u the command - u0, and P the solution of the Riccati equation; subject to
    ``low`` <= command <= ``high`` and to its change per second (Rawlings, Mayne and Diehl, Model
    Predictive Control, 2017). The first command is given, and at the next tick all are found again.
    N = ``steps`` ticks of the block, for which A and B are discretised. Away from all limits it is
    the LinearQuadraticRegulator, for any N. The program is solved exactly.

    ``states_low`` and ``states_high`` limit states, softly, since no command may be able to keep
    such limits: how far a state passes them within the horizon is added as ``penalty`` e^2.
    """

    steps: int = param(20, at_least=1, at_most=100, doc="N, how many ticks ahead it plans")
    low: FloatArray = param(
        -math.inf, shape=SIZED, finite=False, tunable=True, doc="smallest command"
    )
    high: FloatArray = param(
        math.inf, shape=SIZED, finite=False, tunable=True, doc="largest command"
    )
    rate: FloatArray = param(
        math.inf,
        shape=SIZED,
        above=0.0,
        finite=False,
        tunable=True,
        doc="largest change of command per second",
    )
    states_low: FloatArray | None = param(
        None, shape=(None,), finite=False, doc="n smallest states, -.inf for one without limit"
    )
    states_high: FloatArray | None = param(
        None, shape=(None,), finite=False, doc="n largest states"
    )
    penalty: float = param(1e4, above=0.0, doc="weight of a state beyond its limit, as in Q")

    last = State("m", doc="the command of the last tick; NaN before the first")

    def validate(self) -> None:
        super().validate()
        n, m, problems = self.sizes()["n"], self.sizes()["m"], []
        for name in ("low", "high", "rate"):
            value = self.value(name)
            if value.ndim and len(value) != m:
                message = f"expected one number, or {m}, one per command, got {size_of(value)}"
                problems.append((name, message))
        for name in ("states_low", "states_high"):
            value = self.value(name)
            if value is not None and len(value) != n:
                message = f"expected {n} numbers, one per state, got {size_of(value)}"
                problems.append((name, message))
        if not problems:
            if (self.low >= self.high).any():
                problems.append(("high", "expected numbers above low"))
            if (np.subtract(*self.states_limits(n)) >= 0.0).any():
                problems.append(("states_high", "expected numbers above states_low"))
        if problems:
            raise ParameterError(problems)

    def states_limits(self, n: int) -> tuple[FloatArray, FloatArray]:
        """The smallest and the largest of the n states, infinite where there is no limit."""
        low = np.full(n, -math.inf) if self.states_low is None else self.states_low
        high = np.full(n, math.inf) if self.states_high is None else self.states_high
        return low, high

    def is_sampled(self, context: BlockContext) -> bool:
        return True

    def start(self, state: BlockState) -> None:
        super().start(state)
        _, model = self.design(state.context)
        n, m = model.b.shape
        weights = square(self.q, n), square(self.r, m)
        low, high = self.states_limits(n)
        state.limited = np.flatnonzero(np.isfinite(low) | np.isfinite(high))
        program = QuadraticProgram.of(
            model.a, model.b, *weights, self.steps, state.limited.tolist(), self.penalty
        )
        state.free, state.root, state.of_x, state.of_z = program.arrays
        commands = self.high - model.u0, model.u0 - self.low, *2 * [self.rate * state.dt]
        states = [
            np.full(self.steps, limit)
            for i in state.limited
            for limit in (high[i] - model.x0[i], model.x0[i] - low[i])
        ]
        each = [np.tile(np.broadcast_to(limit, (m,)), self.steps) for limit in commands]
        state.bounds = np.concatenate(each + states)
        state.last[:] = math.nan

    def output(
        self, state: BlockState, t: float, states: tuple[float, ...], reference: FloatArray
    ) -> Any:
        m, count = len(state.u0), len(state.root)
        bounds, first = state.bounds.copy(), math.isnan(state.last[0])
        for i in range(m):  # the first change is from the last command
            last = math.inf if first else state.last[i] - state.u0[i]
            bounds[2 * count + i] += last
            bounds[3 * count + i] += math.inf if first else -last
        for j in range(len(state.limited)):
            for k in range(self.steps):  # states are counted from the reference
                at = 4 * count + 2 * self.steps * j + k
                bounds[at] -= reference[state.limited[j]]
                bounds[at + self.steps] += reference[state.limited[j]]
        x = np.array(states) - state.x0 - reference
        plan = minimum(state.free, state.root, state.of_x, state.of_z, x, bounds)
        command = plan[:m] + state.u0
        return float(command[0]) if state.form == "scalar" else command

    def update(self, state: BlockState, t: float, command: Any) -> None:
        # Within the limits but for rounding, which the next tick's limits must not inherit.
        state.last[:] = np.minimum(np.maximum(command, self.low), self.high)


@final
class LinearL1(Block):
    """L1 adaptive control of a linear system: what a disturbance of the command takes, given back.

        states, baseline, learn ─▶ [ LinearL1 ] ─▶ command

    Plant       x_k+1 = A x_k + B (command + d), all of them from x0 and u0
    Predictor   p_k+1 = A x_k + B command + w + fade (p_k - x_k)
    Adaptation  w = -fade (p_k - x_k), fade = exp(-predictor dt)
    Filter      d_hat' = filter ((B'B)^-1 B' w - d_hat)

    command = baseline - d_hat, with the command of any other controller as baseline. The piecewise
    constant law of Hovakimyan and Cao (L1 Adaptive Control Theory, 2010, section 3.3): a constant d
    is estimated in one tick as fade d, and the filter decides which part of it is compensated. Of a
    disturbance of the states, it is the part that a command can cancel. A and B, discretised for
    the block's step, are given, or are those of the block ``plant``.
    """

    states = Input(Scalar, variadic=True, spread="n", doc="the states, in order")
    baseline = Input(Same("U"), doc="the command without adaptation, a Scalar or a Vector(m)")
    learn = Input(Scalar, default=1.0, doc="factor on what is learnt in a tick: 0 pauses")
    command = Output(Same("U"), through="baseline", doc="baseline - d_hat")

    a: FloatArray | None = param(None, shape=(None, None), name="A", doc="n rows of n numbers")
    b: FloatArray | None = param(
        None, shape=[(None, None), (None,)], name="B", doc="n rows of m numbers; n for one command"
    )
    discrete: bool = param(False, doc="A and B are for one step of the block")
    plant: str | None = param(None, doc="a block with continuous states, in place of A and B")
    port: str = param("", name="input", doc="its input that is u; default its only one")
    x0: FloatArray | None = param(None, shape=(None,), doc="states at the operating point; 0")
    u0: FloatArray | None = param(None, shape=SIZED, doc="command there; default 0")
    predictor: float = param(
        2.0, unit="1/s", above=0.0, tunable=True, doc="pole of the prediction error"
    )
    bandwidth: float = param(
        2.0, unit="1/s", above=0.0, name="filter", tunable=True, doc="bandwidth of the filter"
    )
    limit: float = param(math.inf, above=0.0, finite=False, tunable=True, doc="largest d_hat")

    estimated = State("m", doc="the estimate behind the filter, d_hat")
    predicted = State("n", doc="predicted states, from x0; NaN before the first tick")

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        kind = context.types["baseline"]
        return {"n": context.count("states"), "m": kind.shape[0] if kind.shape else 1}

    def validate(self) -> None:
        problems = given_problems(self.plant, {"A": self.a, "B": self.b})
        if self.a is not None and self.a.shape[0] != self.a.shape[1]:
            problems.append(("A", f"expected as many columns as rows, got {size_of(self.a)}"))
        elif self.a is not None and self.b is not None and len(self.b) != len(self.a):
            problems.append(("B", f"expected {len(self.a)} rows, as A has, got {size_of(self.b)}"))
        if problems:
            raise ParameterError(problems)

    def validate_in(self, context: BlockContext) -> None:
        sizes, (n, m) = self.sizes_in(context), self.model(context).b.shape
        what = "plant" if self.plant is not None else "A"
        if n != sizes["n"]:
            message = f"has {n} states, but {sizes['n']} numbers are wired to states"
            raise ParameterError([(what, message)])
        if m != sizes["m"]:
            message = f"has {m} commands, but baseline has {sizes['m']}"
            raise ParameterError([("plant" if self.plant is not None else "B", message)])
        try:
            self._cancelling(context)
        except (ArithmeticError, ValueError):
            message = "two commands act alike, so that what to give back to each is undetermined"
            raise ParameterError([("plant" if self.plant is not None else "B", message)]) from None

    def model(self, context: BlockContext) -> Model:
        """x_k+1 = A x_k + B u_k for the block's step."""
        if self.plant is not None:
            model = model_of(context, self.plant, self.port, (), self.x0, self.u0)
        else:
            model = given_model(self.a, self.b, None, self.x0, self.u0)
        if self.discrete:
            return model
        if context.dt not in self._models or self.plant is not None:
            self._models[context.dt] = model.sampled(context.dt)
        return self._models[context.dt]

    @cached_property
    def _models(self) -> dict[float, Model]:
        """Discretised models by step."""
        return {}

    def _cancelling(self, context: BlockContext) -> FloatArray:
        """(B'B)^-1 B' (m, n): the command that has a given effect on the states, or nearest to it.

        Raises
        ------
        ArithmeticError, ValueError : B'B is singular.
        """
        b = self.model(context).b
        cancelling = solve(product(b.T, b), np.asarray(b.T))
        if not np.isfinite(cancelling).all():
            raise ValueError
        return cancelling

    def start(self, state: BlockState) -> None:
        model = self.model(state.context)
        state.a, state.b = model.a.copy(), model.b.copy()
        state.x0, state.u0 = model.x0.copy(), model.u0.copy()
        state.cancelling = self._cancelling(state.context)
        state.fade = math.exp(-self.predictor * state.dt)
        state.share = -math.expm1(-self.bandwidth * state.dt)
        state.form = state.context.types["command"].form
        state.predicted[:] = math.nan

    def output(self, state: BlockState, t: float, baseline: Any) -> Any:
        if state.form == "scalar":
            return baseline - float(state.estimated[0])
        out = np.zeros(len(state.u0))
        for i in range(len(out)):
            out[i] = baseline[i] - state.estimated[i]
        return out

    def update(
        self, state: BlockState, t: float, states: tuple[float, ...], command: Any, learn: float
    ) -> None:
        n, m = state.b.shape
        w = np.zeros(n)
        if not math.isnan(state.predicted[0]):
            for i in range(n):
                w[i] = -state.fade * (state.predicted[i] - (states[i] - state.x0[i]))
        for i in range(n):
            # w cancels what fades of the error, so the disturbance alone shows at the next tick.
            state.predicted[i] = 0.0
            for j in range(n):
                state.predicted[i] += state.a[i, j] * (states[j] - state.x0[j])
            for j in range(m):
                given = command if state.form == "scalar" else command[j]
                state.predicted[i] += state.b[i, j] * (given - state.u0[j])
        for i in range(m):
            sigma = 0.0
            for j in range(n):
                sigma += state.cancelling[i, j] * w[j]
            d = state.estimated[i] + learn * state.share * (sigma - state.estimated[i])
            state.estimated[i] = max(-self.limit, min(self.limit, d))
        if flush_due(t, state.dt):
            flush(state.estimated)


@final
class LinearDisturbanceObserver(SampledObserver):
    """Estimate a disturbance of the command of a linear system, and its states, from measurements.

        measurement, control ─▶ [ LinearDisturbanceObserver ] ─▶ disturbance, estimate

    x_k+1 = A x_k + B (control + d), d_k+1 = d_k + v, y = C x: the steady-state Kalman filter for
    the states and d together, where v, independent noise of covariance D, says how fast d may
    change (Johnson, Accommodation of external disturbances in linear regulator and servomechanism
    problems, 1971). A constant d is estimated without error. ``disturbance`` subtracted from the
    command of a controller cancels it. A, B and C are given for one step of the block, or are those
    of the block ``plant`` at x0, u0, discretised.
    """

    disturbance = Output(Same("U"), doc="d, a Scalar or a Vector(m)")
    estimate = Output(Vector("n"), doc="the states")

    drift: FloatArray = param(
        name="D", shape=[(None,), (None, None)], doc="covariance of the change of m disturbances"
    )

    x = State("extended", name="x", doc="the prediction, from x0, and d")

    def sizes(self) -> dict[str, int]:
        held = self.__dict__
        if "q" not in held or "drift" not in held:
            return super().sizes()
        return {**super().sizes(), "extended": len(self.q) + len(self.drift)}

    @property
    def variables(self) -> dict[str, SignalType]:
        m = len(self.drift)
        return {"U": Scalar if m == 1 else Vector(m)}

    def augmented(self, model: Model, q: FloatArray) -> tuple[Model, FloatArray]:
        (n, m), drift = model.b.shape, square(self.drift, len(self.drift))
        if drift.shape != (m, m):
            message = f"expected {m} x {m} numbers, as of the commands, got {size_of(self.drift)}"
            raise ParameterError([("D", message)])
        a, weights = np.eye(n + m), np.zeros((n + m, n + m))
        a[:n, :n], a[:n, n:] = model.a, model.b
        weights[:n, :n], weights[n:, n:] = q, drift
        b, c = np.vstack((model.b, np.zeros((m, m)))), np.zeros((len(model.c), n + m))
        c[:, :n] = model.c
        x0 = np.concatenate((model.x0, np.zeros(m)))
        return Model(a, b, c, x0, model.u0, model.y0), weights

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.n, state.form = len(self.q), state.context.types["disturbance"].form

    def output_disturbance(
        self, state: BlockState, t: float, measurement: tuple[float, ...]
    ) -> Any:
        found = self.corrected(state, measurement)
        if state.form == "scalar":
            return float(found[state.n])
        return found[state.n :].copy()

    def output_estimate(
        self, state: BlockState, t: float, measurement: tuple[float, ...]
    ) -> FloatArray:
        found = self.corrected(state, measurement)
        out = np.zeros(state.n)
        for i in range(state.n):
            out[i] = found[i] + state.x0[i]
        return out
