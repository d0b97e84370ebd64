"""Robot arms in a plane.

Torques at the joints go in, angles, rates, the tip and what maps one to the other come out::

    arm: {type: PlanarArm, lengths: [0.33, 0.34], masses: [1.93, 1.52], gravity: 0}
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    State,
    Vector,
    param,
    size_of,
    solve,
)

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


class PlanarArm(Block):
    """An arm of any number of links in a plane, with a force at its tip.

        torque, force ─▶ [ PlanarArm ] ─▶ angles, rates, tip, velocity, jacobian, inertia

    M(q) q'' + c(q, q') + g(q) + b q' = torque + J(q)' force, with q1 counted from the x axis and
    each further angle from the link before it, n in all. With the angles p_i = q1 + ... + qi from
    the x axis, masses m, lengths l and distances c from joint to center of mass:

        sum_j a_ij (cos(p_i - p_j) p_j'' + sin(p_i - p_j) p_j'^2) + g h_i cos(p_i) = Q_i
        h_i = m_i c_i + l_i (m_i+1 + ... + m_n),   a_ij = l_i h_j for i < j
        a_ii = I_i + m_i c_i^2 + l_i^2 (m_i+1 + ... + m_n)

    with Q_i = torque_i - b q_i' - (the same of i + 1) + l_i (force_y cos(p_i) - force_x sin(p_i)):
    Lagrange's equations (Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, 2006,
    chapter 7). ``jacobian`` is J, 2 x n, and ``inertia`` M, n x n, row by row, as MatrixMultiply
    takes them. Links are uniform rods unless ``centers`` and ``inertias`` say otherwise.
    """

    torque = Input(Vector("n"), unit="N m", default=0.0, doc="at the joints")
    force = Input(Vector(2), unit="N", default=0.0, doc="on the tip, along x and y")
    angles = Output(Vector("n"), unit="rad", doc="q; not wrapped")
    rates = Output(Vector("n"), unit="rad/s", doc="q'")
    tip = Output(Vector(2), unit="m", doc="x and y of the end of the arm")
    velocity = Output(Vector(2), unit="m/s", doc="of the tip, J q'")
    jacobian = Output(Vector("columns"), unit="m", doc="J(q), 2 x n")
    inertia = Output(Vector("squared"), unit="kg m^2", doc="mass matrix M(q), n x n")

    lengths: FloatArray = param(unit="m", above=0.0, shape=(None,), doc="of the n links")
    masses: FloatArray = param(unit="kg", above=0.0, shape=(None,), doc="of the links")
    centers: FloatArray | None = param(
        None, unit="m", shape=(None,), doc="distance from joint to center of mass; default half way"
    )
    inertias: FloatArray | None = param(
        None, unit="kg m^2", at_least=0.0, shape=(None,), doc="about the centers; default of rods"
    )
    friction: FloatArray = param(
        0.0, unit="N m s", at_least=0.0, shape=[(), (None,)], doc="b of all joints, or of each"
    )
    gravity: float = param(9.81, unit="m/s^2", doc="g, along -y; 0 in a horizontal plane")
    q0: FloatArray | None = param(None, unit="rad", shape=(None,), doc="angles at the start; 0")
    rates0: FloatArray | None = param(None, unit="rad/s", shape=(None,), doc="rates there; 0")

    x = State("both", name="x", continuous=True, doc="q, then q'")

    def sizes(self) -> dict[str, int]:
        if "lengths" not in self.__dict__:
            return {}
        n = len(self.lengths)
        return {"n": n, "columns": 2 * n, "squared": n * n, "both": 2 * n}

    def validate(self) -> None:
        n, problems = len(self.lengths), []
        for name in ("masses", "centers", "inertias", "friction", "q0", "rates0"):
            value = self.value(name)
            if value is not None and value.ndim and len(value) != n:
                message = f"expected {n} numbers, one per link, got {size_of(value)}"
                problems.append((name, message))
        if problems:
            raise ParameterError(problems)

    def start(self, state: BlockState) -> None:
        n, length, mass = len(self.lengths), self.lengths, self.masses
        state.n = n
        if self.q0 is not None:
            state.x[:n] = self.q0
        if self.rates0 is not None:
            state.x[n:] = self.rates0
        center = 0.5 * length if self.centers is None else self.centers
        inertia = mass * length**2 / 12.0 if self.inertias is None else self.inertias
        further = np.array([float(mass[i + 1 :].sum()) for i in range(n)])
        state.weight = mass * center + length * further
        coupling = np.empty((n, n))
        for i in range(n):
            coupling[i, i] = inertia[i] + mass[i] * center[i] ** 2 + length[i] ** 2 * further[i]
            for j in range(i + 1, n):
                coupling[i, j] = coupling[j, i] = length[i] * state.weight[j]
        state.coupling, state.length = coupling, length.copy()
        state.b = np.broadcast_to(self.friction, (n,)).copy()

    def output_angles(self, state: BlockState, t: float) -> FloatArray:
        angles: FloatArray = state.x[: state.n].copy()
        return angles

    def output_rates(self, state: BlockState, t: float) -> FloatArray:
        rates: FloatArray = state.x[state.n :].copy()
        return rates

    def output_tip(self, state: BlockState, t: float) -> FloatArray:
        tip, p = np.zeros(2), 0.0
        for i in range(state.n):
            p += state.x[i]
            tip[0] += state.length[i] * math.cos(p)
            tip[1] += state.length[i] * math.sin(p)
        return tip

    def output_velocity(self, state: BlockState, t: float) -> FloatArray:
        velocity, p, turn = np.zeros(2), 0.0, 0.0
        for i in range(state.n):
            p += state.x[i]
            turn += state.x[state.n + i]
            velocity[0] -= state.length[i] * math.sin(p) * turn
            velocity[1] += state.length[i] * math.cos(p) * turn
        return velocity

    def output_jacobian(self, state: BlockState, t: float) -> FloatArray:
        n, p = state.n, 0.0
        jacobian = np.zeros(2 * n)
        for i in range(n):
            p += state.x[i]
            for joint in range(i + 1):  # each joint turns all links from its own on
                jacobian[joint] -= state.length[i] * math.sin(p)
                jacobian[n + joint] += state.length[i] * math.cos(p)
        return jacobian

    def output_inertia(self, state: BlockState, t: float) -> FloatArray:
        n = state.n
        p, inertia = self.directions(state), np.zeros(n * n)
        for i in range(n):
            for j in range(n):
                entry = state.coupling[i, j] * math.cos(p[i] - p[j])
                for row in range(i + 1):
                    for column in range(j + 1):
                        inertia[row * n + column] += entry
        return inertia

    def directions(self, state: BlockState) -> FloatArray:
        """The angles of the links from the x axis (n,)."""
        p = np.zeros(state.n)
        total = 0.0
        for i in range(state.n):
            total += state.x[i]
            p[i] = total
        return p

    def derivative(
        self, state: BlockState, t: float, torque: FloatArray, force: FloatArray
    ) -> FloatArray:
        n = state.n
        p, turns, total = self.directions(state), np.zeros(n), 0.0
        for i in range(n):
            total += state.x[n + i]
            turns[i] = total
        matrix, sides = np.zeros((n, n)), np.zeros((n, 1))
        for i in range(n):
            push = torque[i] - state.b[i] * state.x[n + i]
            if i + 1 < n:
                push -= torque[i + 1] - state.b[i + 1] * state.x[n + i + 1]
            push += state.length[i] * (force[1] * math.cos(p[i]) - force[0] * math.sin(p[i]))
            push -= self.gravity * state.weight[i] * math.cos(p[i])
            for j in range(n):
                apart = p[i] - p[j]
                matrix[i, j] = state.coupling[i, j] * math.cos(apart)
                push -= state.coupling[i, j] * math.sin(apart) * turns[j] * turns[j]
            sides[i, 0] = push
        found = solve(matrix, sides)
        rates = np.zeros(2 * n)
        for i in range(n):
            rates[i] = state.x[n + i]
            rates[n + i] = found[i, 0] - (found[i - 1, 0] if i > 0 else 0.0)
        return rates
