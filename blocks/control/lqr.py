"""Linear quadratic regulation about the reference (paper, section III-B)."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from blocks.control.tracking import Tracker, offsets
from blocks.core import (
    BlockContext,
    BlockState,
    FloatArray,
    ParameterError,
    PoseValue,
    State,
    TwistValue,
    eliminate,
    kernel_of,
    kron,
    param,
    product,
    solve,
)

ROUNDING = 1e-12


def linearised(
    v_r: float, theta_r: float, dt: float, model: str = "paper"
) -> tuple[FloatArray, FloatArray]:
    """Discrete A_k (3, 3) and B_k (3, 2) of the unicycle about a reference.

    ``model="paper"``: A_k = I + dt A and B_k = dt B with B's second column as printed,
    [-v_r sin(theta_r) dt, v_r cos(theta_r) dt, 1]. ``model="exact"``: the zero-order-hold
    discretisation of the linearised system, whose second-order term is half of that.
    """
    s, c = math.sin(theta_r), math.cos(theta_r)
    slip = dt if model == "paper" else 0.5 * dt
    a = np.array([[1.0, 0.0, -v_r * s * dt], [0.0, 1.0, v_r * c * dt], [0.0, 0.0, 1.0]])
    b = dt * np.array([[c, -v_r * s * slip], [s, v_r * c * slip], [0.0, 1.0]])
    return a, b


def riccati(
    a: FloatArray,
    b: FloatArray,
    q: FloatArray,
    r: FloatArray,
    tolerance: float = 1e-13,
    max_iterations: int = 2**40,
) -> FloatArray:
    """Iterate the paper's Riccati equation from P_0 = 0 until it converges.

    P_{n+1} = Q + A'P_n A - A'P_n B (R + B'P_n B)^-1 B'P_n A. One step of the structured doubling
    algorithm (Chu, Fan, Lin and Wang, 2004) takes P_n to P_2n, so that about fifteen steps replace
    thousands of plain iterations at soft weights and short steps. A final Newton step
    removes the accumulated rounding error: with poles near the unit circle P is accurate to 1e-7
    without it, and to 1e-11 with it.

    Parameters
    ----------
    a, b, q, r : (n, n), (n, m), (n, n) and (m, m); q semi-definite, r definite.
    tolerance : largest relative change of P in the last doubling.
    max_iterations : iterations of the paper's equation, doublings counted in full.

    Returns
    -------
    P_ss, (n, n), symmetric.

    Raises
    ------
    ValueError : if P has not converged after ``max_iterations``.
    """
    with np.errstate(all="ignore"):  # an overflow is detected as divergence
        p, iterations, converged = _doubled(a, b, q, r, tolerance, max_iterations)
    if not converged:
        raise ValueError(f"the Riccati equation has not converged after {iterations} iterations")
    return _refined(a, b, q, r, p)


@kernel_of(riccati)
def _riccati_kernel(
    a: FloatArray,
    b: FloatArray,
    q: FloatArray,
    r: FloatArray,
    tolerance: float = 1e-13,
    max_iterations: int = 2**40,
) -> FloatArray:
    p, _, converged = _doubled(a, b, q, r, tolerance, max_iterations)
    if not converged:
        raise ValueError("the Riccati equation has not converged")
    return _refined(a, b, q, r, p)


def _doubled(
    a: FloatArray,
    b: FloatArray,
    q: FloatArray,
    r: FloatArray,
    tolerance: float,
    max_iterations: int,
) -> tuple[FloatArray, int, bool]:
    """P, the number of iterations, and whether P has converged."""
    eye = np.eye(len(a))
    power, g, p = a.copy(), product(b, solve(r, b.T)), q.copy()
    iterations = 1
    while iterations < max_iterations:
        w = eye.copy()
        if not eliminate(eye + product(g, p), w):
            break
        pw = product(power, w)
        change = product(product(product(power.T, p), w), power)
        g = g + product(product(pw, g), power.T)
        power = product(pw, power)
        p = p + 0.5 * (change + change.T)
        iterations *= 2
        if not np.all(np.isfinite(p)):
            break
        if np.max(np.abs(change)) <= tolerance * np.max(np.abs(p)):
            return p, iterations, True
    return p, iterations, False


def _refined(
    a: FloatArray, b: FloatArray, q: FloatArray, r: FloatArray, p: FloatArray
) -> FloatArray:
    """One Newton step on the Riccati equation (Kleinman, 1968).

    Written for A - I, which is small at short steps, so that A'PA - P does not cancel.
    """
    eye = np.eye(len(a))
    k = feedback_gain(a, b, r, p)
    f = a - eye - product(b, k)
    fp = product(f.T, p)
    residual = q + product(product(k.T, r), k) + fp + product(p, f) + product(fp, f)
    operator = kron(f.T, eye) + kron(eye, f.T) + kron(f.T, f.T)
    column = -residual.reshape(len(p) * len(p), 1)
    if not eliminate(operator, column):
        return p  # a state without weight does not decay: singular
    step = column.reshape(len(p), len(p))
    if np.max(np.abs(step)) > 1e-6 * np.max(np.abs(p)):
        return p  # more than rounding: such a state, almost unweighted
    return p + 0.5 * (step + step.T)


def feedback_gain(a: FloatArray, b: FloatArray, r: FloatArray, p: FloatArray) -> FloatArray:
    """K_ss = (R + B'PB)^-1 B'PA, shape (m, n)."""
    bp = product(b.T, p)
    return solve(r + product(bp, b), product(bp, a))


def definiteness(weight: FloatArray) -> float:
    """Smallest eigenvalue of a symmetric matrix whose diagonal was scaled to 1.

    The scaling makes it independent of the units and magnitudes of the components.
    """
    size = np.sqrt(np.abs(np.diag(weight)))
    size[size == 0.0] = 1.0
    return float(np.linalg.eigvalsh(weight / np.outer(size, size))[0])


class LQR(Tracker):
    """State feedback u_l = -K_ss (x - x_r) about the reference (paper, section III-B).

        error, reference ─▶ [ LQR ] ─▶ command

    A_k and B_k turn with the reference's heading, so the gain is found in the reference's frame:
    where Q weighs x and y alike one Riccati solution serves the whole run, and elsewhere a new
    one is found when the heading has changed. Q weighs the world's x and y, as in the paper: of
    unequal weights each is along the path here and across it there. The sampling period is the
    block's ``dt``.
    """

    q: FloatArray = param(
        (1.0, 1.0, 1.0), shape=[(3,), (3, 3)], tunable=True, doc="state weights Q, x y theta"
    )
    r: FloatArray = param(
        (1.0, 1.0), shape=[(2,), (2, 2)], tunable=True, doc="command weights R, v omega"
    )
    v_r: float = param(
        1.0, unit="m/s", tunable=True, doc="reference speed; not 0, where y is uncontrollable"
    )
    model: str = param("paper", choices=("paper", "exact"), doc="second-order term of B, see there")
    solver: str = param("riccati", choices=("riccati", "dare"), doc="dare: scipy's direct solver")
    tolerance: float = param(1e-13, above=0.0, doc="relative change of P that counts as converged")
    max_iterations: int = param(2**40, at_least=1, doc="iterations before giving up")

    gain = State(2, 3, cached=True, doc="K_ss in the reference's frame (along, lateral, heading)")
    cost_to_go = State(3, 3, cached=True, doc="P_ss in the reference's frame")
    solved_at = State(1, cached=True, unit="rad", doc="the heading that the gain was found for")

    def validate(self) -> None:
        problems = []
        if self.v_r == 0.0:
            problems.append(("v_r", "at 0 the lateral error is uncontrollable; expected another"))
        for name, weight, definite in (("q", self.weights[0], False), ("r", self.weights[1], True)):
            if not np.array_equal(weight, weight.T):
                problems.append((name, f"a weight must be symmetric, got {weight.tolist()}"))
            elif definiteness(weight) < (ROUNDING if definite else -ROUNDING):
                kind = "positive definite" if definite else "positive semi-definite"
                problems.append((name, f"a weight must be {kind}, got {weight.tolist()}"))
        if problems:
            raise ParameterError(problems)

    @cached_property
    def weights(self) -> tuple[FloatArray, FloatArray]:
        """Q (3, 3) and R (2, 2)."""
        q, r = (np.diag(w) if w.ndim == 1 else w for w in (self.q, self.r))
        return q, r

    @cached_property
    def isotropic(self) -> bool:
        """Whether Q is the same in frames of every heading."""
        q = self.weights[0]
        return bool(q[0, 0] == q[1, 1] and q[0, 1] == 0.0 and not q[:2, 2].any())

    def validate_in(self, context: BlockContext) -> None:
        try:
            self.solve(context.dt, 0.0)
        except ValueError as error:
            if self.solver == "dare":
                problem = ("solver", f"{error}; 'riccati' takes a q that leaves states out")
            else:
                slow = f"the closer v_r = {self.v_r:g} m/s is to 0, the longer it takes"
                problem = ("max_iterations", f"{error}; {slow}")
            raise ParameterError([problem]) from None

    @cached_property
    def _straight(self) -> dict[float, tuple[FloatArray, FloatArray]]:
        """Solutions at heading 0 by step, with which every run begins."""
        return {}

    def solve(self, dt: float, heading: float) -> tuple[FloatArray, FloatArray]:
        """P_ss (3, 3) and K_ss (2, 3) at a heading of the reference, both in its own frame."""
        if heading == 0.0:
            if dt not in self._straight:
                self._straight[dt] = self._solve(dt, heading)
            return self._straight[dt]
        return self._solve(dt, heading)

    @kernel_of(solve)
    def _solve_kernel(self, dt: float, heading: float) -> tuple[FloatArray, FloatArray]:
        return self._solve(dt, heading)

    def _solve(self, dt: float, heading: float) -> tuple[FloatArray, FloatArray]:
        q, r = self.weights
        c, s = math.cos(heading), math.sin(heading)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        q = q if self.isotropic else product(product(turn.T, q), turn)
        a, b = linearised(self.v_r, 0.0, dt, self.model)
        if self.solver == "dare":
            p = self._dare(a, b, q, r)
        else:
            p = riccati(a, b, q, r, self.tolerance, self.max_iterations)
        return p, feedback_gain(a, b, r, p)

    def _dare(self, a: FloatArray, b: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
        """P_ss by scipy's direct solver."""
        from scipy.linalg import solve_discrete_are  # scipy stays off the start-up path

        return np.asarray(solve_discrete_are(a, b, q, r), dtype=np.float64)

    def start(self, state: BlockState) -> None:
        self._remember(state, 0.0)

    def _remember(self, state: BlockState, heading: float) -> None:
        state.cost_to_go[...], state.gain[...] = self.solve(state.dt, heading)
        state.solved_at[0] = heading

    def output(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue
    ) -> TwistValue:
        heading = reference[2]
        if state.solved_at[0] != heading and not self.isotropic:
            self._remember(state, heading)
        along, lateral = offsets(error, heading)
        (k00, k01, k02), (k10, k11, k12) = state.gain.tolist()
        return (
            -(k00 * along + k01 * lateral + k02 * error[2]),
            -(k10 * along + k11 * lateral + k12 * error[2]),
        )
