"""Estimators of states in discrete time: the filter of linear systems, and the steps of all.

A measurement y and a control u go in, the estimate x of the states comes out, at each tick::

    filter: {type: KalmanFilter, A: [[1, 0.05], [0, 1]], C: [1, 0], Q: [[0.01, 0], [0, 0.01]], R: 1}
"""

from __future__ import annotations

from typing import Any

import numpy as np

from blocks.core import (
    Block,
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
    covariance_fault,
    param,
    size_of,
    small_eliminate,
    small_product,
    transposed,
)


def covariance_problems(
    q: FloatArray, p0: FloatArray | None, r: FloatArray
) -> list[tuple[str, str]]:
    """What is wrong with the covariances of a filter, by parameter."""
    checked = {"Q": (q, False), "P0": (p0, False), "R": (r, True)}
    return [
        (name, fault)
        for name, (matrix, definite) in checked.items()
        if matrix is not None and (fault := covariance_fault(matrix, definite))
    ]


def kalman_gain(p: FloatArray, c: FloatArray, r: FloatArray) -> FloatArray:
    """K = P C' (C P C' + R)^-1, (n, p), of P (n, n), C (p, n) and R (p, p).

    Raises
    ------
    ArithmeticError : C P C' + R is singular; a definite R keeps it from that, overflow apart.
    """
    crossed = small_product(p, transposed(c))
    innovation = small_product(c, crossed) + r
    # K S = P C', so that S' K' = C P' is solved for K'.
    gain = transposed(crossed)
    if not small_eliminate(transposed(innovation), gain):
        raise ArithmeticError("the covariance of the innovation is singular")
    return transposed(gain)


def corrected_covariance(
    p: FloatArray, c: FloatArray, gain: FloatArray, r: FloatArray
) -> FloatArray:
    """(I - K C) P (I - K C)' + K R K', (n, n).

    Joseph's form: the shorter (I - K C) P loses symmetry by rounding, and in time definiteness.
    """
    rest = np.eye(len(p)) - small_product(gain, c)
    noise = small_product(small_product(gain, r), transposed(gain))
    return propagated(rest, p, noise)


def propagated(a: FloatArray, p: FloatArray, q: FloatArray) -> FloatArray:
    """A P A' + Q, (n, n)."""
    return small_product(small_product(a, p), transposed(a)) + q


class KalmanFilter(Block):
    """The best estimate of the states of a linear system from noisy measurements.

        measurement, control ─▶ [ KalmanFilter ] ─▶ estimate

    For x(t_k+1) = A x + B u + w, y = C x + v, with the covariances Q of w and R of v. At each tick
    the prediction is corrected with the gain K = P C' (C P C' + R)^-1: estimate = x + K (y - C x),
    P becomes (I - K C) P (I - K C)' + K R K' (Joseph's form); both are then predicted for the next
    tick (Simon, Optimal State Estimation, 2006, section 5.1). One measurement or control is a
    Scalar, several are a Vector.
    """

    measurement = Input(Same("Y"), doc="y, a Scalar or a Vector(p)")
    control = Input(Same("U"), default=0.0, doc="u, a Scalar or a Vector(m)")
    estimate = Output(Vector("n"), doc="the corrected states")

    a: FloatArray = param(shape=(None, None), name="A", doc="n rows of n numbers, for one step")
    b: FloatArray | None = param(
        None, shape=[(None, None), (None,)], name="B", doc="n rows of m numbers; default no control"
    )
    c: FloatArray = param(shape=[(None, None), (None,)], name="C", doc="p rows of n numbers")
    q: FloatArray = param(shape=(None, None), name="Q", doc="covariance of the process noise")
    r: FloatArray = param(
        shape=[(None, None), ()], name="R", doc="covariance of the measurement noise"
    )
    x0: FloatArray | None = param(None, shape=(None,), doc="first prediction; default 0")
    p0: FloatArray | None = param(
        None, shape=(None, None), name="P0", doc="its covariance; default the identity"
    )

    x = State("n", name="x", doc="the prediction")
    p = State("n", "n", name="P", doc="its covariance")

    def sizes(self) -> dict[str, int]:
        return {"n": len(self.a)} if "a" in self.__dict__ else {}

    def validate(self) -> None:
        n = len(self.a)
        p = self.c.size // n if n else 0
        wanted = {"A": (self.a, (n, n)), "Q": (self.q, (n, n)), "P0": (self.p0, (n, n))}
        problems = [
            (name, f"expected {shape[0]} x {shape[1]} numbers, got {size_of(value)}")
            for name, (value, shape) in wanted.items()
            if value is not None and value.shape != shape
        ]
        if not n or self.c.shape[-1] != n:
            problems.append(("C", f"expected {n} columns, as A has, got {size_of(self.c)}"))
        if self.r.size != p * p:
            problems.append(("R", f"expected {p} x {p} numbers, got {size_of(self.r)}"))
        if self.b is not None and len(self.b) != n:
            problems.append(("B", f"expected {n} rows, as A has, got {len(self.b)}"))
        if self.x0 is not None and len(self.x0) != n:
            problems.append(("x0", f"expected {n} numbers, one per state, got {len(self.x0)}"))
        if not problems:
            problems = covariance_problems(self.q, self.p0, self.r.reshape(p, p))
        if problems:
            raise ParameterError(problems)

    @property
    def variables(self) -> dict[str, SignalType]:
        p = self.c.size // len(self.a)
        m = 1 if self.b is None else self.b.size // len(self.a)
        return {"Y": Scalar if p == 1 else Vector(p), "U": Scalar if m == 1 else Vector(m)}

    def start(self, state: BlockState) -> None:
        n = len(self.a)
        state.n, state.p = n, self.c.size // n
        state.a, state.c = self.a.copy(), self.c.reshape(-1, n).copy()
        state.b = np.zeros((n, 1)) if self.b is None else self.b.reshape(n, -1).copy()
        state.m = state.b.shape[1]
        state.q, state.r = self.q.copy(), self.r.reshape(state.p, state.p).copy()
        state.x[:] = 0.0 if self.x0 is None else self.x0
        state.P[:] = np.eye(n) if self.p0 is None else self.p0
        kinds = state.context.types
        state.one_y = kinds["measurement"].form == "scalar"
        state.one_u = kinds["control"].form == "scalar"

    def gain(self, state: BlockState) -> FloatArray:
        """K (n, p)."""
        return kalman_gain(state.P, state.c, state.r)

    def output(self, state: BlockState, t: float, measurement: Any) -> FloatArray:
        weight = self.gain(state)
        out = np.zeros(state.n)
        for i in range(state.n):
            out[i] = state.x[i]
        for k in range(state.p):
            error = measurement if state.one_y else measurement[k]
            for j in range(state.n):
                error -= state.c[k, j] * state.x[j]
            for i in range(state.n):
                out[i] += weight[i, k] * error
        return out

    def update(self, state: BlockState, t: float, control: Any, estimate: FloatArray) -> None:
        # The gain again: an output may write no state, so it cannot be handed on.
        weight = self.gain(state)
        after = corrected_covariance(state.P, state.c, weight, state.r)
        state.P[...] = propagated(state.a, after, state.q)
        for i in range(state.n):
            total = 0.0
            for j in range(state.n):
                total += state.a[i, j] * estimate[j]
            for j in range(state.m):
                total += state.b[i, j] * (control if state.one_u else control[j])
            state.x[i] = total
