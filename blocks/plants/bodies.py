"""Bodies that move and turn in space: a rigid body, and a quadrotor.

Forces and torques go in; position, velocity, attitude (a quaternion) and rate of turn come out. The
world's z points up, the body's x forward, y to the left and z up::

    mixer: {type: RotorMixer}      # thrust and torques to the thrusts of four rotors
    quad: {type: Quadrotor}        # rotors with a lag, drag, wind
"""

from __future__ import annotations

import math
from abc import ABC
from typing import Any

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
    cross_product,
    param,
    rotation_matrix,
    solve,
    turned,
    turned_back,
)

STATES = ("x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "p", "q", "r")


def inertia_matrix(inertia: FloatArray) -> FloatArray:
    """J (3, 3) of principal moments (3,) or of a matrix.

    Raises
    ------
    ParameterError : it is not symmetric, or not that of a body.
    """
    matrix = np.diag(inertia) if inertia.ndim == 1 else inertia.copy()
    if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
        raise ParameterError([("inertia", "expected a symmetric matrix")])
    moments = np.linalg.eigvalsh(matrix)
    if moments[0] <= 0.0 or moments[2] > moments[0] + moments[1] + 1e-9 * moments[2]:
        shown = ", ".join(f"{value:g}" for value in moments)
        message = f"expected moments above 0, none above the sum of the others, got {shown}"
        raise ParameterError([("inertia", message)])
    return matrix


class _Body(Block, ABC):
    """A rigid body: m v' = f - m g e_z, q' = q (0, omega) / 2, J omega' = tau - omega x J omega."""

    position = Output(Vector(3), unit="m", doc="of the centre of mass, in the world")
    velocity = Output(Vector(3), unit="m/s", doc="in the world")
    attitude = Output(Vector(4), doc="the quaternion (w, x, y, z) from the body to the world")
    rate = Output(Vector(3), unit="rad/s", doc="the rate of turn omega, in the body")

    position0: FloatArray = param([0.0, 0.0, 0.0], unit="m", shape=(3,), doc="at the start")
    velocity0: FloatArray = param([0.0, 0.0, 0.0], unit="m/s", shape=(3,), doc="at the start")
    attitude0: FloatArray = param(
        [1.0, 0.0, 0.0, 0.0], shape=(4,), doc="at the start, brought to length one"
    )
    rate0: FloatArray = param([0.0, 0.0, 0.0], unit="rad/s", shape=(3,), doc="at the start")

    # Of subclasses, whose defaults differ.
    mass: float
    inertia: FloatArray
    gravity: float

    def validate(self) -> None:
        inertia_matrix(self.inertia)
        if not self.attitude0.any():
            raise ParameterError([("attitude0", "expected a quaternion of length 1, got 0")])

    def start(self, state: BlockState) -> None:
        state.inertia = inertia_matrix(self.inertia)
        state.inverse = solve(state.inertia, np.eye(3))
        length = math.sqrt(float(self.attitude0 @ self.attitude0))
        begin = (self.position0, self.velocity0, self.attitude0 / length, self.rate0)
        state.x[:] = np.concatenate(begin)

    @property
    def state_names(self) -> dict[str, tuple[str, ...]]:
        return {"x": STATES}

    def output(
        self, state: BlockState, t: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        x = state.x
        return x[0:3].copy(), x[3:6].copy(), x[6:10].copy(), x[10:13].copy()

    def rates(self, state: BlockState, acceleration: FloatArray, torque: FloatArray) -> FloatArray:
        """x' for an acceleration in the world, and a torque in the body."""
        x, out = state.x, np.empty(13)
        w = x[10:13].copy()
        for i in range(3):
            out[i], out[3 + i] = x[3 + i], acceleration[i]
        out[6] = -0.5 * (x[7] * w[0] + x[8] * w[1] + x[9] * w[2])
        out[7] = 0.5 * (x[6] * w[0] + x[8] * w[2] - x[9] * w[1])
        out[8] = 0.5 * (x[6] * w[1] + x[9] * w[0] - x[7] * w[2])
        out[9] = 0.5 * (x[6] * w[2] + x[7] * w[1] - x[8] * w[0])
        left = torque - cross_product(w, turned(state.inertia, w))
        out[10:13] = turned(state.inverse, left)
        return out

    def to_length_one(self, state: BlockState) -> None:
        """Bring the quaternion back to length one."""
        total = 0.0
        for i in range(6, 10):
            total += state.x[i] * state.x[i]
        length = math.sqrt(total)
        for i in range(6, 10):
            state.x[i] /= length


class RigidBody(_Body):
    """A rigid body in space.

        force, torque ─▶ [ RigidBody ] ─▶ position, velocity, attitude, rate

    m v' = force - m g e_z, q' = q (0, omega) / 2, J omega' = torque - omega x J omega (Stevens,
    Lewis and Johnson, Aircraft Control and Simulation, 2016, section 1.7). The force acts on the
    centre of mass, and is in the world or in the body, as ``frame`` says; the torque is in the
    body. The quaternion is brought back to length one after each step of the solver.
    """

    force = Input(Vector(3), unit="N", default=0.0, doc="on the centre of mass")
    torque = Input(Vector(3), unit="N m", default=0.0, doc="about it, in the body")

    mass: float = param(1.0, unit="kg", above=0.0, doc="m")
    inertia: FloatArray = param(
        [0.1, 0.1, 0.1],
        unit="kg m^2",
        shape=[(3,), (3, 3)],
        doc="J: the principal moments, or the matrix",
    )
    gravity: float = param(0.0, unit="m/s^2", at_least=0.0, doc="g; 9.81 on the Earth")
    frame: str = param("world", choices=("world", "body"), doc="in which the force is given")

    x = State(13, name="x", continuous=True, doc="position, velocity, quaternion, rate of turn")

    def derivative(
        self, state: BlockState, t: float, force: FloatArray, torque: FloatArray
    ) -> FloatArray:
        acceleration = force / self.mass
        if self.frame == "body":
            acceleration = turned(rotation_matrix(state.x[6:10]), acceleration)
        acceleration[2] -= self.gravity
        return self.rates(state, acceleration, torque)

    def project(self, state: BlockState) -> None:
        self.to_length_one(state)


def allocation(arm: float, ratio: float, layout: str) -> FloatArray:
    """The matrix (4, 4) from the thrusts of rotors 1 to 4 to (thrust, torques about x, y, z).

    They stand counterclockwise, the first in front (``plus``) or in front on the left (``cross``).
    Rotors 1 and 3 turn clockwise seen from above: their torque on the body is counterclockwise.
    """
    first = 0.0 if layout == "plus" else 0.25 * math.pi
    angles = first + 0.5 * math.pi * np.arange(4)
    rows = [
        np.ones(4),
        arm * np.sin(angles),
        -arm * np.cos(angles),
        ratio * np.array([1, -1, 1, -1]),
    ]
    return np.array(rows)


class _Rotors(Block, ABC):
    """Where the rotors are, and what each can do."""

    arm: float = param(0.315, unit="m", above=0.0, doc="d, from the centre to a rotor")
    ratio: float = param(0.008004, unit="m", above=0.0, doc="c, torque of a rotor per thrust")
    layout: str = param("plus", choices=("plus", "cross"), doc="rotor 1 in front, or 45deg left")
    largest: float = param(25.0, unit="N", above=0.0, doc="thrust of a rotor, at most")


class RotorMixer(_Rotors):
    """Thrusts of four rotors that give a thrust and three torques, as far as they can.

        wrench ─▶ [ RotorMixer ] ─▶ rotors

    rotors = G^-1 (f, M_x, M_y, M_z), where that is within [0, largest]; G is that of a Quadrotor
    with the same ``arm``, ``ratio`` and ``layout`` (Lee, Leok and McClamroch, 2010, equation 1).
    Otherwise the torque about z gives way first, of which rotors have least, then the thrust, and
    those about x and y last, both by one factor: the attitude decides where the thrust points
    (after Faessler, Falanga and Scaramuzza, Thrust mixing, saturation and body-rate control, 2017).
    """

    wrench = Input(Vector(4), doc="thrust f along the body's z (N), torques about its axes (N m)")
    rotors = Output(Vector(4), unit="N", doc="thrust of each rotor")

    def start(self, state: BlockState) -> None:
        state.inverse = solve(allocation(self.arm, self.ratio, self.layout), np.eye(4))

    def output(self, state: BlockState, t: float, wrench: FloatArray) -> FloatArray:
        most, low, high = self.largest, 0.0, 0.0
        tilt, turn = np.empty(4), np.empty(4)
        for i in range(4):
            tilt[i] = state.inverse[i, 1] * wrench[1] + state.inverse[i, 2] * wrench[2]
            turn[i] = state.inverse[i, 3] * wrench[3]
            low, high = min(low, tilt[i]), max(high, tilt[i])
        share = most / (high - low) if high - low > most else 1.0
        base = min(max(state.inverse[0, 0] * wrench[0], -share * low), most - share * high)
        left = 1.0
        for i in range(4):
            tilt[i] = base + share * tilt[i]
            room = max(most - tilt[i] if turn[i] > 0.0 else tilt[i], 0.0)
            if abs(turn[i]) > room:
                left = min(left, room / abs(turn[i]))
        out = np.empty(4)
        for i in range(4):
            out[i] = min(max(tilt[i] + left * turn[i], 0.0), most)
        return out


class Quadrotor(_Body, _Rotors):
    """A quadrotor: a rigid body with four rotors that lag, drag, and wind.

        rotors, force, torque, wind ─▶ [ Quadrotor ] ─▶ position, velocity, attitude, rate,
                                                          acceleration, thrusts

    m v' = f R e_z - m g e_z - R D R' (v - wind) + force, J omega' = M + torque - omega x J omega,
    with (f, M) = G thrusts of the rotors (Lee, Leok and McClamroch, Geometric tracking control of a
    quadrotor UAV on SE(3), 2010; z up here), and tau thrusts' = rotors - thrusts, of rotors that
    are limited to [0, largest]. D is the drag of the rotors, linear in the speed of the air
    (Faessler, Franchi and Scaramuzza, 2018). The mass, J, arm and ratio are those of Lee et al.
    """

    rotors = Input(Vector(4), unit="N", doc="wanted thrust of each rotor")
    force = Input(Vector(3), unit="N", default=0.0, doc="a disturbance, in the world")
    torque = Input(Vector(3), unit="N m", default=0.0, doc="a disturbance, in the body")
    wind = Input(Vector(3), unit="m/s", default=0.0, doc="velocity of the air, in the world")
    acceleration = Output(Vector(3), unit="m/s^2", doc="v', in the world")
    thrusts = Output(Vector(4), unit="N", doc="thrust of each rotor")

    mass: float = param(4.34, unit="kg", above=0.0, doc="m")
    inertia: FloatArray = param(
        [0.0820, 0.0845, 0.1377],
        unit="kg m^2",
        shape=[(3,), (3, 3)],
        doc="J: the principal moments, or the matrix",
    )
    gravity: float = param(9.81, unit="m/s^2", at_least=0.0, doc="g")
    drag: FloatArray = param(
        [0.0, 0.0, 0.0], unit="N s/m", shape=(3,), at_least=0.0, doc="D along the body's axes"
    )
    tau: float = param(0.02, unit="s", above=0.0, doc="time constant of the rotors")
    hovers: bool = param(True, doc="the rotors carry the weight at the start, or stand still")

    x = State(13, name="x", continuous=True, doc="position, velocity, quaternion, rate of turn")
    lag = State(4, name="thrust", continuous=True, unit="N", doc="thrust of each rotor")

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.allocation = allocation(self.arm, self.ratio, self.layout)
        state.drag = self.drag.copy()
        if self.hovers:
            state.thrust[:] = 0.25 * self.mass * self.gravity

    def output(  # type: ignore[override]
        self, state: BlockState, t: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        x, thrusts = state.x, state.thrust.copy()
        return x[0:3].copy(), x[3:6].copy(), x[6:10].copy(), x[10:13].copy(), thrusts

    def output_acceleration(
        self, state: BlockState, t: float, force: FloatArray, wind: FloatArray
    ) -> FloatArray:
        matrix = rotation_matrix(state.x[6:10])
        air = turned_back(matrix, state.x[3:6] - wind)
        along = np.empty(3)
        for i in range(3):
            along[i] = -state.drag[i] * air[i]
        for i in range(4):
            along[2] += state.thrust[i]
        out = (turned(matrix, along) + force) / self.mass
        out[2] -= self.gravity
        return out

    def derivative(
        self,
        state: BlockState,
        t: float,
        rotors: FloatArray,
        torque: FloatArray,
        acceleration: FloatArray,
    ) -> Any:
        turning = torque.copy()
        for i in range(3):
            for j in range(4):
                turning[i] += state.allocation[1 + i, j] * state.thrust[j]
        rising = np.empty(4)
        for i in range(4):
            rising[i] = (min(max(rotors[i], 0.0), self.largest) - state.thrust[i]) / self.tau
        return self.rates(state, acceleration, turning), rising

    def project(self, state: BlockState) -> None:
        self.to_length_one(state)
