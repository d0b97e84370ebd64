"""Optimal state feedback for any linear system, or for a plant near an operating point.

In: the states, and where they shall be. Out: a command::

    lqr: {type: LinearQuadraticRegulator, plant: cart, Q: [1, 1, 10, 1], R: [0.1]}
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from blocks.control.design import Model, model_of, regulator_gain, square
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
    covariance_fault,
    param,
    size_of,
)


class LinearQuadraticRegulator(Block):
    """State feedback that is optimal for a linear system.

        states, reference ─▶ [ LinearQuadraticRegulator ] ─▶ command

    command = u0 - K (states - x0 - reference). K minimises the integral of x'Qx + u'Ru for
    x' = A x + B u: K = R^-1 B'P, with A'P + PA - PB R^-1 B'P + Q = 0. With a step of its own, the
    block is sampled: it holds its command, A and B are discretised for that, and K minimises the
    sum over its ticks: K = (R + B'PB)^-1 B'PA (Anderson and Moore, Optimal Control, 1990; solved by
    scipy). A and B are given, or are those of the block ``plant`` at x0, u0, an equilibrium.
    ``states`` takes numbers, records and vectors. The path-following controller is an LQR.
    """

    states = Input(Scalar, variadic=True, spread="n", doc="the states, in order")
    reference = Input(Vector("n"), default=0.0, doc="where they shall be, from x0")
    command = Output(Same("U"), doc="u, a Scalar or a Vector(m)")

    q: FloatArray = param(
        shape=[(None,), (None, None)],
        name="Q",
        tunable=True,
        doc="weights of n states, or n rows of n",
    )
    r: FloatArray = param(
        shape=[(), (None,), (None, None)],
        name="R",
        tunable=True,
        doc="weights of m commands, or m rows of m",
    )
    a: FloatArray | None = param(None, shape=(None, None), name="A", doc="n rows of n numbers")
    b: FloatArray | None = param(
        None, shape=[(None, None), (None,)], name="B", doc="n rows of m numbers; n for one command"
    )
    discrete: bool = param(False, doc="A and B are for one step of the block")
    plant: str | None = param(None, doc="a block with continuous states, in place of A and B")
    port: str = param("", name="input", doc="its input that is u; default its only one")
    x0: FloatArray | None = param(None, shape=(None,), doc="states at the operating point; 0")
    u0: FloatArray | None = param(None, shape=[(), (None,)], doc="command there; default 0")

    gain = State("m", "n", cached=True, doc="K")

    def sizes(self) -> dict[str, int]:
        held = self.__dict__
        m = {"m": self.r.shape[0] if self.r.ndim else 1} if "r" in held else {}
        return {**m, "n": len(self.q)} if "q" in held else m

    def validate(self) -> None:
        n, m = len(self.q), self.sizes()["m"]
        problems = []
        for name, weight, size, definite in (("Q", self.q, n, False), ("R", self.r, m, True)):
            matrix = square(weight, size)
            if matrix.shape != (size, size):
                problems.append((name, f"expected {size} x {size} numbers, got {size_of(weight)}"))
            elif fault := covariance_fault(matrix, definite):
                problems.append((name, fault.replace("a covariance", "a matrix of weights")))
        problems += given_problems(self.plant, {"A": self.a, "B": self.b})
        for name, value, shape in (("A", self.a, (n, n)), ("B", self.b, (n, m))):
            if value is not None and value.reshape(len(value), -1).shape != shape:
                wanted = f"{shape[0]} x {shape[1]}"
                problems.append(
                    (name, f"expected {wanted} numbers, as of Q and R, got {size_of(value)}")
                )
        if problems:
            raise ParameterError(problems)

    @property
    def variables(self) -> dict[str, SignalType]:
        m = self.sizes()["m"]
        return {"U": Scalar if m == 1 else Vector(m)}

    def validate_in(self, context: BlockContext) -> None:
        n, count = len(self.q), context.count("states")
        if count != n:
            raise ParameterError(
                [("Q", f"has {n} states, but {count} numbers are wired to states")]
            )
        self.design(context)

    def design(self, context: BlockContext) -> tuple[FloatArray, Model]:
        """K (m, n), and the model that it is for.

        Raises
        ------
        ParameterError : there is none.
        """
        key = context.dt, context.sampled
        if self.plant is not None or key not in self._designs:
            n, m = len(self.q), self.sizes()["m"]
            model = self._model(context)
            if model.b.shape != (n, m):
                size = f"{len(model.b)} states and {model.b.shape[1]} commands"
                raise ParameterError([("plant", f"has {size}, Q and R are for {n} and {m}")])
            is_sampled = self.is_sampled(context)
            if is_sampled and not self.discrete:
                model = model.sampled(context.dt)
            gain = regulator_gain(model, square(self.q, n), square(self.r, m), is_sampled)
            self._designs[key] = gain, model
        return self._designs[key]

    def is_sampled(self, context: BlockContext) -> bool:
        """Whether the command holds between ticks, for which the gain is then designed."""
        return context.sampled or self.discrete

    @cached_property
    def _designs(self) -> dict[tuple[float, bool], tuple[FloatArray, Model]]:
        """Designs by step."""
        return {}

    def _model(self, context: BlockContext) -> Model:
        if self.plant is not None:
            return model_of(context, self.plant, self.port, (), self.x0, self.u0)
        return given_model(self.a, self.b, None, self.x0, self.u0)

    def start(self, state: BlockState) -> None:
        gain, model = self.design(state.context)
        state.gain[...] = gain
        state.x0, state.u0 = model.x0.copy(), model.u0.copy()
        state.form = state.context.types["command"].form

    def output(
        self, state: BlockState, t: float, states: tuple[float, ...], reference: FloatArray
    ) -> Any:
        command = state.u0.copy()
        for i in range(len(command)):
            for j in range(len(state.x0)):
                command[i] -= state.gain[i, j] * (states[j] - state.x0[j] - reference[j])
        if state.form == "scalar":
            return float(command[0])
        return command


def given_problems(plant: str | None, matrices: dict[str, Any]) -> list[tuple[str, str]]:
    """What is wrong if neither matrices nor a plant are given, or both are."""
    if plant is not None:
        both = [name for name, value in matrices.items() if value is not None]
        return [
            (name, "given with plant, which has its own; expected one of them") for name in both
        ]
    return [
        (name, "missing; give A and B, or a plant" if name in "AB" else f"missing; give {name}")
        for name, value in matrices.items()
        if value is None
    ]


def given_model(
    a: FloatArray | None,
    b: FloatArray | None,
    c: FloatArray | None,
    x0: FloatArray | None,
    u0: FloatArray | None,
) -> Model:
    """A model of matrices that were checked, for deviations from x0 and u0."""
    a = np.zeros((0, 0)) if a is None else a
    n = len(a)
    b = np.zeros((n, 1)) if b is None else b.reshape(n, -1)
    c = np.zeros((0, n)) if c is None else c.reshape(-1, n)
    x0 = np.zeros(n) if x0 is None else x0
    u0 = np.zeros(b.shape[1]) if u0 is None else np.atleast_1d(u0)
    for name, value, size in (("x0", x0, n), ("u0", u0, b.shape[1])):
        if len(value) != size:
            raise ParameterError([(name, f"expected {size} numbers, got {len(value)}")])
    return Model(a, b, c, x0, u0, c @ x0)
