"""Linear systems with several inputs, states and outputs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
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
)
from blocks.dynamics.discretization import sampled_matrices


class LinearSystem(Block, ABC):
    """The ports and the output of a linear system with matrices A, B, C and D."""

    signal = Input(Same("U"), name="input", doc="u, a Scalar or a Vector(m)")
    out = Output(Same("Y"), doc="y, a Scalar or a Vector(p)")

    @abstractmethod
    def sizes(self) -> dict[str, int]:
        """The number of states, n; known before the parameters are checked."""

    @property
    @abstractmethod
    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """A (n, n), B (n, m), C (p, n) and D (p, m)."""

    @property
    def first(self) -> FloatArray:
        """The initial state (n,)."""
        return np.zeros(len(self.matrices[0]))

    @cached_property
    def transition(self) -> FloatArray:
        """A, n rows of n numbers."""
        return self.matrices[0].copy()

    @cached_property
    def inputs(self) -> FloatArray:
        """B, n rows of m numbers."""
        return self.matrices[1].copy()

    @cached_property
    def outputs(self) -> FloatArray:
        """C, p rows of n numbers."""
        return self.matrices[2].copy()

    @cached_property
    def direct(self) -> FloatArray:
        """D, p rows of m numbers."""
        return self.matrices[3].copy()

    @property
    def variables(self) -> dict[str, SignalType]:
        m, p = self.inputs.shape[1], len(self.outputs)
        return {"U": Scalar if m == 1 else Vector(m), "Y": Scalar if p == 1 else Vector(p)}

    @property
    def indirect(self) -> tuple[str, ...]:
        return () if self.direct.any() else ("input",)

    def start(self, state: BlockState) -> None:
        state.x[:] = self.first
        state.has_direct = bool(self.direct.any())
        state.form = state.context.types["out"].form
        state.single = state.context.types["input"].form == "scalar"

    def output(self, state: BlockState, t: float, input: Any = 0.0) -> Any:
        y = np.zeros(len(self.outputs))
        for i in range(len(y)):
            for j in range(len(state.x)):
                y[i] += self.outputs[i, j] * state.x[j]
            if state.has_direct:
                if state.single:
                    y[i] += self.direct[i, 0] * input
                else:
                    for j in range(len(input)):
                        y[i] += self.direct[i, j] * input[j]
        if state.form == "scalar":
            return float(y[0])
        return y

    def following(self, state: BlockState, input: Any) -> FloatArray:
        """A x + B u (n,): the rate of change of x, or x one step later."""
        # Loops, as in `output`: the systems are small, and both engines sum in one order.
        total = np.zeros(len(state.x))
        for i in range(len(total)):
            for j in range(len(total)):
                total[i] += self.transition[i, j] * state.x[j]
            if state.single:
                total[i] += self.inputs[i, 0] * input
            else:
                for j in range(len(input)):
                    total[i] += self.inputs[i, j] * input[j]
        return total


class ContinuousSystem(LinearSystem, ABC):
    """A linear system in continuous time: x' = A x + B u."""

    x = State("n", name="x", continuous=True, doc="the state")

    def couplings(self, context: BlockContext) -> list[list[int]]:
        return [np.flatnonzero(row).tolist() for row in self.transition]

    def derivative(self, state: BlockState, t: float, input: Any) -> FloatArray:
        return self.following(state, input)


