"""Robot arms."""

from __future__ import annotations

import math

import numpy as np

from blocks.core import Block, BlockState, FloatArray, Input, Output, State, Vector, param

TWO = (2,)


class TwoLinkArm(Block):
    """An arm of two links in a vertical plane.

        torque ─▶ [ TwoLinkArm ] ─▶ angles, rates, tip

    M(q) q'' + c(q, q') + g(q) + b q' = torque, with q1 counted from the horizontal x axis and q2
    from the first link (Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, 2006, section
    7.4). The links are uniform rods unless ``centers`` and ``inertias`` say otherwise; in a
    horizontal plane gravity is 0. ``tip`` is the position of the second link's end.
    """

    torque = Input(Vector(2), unit="N m", default=0.0, doc="at both joints")
    angles = Output(Vector(2), unit="rad", doc="q; not wrapped")
    rates = Output(Vector(2), unit="rad/s", doc="q'")
    tip = Output(Vector(2), unit="m", doc="x and y of the end of the arm")

    lengths: FloatArray = param(
        [1.0, 1.0], unit="m", above=0.0, shape=TWO, tunable=True, doc="of both links"
    )
    masses: FloatArray = param(
        [1.0, 1.0], unit="kg", above=0.0, shape=TWO, tunable=True, doc="of both links"
    )
    centers: FloatArray | None = param(
        None,
        unit="m",
        shape=TWO,
        tunable=True,
        doc="distance from joint to center of mass; default the middle",
    )
    inertias: FloatArray | None = param(
        None,
        unit="kg m^2",
        at_least=0.0,
        shape=TWO,
        tunable=True,
        doc="about the centers; default uniform rods",
    )
    friction: FloatArray = param(
        [0.0, 0.0], unit="N m s", at_least=0.0, shape=TWO, tunable=True, doc="b of both joints"
    )
    gravity: float = param(9.81, unit="m/s^2", tunable=True, doc="g, along -y")
    q0: FloatArray = param([0.0, 0.0], unit="rad", shape=TWO, doc="angles at the start")
    rates0: FloatArray = param([0.0, 0.0], unit="rad/s", shape=TWO, doc="rates at the start")

    x = State(4, name="x", continuous=True, doc="q1, q2, q1', q2'")

    def start(self, state: BlockState) -> None:
        state.x[:2], state.x[2:] = self.q0, self.rates0
        (l1, l2), (m1, m2) = self.lengths.tolist(), self.masses.tolist()
        c1, c2 = (0.5 * self.lengths if self.centers is None else self.centers).tolist()
        # Once: the derivative is called several times per tick.
        rods = self.masses * self.lengths**2 / 12.0
        i1, i2 = (rods if self.inertias is None else self.inertias).tolist()
        state.l1, state.l2 = l1, l2
        state.first = m1 * c1 * c1 + i1 + m2 * l1 * l1
        state.second = m2 * c2 * c2 + i2
        state.coupling = m2 * l1 * c2
        state.weight1 = (m1 * c1 + m2 * l1) * self.gravity
        state.weight2 = m2 * c2 * self.gravity
        state.b1, state.b2 = self.friction.tolist()

    def output_angles(self, state: BlockState, t: float) -> FloatArray:
        angles: FloatArray = state.x[:2].copy()
        return angles

    def output_rates(self, state: BlockState, t: float) -> FloatArray:
        rates: FloatArray = state.x[2:].copy()
        return rates

    def output_tip(self, state: BlockState, t: float) -> FloatArray:
        tip = np.empty(2)
        both = state.x[0] + state.x[1]
        tip[0] = state.l1 * math.cos(state.x[0]) + state.l2 * math.cos(both)
        tip[1] = state.l1 * math.sin(state.x[0]) + state.l2 * math.sin(both)
        return tip

    def derivative(self, state: BlockState, t: float, torque: FloatArray) -> FloatArray:
        q1, q2, r1, r2 = state.x[0], state.x[1], state.x[2], state.x[3]
        cosine, h = math.cos(q2), state.coupling * math.sin(q2)
        m11 = state.first + state.second + 2.0 * state.coupling * cosine
        m12 = state.second + state.coupling * cosine
        m22 = state.second
        far = state.weight2 * math.cos(q1 + q2)
        near = state.weight1 * math.cos(q1)
        push1 = torque[0] - state.b1 * r1 + h * (2.0 * r1 * r2 + r2 * r2) - near - far
        push2 = torque[1] - state.b2 * r2 - h * r1 * r1 - far
        # Of a mass matrix, which is positive definite: never 0.
        determinant = m11 * m22 - m12 * m12
        rates = np.empty(4)
        rates[0] = r1
        rates[1] = r2
        rates[2] = (m22 * push1 - m12 * push2) / determinant
        rates[3] = (m11 * push2 - m12 * push1) / determinant
        return rates
