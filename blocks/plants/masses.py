"""Masses that move along lines."""

from __future__ import annotations

from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    Same,
    Scalar,
    State,
    check_flat,
    check_sized,
    param,
)


class MassSpringDamper(Block):
    """A mass on a spring and a damper.

        force ─▶ [ MassSpringDamper ] ─▶ position, velocity

    m x'' = force - c x' - k x (Ogata, Modern Control Engineering, 5th ed., section 3.2).
    """

    force = Input(Scalar, unit="N", default=0.0, doc="on the mass")
    position = Output(Scalar, unit="m", doc="x, 0 where the spring is relaxed")
    velocity = Output(Scalar, unit="m/s", doc="x'")

    mass: float = param(1.0, unit="kg", above=0.0, tunable=True, doc="m")
    damping: float = param(0.0, unit="N s/m", at_least=0.0, tunable=True, doc="c")
    stiffness: float = param(1.0, unit="N/m", at_least=0.0, tunable=True, doc="k")
    position0: float = param(0.0, unit="m", doc="x at the start")
    velocity0: float = param(0.0, unit="m/s", doc="x' at the start")

    x = State(2, name="x", continuous=True, doc="x, x'")

    def start(self, state: BlockState) -> None:
        state.x[0], state.x[1] = self.position0, self.velocity0

    def output(self, state: BlockState, t: float) -> tuple[float, float]:
        return float(state.x[0]), float(state.x[1])

    def derivative(self, state: BlockState, t: float, force: float) -> FloatArray:
        rates = np.empty(2)
        rates[0] = state.x[1]
        pull = self.damping * state.x[1] + self.stiffness * state.x[0]
        rates[1] = (force - pull) / self.mass
        return rates


class DoubleIntegrator(Block):
    """A point that an acceleration moves, in any number of directions.

        acceleration ─▶ [ DoubleIntegrator ] ─▶ position, velocity

    x'' = acceleration, each component.
    """

    acceleration = Input(Same("T", own_unit=True), doc="a number, a record or a vector")
    position = Output(Same("T", own_unit=True), doc="x")
    velocity = Output(Same("T", own_unit=True), doc="x'")

    position0: FloatArray = param(0.0, shape=[(), (None,)], doc="x at the start, per component")
    velocity0: FloatArray = param(0.0, shape=[(), (None,)], doc="x' at the start, per component")

    x = State(name="x", like="position", continuous=True, doc="x")
    v = State(name="v", like="velocity", continuous=True, doc="x'")

    def validate_in(self, context: BlockContext) -> None:
        kind = context.types["position"]
        check_flat(kind, "acceleration")
        for name in ("position0", "velocity0"):
            check_sized(kind, name, self.value(name))

    def start(self, state: BlockState) -> None:
        kind = state.context.types["position"]
        state.pack, state.form = kind.pack, kind.form
        state.size = kind.shape[0] if kind.shape else 1
        state.x[...], state.v[...] = self.position0, self.velocity0
        state.speeds = state.v.reshape(-1)

    def output(self, state: BlockState, t: float) -> tuple[Any, Any]:
        return state.pack(state.x), state.pack(state.v)

    def derivative(self, state: BlockState, t: float, acceleration: Any) -> tuple[Any, Any]:
        if state.form == "scalar":
            return float(state.speeds[0]), acceleration
        rates = np.empty(state.size)
        for i in range(state.size):
            rates[i] = acceleration[i]
        return state.speeds.copy(), rates
