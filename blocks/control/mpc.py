"""Model predictive control about the reference, with limits on the command and on its change."""

from __future__ import annotations

import math
from typing import final

import numpy as np

from blocks.control.lqr import linearised
from blocks.control.quadratic_program import QuadraticProgram, minimum
from blocks.control.tracking import Tracker, offsets
from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    ParameterError,
    PoseValue,
    Scalar,
    State,
    TwistValue,
    param,
)


@final
class MPC(Tracker):
    """Path following: model predictive control, the best commands over a horizon.

        error, reference, turn ─▶ [ MPC ] ─▶ command

    min sum_{k<N} (x_k' Q x_k + u_k' R u_k) + x_N' P x_N  with  x_k+1 = A x_k + B u_k, where x is
    the error along the path, across it and in heading, A and B those of the LQR, and P the solution
    of its Riccati equation; subject to limits on the speed v_r + v, on the turn rate omega +
    ``turn``, and on their change per second (Rawlings, Mayne and Diehl, Model Predictive Control,
    2017). Away from all limits it is the LQR. The quadratic program is condensed and solved
    exactly, by an active-set method. Q weighs the errors in the path's frame. For other plants
    there is LinearMPC.
    """

    turn = Input(
        Scalar,
        unit="rad/s",
        default=0.0,
        doc="turn rate that is added to the command, as match.feedforward.omega",
    )

    q: FloatArray = param(
        (1.0, 1.0, 1.0), above=0.0, shape=(3,), tunable=True, doc="weights of the errors"
    )
    r: FloatArray = param(
        (1.0, 1.0), above=0.0, shape=(2,), tunable=True, doc="weights of v and omega"
    )
    v_r: float = param(
        1.0, unit="m/s", tunable=True, doc="reference speed; not 0, where y is uncontrollable"
    )
    model: str = param("paper", choices=("paper", "exact"), doc="second-order term of B, as in LQR")
    horizon: float = param(1.0, unit="s", above=0.0, doc="how far ahead it plans")
    steps: int = param(10, at_least=1, at_most=50, doc="into which the horizon is divided")
    v_max: float = param(
        math.inf, unit="m/s", above=0.0, finite=False, tunable=True, doc="largest speed"
    )
    omega_max: float = param(
        3.0,
        unit="rad/s",
        above=0.0,
        finite=False,
        tunable=True,
        doc="largest turn rate, feedforward included",
    )
    v_rate: float = param(
        math.inf,
        unit="m/s^2",
        above=0.0,
        finite=False,
        tunable=True,
        doc="largest change of speed per second",
    )
    omega_rate: float = param(
        math.inf,
        unit="rad/s^2",
        above=0.0,
        finite=False,
        tunable=True,
        doc="the same of the turn rate",
    )

    last = State(2, doc="speed and turn rate of the last tick, in all; NaN before the first")

    def validate(self) -> None:
        problems = []
        if self.v_r == 0.0:
            problems.append(("v_r", "at 0 the lateral error is uncontrollable; expected another"))
        if self.v_max < abs(self.v_r):
            message = f"expected at least |v_r| = {abs(self.v_r):g} m/s, got {self.v_max:g}"
            problems.append(("v_max", message))
        if problems:
            raise ParameterError(problems)

    def validate_in(self, context: BlockContext) -> None:
        if self.horizon < self.steps * context.dt * (1.0 - 1e-9):
            message = f"expected at least steps * dt = {self.steps * context.dt:g} s"
            raise ParameterError([("horizon", f"{message}, got {self.horizon:g}")])

    def start(self, state: BlockState) -> None:
        step = self.horizon / self.steps
        a, b = linearised(self.v_r, 0.0, step, self.model)
        program = QuadraticProgram.of(a, b, np.diag(self.q), np.diag(self.r), self.steps)
        state.free, state.root, state.of_x, state.of_z = program.arrays
        state.rates = np.array([self.v_rate, self.omega_rate])
        limits = np.array([self.v_max, self.omega_max])
        each = np.array([limits, limits, state.rates * step, state.rates * step])
        state.limits = np.repeat(each, self.steps, axis=0).ravel()
        state.last[:] = math.nan

    def output(  # type: ignore[override]
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue, turn: float
    ) -> TwistValue:
        along, lateral = offsets(error, reference[2])
        x, room = np.array([along, lateral, error[2]]), self.bounds(state, turn)
        command = minimum(state.free, state.root, state.of_x, state.of_z, x, room)
        return float(command[0]), float(command[1])

    def bounds(self, state: BlockState, turn: float) -> FloatArray:
        """The bounds of the program's rows: above, below, and of the change up and down."""
        count, added = len(state.root), np.array([self.v_r, turn])
        out: FloatArray = state.limits.copy()
        first = math.isnan(state.last[0])
        for i in range(count):
            out[i] -= added[i % 2]
            out[count + i] += added[i % 2]
        for i in range(2):  # the plan's first step follows the last command after one tick
            room, last = state.rates[i] * state.dt, state.last[i] - added[i]
            out[2 * count + i] = math.inf if first else room + last
            out[3 * count + i] = math.inf if first else room - last
        return out

    def update(self, state: BlockState, t: float, command: TwistValue, turn: float) -> None:
        state.last[0] = min(self.v_max, max(-self.v_max, self.v_r + command[0]))
        state.last[1] = min(self.omega_max, max(-self.omega_max, turn + command[1]))
