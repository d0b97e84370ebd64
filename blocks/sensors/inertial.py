"""An inertial measurement unit: gyroscopes and accelerometers.

The motion of a body goes in, what its sensors say comes out, at each tick of the block::

    imu: {type: IMU, dt: 0.004}      # of a Quadrotor's rate, acceleration and attitude
"""

from __future__ import annotations

import math

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Input,
    Output,
    Scalar,
    State,
    Vector,
    param,
    rotation_matrix,
    turned_back,
)


class IMU(Block):
    """Gyroscopes and accelerometers, with white noise and biases that walk at random.

        rate, acceleration, attitude ─▶ [ IMU ] ─▶ gyro, accelerometer, stamp

    gyro = omega + b_g + n_g, accelerometer = R' (v' + g e_z) + b_a + n_a, in the body: at rest it
    measures the weight. n is white with the density sigma, so that each sample has the deviation
    sigma / sqrt(dt), and b' is white with the density of the walk: b grows by walk sqrt(dt) n
    (Trawny and Roumeliotis, Indirect Kalman filter for 3D attitude estimation, 2005, section 2.1;
    Crassidis, Sigma-point Kalman filtering, 2006). The defaults are those of an ADIS16448, a small
    MEMS unit; the densities are those that an Allan variance shows at 1 s.
    """

    rate = Input(Vector(3), unit="rad/s", doc="rate of turn omega, in the body")
    acceleration = Input(Vector(3), unit="m/s^2", doc="v', in the world")
    attitude = Input(Vector(4), doc="the quaternion from the body to the world")
    gyro = Output(Vector(3), unit="rad/s", doc="measured rate of turn")
    accelerometer = Output(Vector(3), unit="m/s^2", doc="measured specific force")
    stamp = Output(Scalar, unit="s", doc="when it was measured")

    gyro_noise: float = param(
        3.394e-4, unit="rad/s/sqrt(Hz)", at_least=0.0, doc="density of the gyroscopes' noise"
    )
    gyro_walk: float = param(
        3.879e-5, unit="rad/s^2/sqrt(Hz)", at_least=0.0, doc="density of their bias's walk"
    )
    gyro_bias: FloatArray = param(
        [0.0, 0.0, 0.0], unit="rad/s", shape=(3,), doc="their bias at the start"
    )
    accelerometer_noise: float = param(
        4.0e-3, unit="m/s^2/sqrt(Hz)", at_least=0.0, doc="density of the accelerometers' noise"
    )
    accelerometer_walk: float = param(
        6.0e-3, unit="m/s^3/sqrt(Hz)", at_least=0.0, doc="density of their bias's walk"
    )
    accelerometer_bias: FloatArray = param(
        [0.0, 0.0, 0.0], unit="m/s^2", shape=(3,), doc="their bias at the start"
    )
    gravity: float = param(9.81, unit="m/s^2", at_least=0.0, doc="g")

    bias = State(2, 3, doc="biases: of the gyroscopes (rad/s), of the accelerometers (m/s^2)")
    noise = State(2, 3, doc="what this tick adds to both")

    def start(self, state: BlockState) -> None:
        state.bias[0], state.bias[1] = self.gyro_bias, self.accelerometer_bias
        self.draw(state)

    def draw(self, state: BlockState) -> None:
        white = 1.0 / math.sqrt(state.dt)
        for i in range(3):
            state.noise[0, i] = self.gyro_noise * white * state.rng.standard_normal()
            state.noise[1, i] = self.accelerometer_noise * white * state.rng.standard_normal()

    def output(
        self,
        state: BlockState,
        t: float,
        rate: FloatArray,
        acceleration: FloatArray,
        attitude: FloatArray,
    ) -> tuple[FloatArray, FloatArray, float]:
        lifted = acceleration.copy()
        lifted[2] += self.gravity
        gyro, force = rate.copy(), turned_back(rotation_matrix(attitude), lifted)
        for i in range(3):
            gyro[i] += state.bias[0, i] + state.noise[0, i]
            force[i] += state.bias[1, i] + state.noise[1, i]
        return gyro, force, t

    def update(self, state: BlockState, t: float) -> None:
        root = math.sqrt(state.dt)
        for i in range(3):
            state.bias[0, i] += self.gyro_walk * root * state.rng.standard_normal()
            state.bias[1, i] += self.accelerometer_walk * root * state.rng.standard_normal()
        self.draw(state)