class _Matrices(LinearSystem, ABC):
    """A linear system whose matrices are its parameters."""

    a: FloatArray = param(shape=[(None, None)], name="A", doc="n rows of n numbers")
    b: FloatArray = param(
        shape=[(None, None), (None,)], name="B", doc="n rows of m numbers; n numbers for one input"
    )
    c: FloatArray = param(
        shape=[(None, None), (None,)], name="C", doc="p rows of n numbers; n numbers for one output"
    )
    d: FloatArray = param(
        0.0,
        shape=[(None, None), ()],
        name="D",
        doc="p rows of m numbers, or one for all; default 0",
    )
    x0: FloatArray | None = param(None, shape=[(None,)], doc="initial state; default 0")

    def validate(self) -> None:
        n = len(self.a)
        problems = []
        if n == 0 or self.a.shape != (n, n):
            problems.append(("A", f"expected as many columns as rows, got {_size(self.a)}"))
        elif len(self.b) != n or self.b.size == 0:
            problems.append(("B", f"expected {n} rows, as A has, got {_size(self.b)}"))
        elif self.c.shape[-1] != n:
            problems.append(("C", f"expected {n} columns, as A has, got {_size(self.c)}"))
        elif self.d.ndim and self.d.shape != self.shape:
            wanted = f"{self.shape[0]} x {self.shape[1]}"
            problems.append(("D", f"expected {wanted} numbers, got {_size(self.d)}"))
        if n and self.x0 is not None and len(self.x0) != n:
            problems.append(("x0", f"expected {n} numbers, one per state, got {len(self.x0)}"))
        if problems:
            raise ParameterError(problems)

    @property
    def shape(self) -> tuple[int, int]:
        """That of D: the number of outputs, and of inputs."""
        return self.c.size // max(1, len(self.a)), self.b.size // max(1, len(self.a))

    @property
    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        n = len(self.a)
        d = np.broadcast_to(self.d, self.shape)
        return self.a, self.b.reshape(n, -1), self.c.reshape(-1, n), d

    def sizes(self) -> dict[str, int]:
        return {"n": len(self.a)}

    @property
    def first(self) -> FloatArray:
        return np.zeros(len(self.a)) if self.x0 is None else self.x0


class StateSpace(_Matrices, ContinuousSystem):
    """A linear system with n states, m inputs and p outputs.

        input ─▶ [ StateSpace ] ─▶ out

    x' = A x + B u, y = C x + D u, x(0) = x0. One input or output is a Scalar, several are a
    Vector. With D = 0, the default, ``out`` depends on the state alone and breaks loops.
    """

    def discretized(self, method: str, step: float) -> Block:
        return sampled_system(self, method, step)


class DiscreteStateSpace(_Matrices):
    """A linear system in discrete time with n states, m inputs and p outputs.

        input ─▶ [ DiscreteStateSpace ] ─▶ out

    x(t_k+1) = A x(t_k) + B u(t_k), y(t_k) = C x(t_k) + D u(t_k), x(0) = x0, at the block's own
    ``dt``. One input or output is a Scalar, several are a Vector. With D = 0, the default, ``out``
    depends on the state alone and breaks loops.
    """

    x = State("n", name="x", doc="the state")

    def update(self, state: BlockState, t: float, input: Any) -> None:
        after = self.following(state, input)
        for i in range(len(state.x)):
            state.x[i] = after[i]


def sampled_system(system: ContinuousSystem, method: str, step: float) -> DiscreteStateSpace:
    """A linear system in discrete time.

    Raises
    ------
    ParameterError : the method is for transfer functions only.
    """
    if method == "matched":
        message = "matched is for transfer functions of a degree up to 4; take tustin or zoh"
        raise ParameterError([("", message)])
    a, b, c, d = sampled_matrices(system.matrices, method, step)
    first = system.first
    if method == "tustin":
        # The sampled state is (1 - A step / 2) x: C differs, and the outputs agree.
        first = first - 0.5 * step * system.matrices[0] @ first
    x0 = {"x0": first.tolist()} if first.any() else {}
    numbers = {"A": a.tolist(), "B": b.tolist(), "C": c.tolist(), "D": d.tolist()}
    return DiscreteStateSpace(**numbers, **x0)


def _size(matrix: FloatArray) -> str:
    return f"{len(matrix)} x {matrix.shape[1]}" if matrix.ndim == 2 else f"{matrix.size}"
