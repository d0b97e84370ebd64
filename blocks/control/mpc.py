"""Model predictive control about the reference, with limits on the command and on its change."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from blocks.control.lqr import linearised, riccati
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
    product,
    solve,
)

SLACK = 1e-9  # by which rounding may pass a bound


@dataclass(frozen=True)
class QuadraticProgram:
    """A condensed quadratic program: minimise u'Hu/2 + (F x)'u subject to G u <= g.

    u (m N,) holds the m commands of each of N steps. ``free`` is -H^-1 F (m N, n), ``rows`` is G
    (4 m N, m N), and ``root`` a lower triangular matrix with root root' = H^-1.
    """

    free: FloatArray
    rows: FloatArray
    root: FloatArray

    @classmethod
    def of(
        cls, a: FloatArray, b: FloatArray, q: FloatArray, r: FloatArray, steps: int
    ) -> QuadraticProgram:
        """Eliminate the states of x_k+1 = A x_k + B u_k. The rows of G bound all u from above, then
        from below, then their changes from step to step upwards and downwards.

        The last state's weight solves the Riccati equation, so that without limits the first
        command is the LQR's, for any number of steps.
        """
        n, m = b.shape
        powers: list[FloatArray] = [np.eye(n)]
        for _ in range(steps):
            powers.append(product(a, powers[-1]))
        forced = np.zeros((n * steps, m * steps))
        for k in range(steps):
            for j in range(k + 1):
                forced[n * k : n * (k + 1), m * j : m * (j + 1)] = product(powers[k - j], b)
        weight = np.zeros((n * steps, n * steps))
        weight[:] = np.kron(np.eye(steps), q)
        weight[-n:, -n:] = riccati(a, b, q, r)
        weighted = product(forced.T, weight)
        h = product(weighted, forced) + np.kron(np.eye(steps), r)
        f = product(weighted, np.concatenate(powers[1:]))
        # Symmetric but for rounding, here and before the Cholesky factor.
        inverse = solve(0.5 * (h + h.T), np.eye(m * steps))
        eye = np.eye(m * steps)
        change = eye - np.eye(m * steps, k=-m)
        rows = np.vstack((eye, -eye, change, -change))
        return cls(-product(inverse, f), rows, _cholesky(0.5 * (inverse + inverse.T)))

    def minimum(self, x: FloatArray, bounds: FloatArray) -> FloatArray:
        """The minimiser u (m N,) for a state x (n,) and bounds g (4 m N,), some infinite.

        A least distance problem in the metric of H, solved through its dual by non-negative least
        squares (Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23).

        Raises
        ------
        ValueError : no command satisfies the bounds.
        """
        free = product(self.free, x[:, None])[:, 0]
        active = np.isfinite(bounds)
        rows = self.rows[active]
        room = bounds[active] - product(rows, free[:, None])[:, 0]
        # In nearly all ticks: no limit is reached, and scipy is not called.
        if not len(room) or room.min() >= -SLACK:
            return free
        from scipy.optimize import nnls  # scipy stays off the start-up path

        system = np.vstack((-product(rows, self.root).T, -room))
        target = np.zeros(len(system))
        target[-1] = 1.0
        multipliers, _ = nnls(system, target, maxiter=100 * len(room))
        residual = product(system, multipliers[:, None])[:, 0] - target
        # The residual of an infeasible problem is zero.
        if residual[-1] > -1e-14:
            raise ValueError("no command satisfies the limits")
        moved = product(self.root, residual[:-1, None])[:, 0]
        return np.asarray(free - moved / residual[-1])


def _cholesky(matrix: FloatArray) -> FloatArray:
    """The lower triangular factor of a definite matrix, by the same bits on every machine."""
    n = len(matrix)
    lower = np.zeros((n, n))
    for j in range(n):
        past = lower[j:, :j] * lower[j, :j]
        column = matrix[j:, j] - np.add.reduce(past, 1)
        lower[j:, j] = column / math.sqrt(column[0])
    return lower


@final
class MPC(Tracker):
    """Path following: model predictive control, the best commands over a horizon.

        error, reference, turn ─▶ [ MPC ] ─▶ command

    min sum_{k<N} (x_k' Q x_k + u_k' R u_k) + x_N' P x_N  with  x_k+1 = A x_k + B u_k, where x is
    the error along the path, across it and in heading, A and B those of the LQR, and P the solution
    of its Riccati equation; subject to limits on the speed v_r + v, on the turn rate omega +
    ``turn``, and on their change per second (Rawlings, Mayne and Diehl, Model Predictive Control,
    2017). Away from all limits it is the LQR. The quadratic program is condensed and solved
    exactly, by an active-set method. Q weighs the errors in the path's frame.

    With scipy in each tick at a limit, it is the slowest of the trackers. For other plants there
    is LinearMPC.
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
        state.program = QuadraticProgram.of(a, b, np.diag(self.q), np.diag(self.r), self.steps)
        state.rates = np.array([self.v_rate, self.omega_rate])
        state.limits = np.array([self.v_max, self.omega_max])
        state.within = np.tile(state.rates * step, self.steps)
        state.last[:] = math.nan

    def output(  # type: ignore[override]
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue, turn: float
    ) -> TwistValue:
        along, lateral = offsets(error, reference[2])
        bounds = self._bounds(state, turn)
        v, omega = state.program.minimum(np.array([along, lateral, error[2]]), bounds)[:2].tolist()
        return v, omega

    def _bounds(self, state: BlockState, turn: float) -> FloatArray:
        """The bounds of the program's rows: above, below, and of the change up and down."""
        added = np.array([self.v_r, turn])
        above = np.tile(state.limits - added, self.steps)
        below = np.tile(state.limits + added, self.steps)
        up, down = state.within.copy(), state.within.copy()
        last = state.last - added
        if math.isnan(state.last[0]):
            up[:2] = down[:2] = math.inf
        else:  # the plan's first step follows the last command after one tick
            up[:2], down[:2] = state.rates * state.dt + last, state.rates * state.dt - last
        return np.concatenate((above, below, up, down))

    def update(self, state: BlockState, t: float, command: TwistValue, turn: float) -> None:
        state.last[0] = min(self.v_max, max(-self.v_max, self.v_r + command[0]))
        state.last[1] = min(self.omega_max, max(-self.omega_max, turn + command[1]))
