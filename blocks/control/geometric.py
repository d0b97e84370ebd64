"""Control of position and attitude on SE(3), for bodies whose thrust is along one of their axes.

In: the state of a body, and a path with its derivatives. Out: a thrust and three torques::

    control: {type: GeometricControl, mass: 4.34, inertia: [0.082, 0.0845, 0.1377]}
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
    Scalar,
    Vector,
    cross_product,
    param,
    rotation_matrix,
    turned,
    turned_back,
)

TINY = 1e-9  # of a thrust (N), whose direction is not known below


def slope_of_direction(v: FloatArray, rate: FloatArray) -> FloatArray:
    """The rate of change of v / |v|, where v changes by ``rate``."""
    square, along = TINY * TINY, 0.0
    for i in range(3):
        square += v[i] * v[i]
        along += v[i] * rate[i]
    length = math.sqrt(square)
    out = np.empty(3)
    for i in range(3):
        out[i] = rate[i] / length - v[i] * along / (square * length)
    return out


def direction(v: FloatArray) -> FloatArray:
    """v / |v| of a vector (3,)."""
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + TINY * TINY)
    return v / length


class GeometricControl(Block):
    """Geometric tracking control of a quadrotor (Lee, Leok and McClamroch, 2010).

        position, velocity, attitude, rate,
        target, target_velocity, ...        ─▶ [ GeometricControl ] ─▶ wrench, errors

    e_x = x - x_d, e_v = v - v_d; A = -k_x e_x - k_v e_v + m g e_z + m x_d'' - force. The thrust is
    f = A . R e_z, and the attitude that is wanted, R_c, has A / |A| as z axis and its x axis as
    near to ``yaw`` as that allows. e_R = (R_c' R - R' R_c)^v / 2, e_w = omega - R' R_c omega_c,
    M = -k_R e_R - k_w e_w + omega x J omega - J (omega x R' R_c omega_c) (equations 10, 11, 15 and
    16, with z up). omega_c follows from x_d''' and from the acceleration that f causes; omega_c'
    is taken as 0, and yaw as constant. ``force`` is a known disturbance, as an observer or a
    network estimates it, and is compensated.
    """

    position = Input(Vector(3), unit="m", doc="x, in the world")
    velocity = Input(Vector(3), unit="m/s", doc="v, in the world")
    attitude = Input(Vector(4), doc="the quaternion (w, x, y, z) from the body to the world")
    rate = Input(Vector(3), unit="rad/s", doc="omega, in the body")
    target = Input(Vector(3), unit="m", doc="x_d")
    target_velocity = Input(Vector(3), unit="m/s", default=0.0, doc="x_d'")
    target_acceleration = Input(Vector(3), unit="m/s^2", default=0.0, doc="x_d''")
    target_jerk = Input(Vector(3), unit="m/s^3", default=0.0, doc="x_d'''")
    yaw = Input(Scalar, unit="rad", default=0.0, doc="heading of the body's x axis")
    force = Input(Vector(3), unit="N", default=0.0, doc="a disturbance, in the world")
    wrench = Output(Vector(4), doc="thrust f (N), torques M about the body's axes (N m)")
    errors = Output(Vector(6), doc="e_x (m) and e_v (m/s)")

    mass: float = param(4.34, unit="kg", above=0.0, doc="m")
    inertia: FloatArray = param(
        [0.0820, 0.0845, 0.1377], unit="kg m^2", shape=(3,), above=0.0, doc="diagonal of J"
    )
    gravity: float = param(9.81, unit="m/s^2", at_least=0.0, doc="g")
    kx: float = param(69.44, unit="N/m", above=0.0, doc="k_x; 16 m of the paper")
    kv: float = param(24.304, unit="N s/m", above=0.0, doc="k_v; 5.6 m of the paper")
    kr: float = param(8.81, name="kR", unit="N m", above=0.0, doc="k_R")
    kw: float = param(2.54, unit="N m s", above=0.0, doc="k_w")

    def start(self, state: BlockState) -> None:
        state.inertia = self.inertia.copy()

    def output_errors(
        self,
        state: BlockState,
        t: float,
        position: FloatArray,
        velocity: FloatArray,
        target: FloatArray,
        target_velocity: FloatArray,
    ) -> FloatArray:
        out = np.empty(6)
        for i in range(3):
            out[i], out[3 + i] = position[i] - target[i], velocity[i] - target_velocity[i]
        return out

    def output(
        self,
        state: BlockState,
        t: float,
        position: FloatArray,
        velocity: FloatArray,
        attitude: FloatArray,
        rate: FloatArray,
        target: FloatArray,
        target_velocity: FloatArray,
        target_acceleration: FloatArray,
        target_jerk: FloatArray,
        yaw: float,
        force: FloatArray,
    ) -> FloatArray:
        wanted, slope, miss = np.empty(3), np.empty(3), velocity - target_velocity
        for i in range(3):
            weight = self.gravity if i == 2 else 0.0
            pull = -self.kx * (position[i] - target[i]) - self.kv * miss[i]
            wanted[i] = pull + self.mass * (weight + target_acceleration[i]) - force[i]
        now = rotation_matrix(attitude)
        thrust = wanted[0] * now[0, 2] + wanted[1] * now[1, 2] + wanted[2] * now[2, 2]
        for i in range(3):
            # What the acceleration with this thrust differs by from the path's; rotors do not pull,
            # and a body that is upside down would be told to stay so.
            excess = (max(thrust, 0.0) * now[i, 2] + force[i]) / self.mass - target_acceleration[i]
            excess -= self.gravity if i == 2 else 0.0
            slope[i] = -self.kx * miss[i] - self.kv * excess + self.mass * target_jerk[i]
        frames = wanted_frames(wanted, slope, yaw)
        torques = self.moment(state, now, rate, frames)
        out = np.empty(4)
        out[0] = thrust
        for i in range(3):
            out[1 + i] = torques[i]
        return out

    def moment(
        self, state: BlockState, now: FloatArray, rate: FloatArray, frames: FloatArray
    ) -> FloatArray:
        """M (3,) for R, omega, and R_c with R_c'."""
        # The rate of turn that is wanted, in the wanted frame and then in the body's.
        turn, error = np.zeros(3), np.zeros(3)
        for i in range(3):
            turn[0] += frames[0, i, 2] * frames[1, i, 1]
            turn[1] += frames[0, i, 0] * frames[1, i, 2]
            turn[2] += frames[0, i, 1] * frames[1, i, 0]
            error[0] += 0.5 * (frames[0, i, 2] * now[i, 1] - now[i, 2] * frames[0, i, 1])
            error[1] += 0.5 * (frames[0, i, 0] * now[i, 2] - now[i, 0] * frames[0, i, 2])
            error[2] += 0.5 * (frames[0, i, 1] * now[i, 0] - now[i, 1] * frames[0, i, 0])
        own = turned_back(now, turned(frames[0], turn))
        spin = cross_product(rate, state.inertia * rate)
        lead = state.inertia * cross_product(rate, own)
        out = np.empty(3)
        for i in range(3):
            out[i] = spin[i] - lead[i] - self.kr * error[i] - self.kw * (rate[i] - own[i])
        return out


def wanted_frames(force: FloatArray, slope: FloatArray, yaw: float) -> FloatArray:
    """R_c and its rate of change, (2, 3, 3), for a force that changes by ``slope``.

    The columns of R_c are the axes: z along the force, y across z and the heading, x = y x z.
    """
    heading = np.zeros(3)
    heading[0], heading[1] = math.cos(yaw), math.sin(yaw)
    z, z_slope = direction(force), slope_of_direction(force, slope)
    side, side_slope = cross_product(z, heading), cross_product(z_slope, heading)
    y, y_slope = direction(side), slope_of_direction(side, side_slope)
    x = cross_product(y, z)
    x_slope = cross_product(y_slope, z) + cross_product(y, z_slope)
    out = np.empty((2, 3, 3))
    for i in range(3):
        out[0, i, 0], out[0, i, 1], out[0, i, 2] = x[i], y[i], z[i]
        out[1, i, 0], out[1, i, 1], out[1, i, 2] = x_slope[i], y_slope[i], z_slope[i]
    return out
