"""Turbulent wind near the ground, as aircraft are tested with.

Out comes the velocity of the air in the world (3,)::

    wind: {type: DrydenWind, altitude: 10, airspeed: 5, speed: 8, mean: [4, 0, 0]}
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import Block, BlockState, FloatArray, Output, State, Vector, param

FOOT = 0.3048


def lengths_and_deviations(altitude: float, speed: float) -> tuple[FloatArray, FloatArray]:
    """Scale lengths (m) and standard deviations (m/s) of u, v, w, by MIL-F-8785C below 1000 ft.

    ``speed`` is the mean wind at 20 ft (m/s).
    """
    h = altitude / FOOT
    c = 0.177 + 0.000823 * h
    long, sigma = altitude / c**1.2, 0.1 * speed
    wide = sigma / c**0.4
    return np.array([long, long, altitude]), np.array([wide, wide, sigma])


def noise_covariance(a: float) -> FloatArray:
    """The covariance (2, 2) that white noise adds to two lags in a row, in a time constants.

    z1' = w - z1, z2' = z1 - z2 with white w of density 1: the integrals over r from 0 to a of
    e^-2r, r e^-2r and r^2 e^-2r. By quadrature, as the closed forms cancel where a is small.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)
    end = min(a, 20.0)  # what is older has decayed to e^-40
    r = 0.5 * end * (nodes + 1.0)
    own = 0.5 * end * weights * np.exp(-2.0 * r)
    first, both, second = (float(np.sum(own * r**d)) for d in range(3))
    return np.array([[first, both], [both, second]])


def root(matrix: FloatArray) -> FloatArray:
    """The lower triangle L (2, 2) with L L' = a covariance."""
    first = math.sqrt(matrix[0, 0])
    low = matrix[1, 0] / first
    return np.array([[first, 0.0], [low, math.sqrt(max(matrix[1, 1] - low * low, 0.0))]])


class DrydenWind(Block):
    """Wind with Dryden's turbulence.

        [ DrydenWind ] ─▶ wind

    wind = mean + (u, v, w), independent Gaussian processes with the spectra of Dryden (MIL-F-8785C,
    1980, section 3.7): white noise through sigma sqrt(2 T) / (1 + T s) for u, along ``direction``,
    and sigma sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2 for v and w, with T = L / airspeed. Below 1000
    ft, L_w = h, L_u = L_v = h / (0.177 + 0.000823 h)^1.2 and sigma_w = 0.1 speed,
    sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4, h in ft. Sampled exactly at the block's
    step, held between ticks; it begins in the stationary state.
    """

    wind = Output(Vector(3), unit="m/s", doc="velocity of the air, in the world")

    altitude: float = param(10.0, unit="m", above=0.0, at_most=304.8, doc="h, above the ground")
    airspeed: float = param(5.0, unit="m/s", above=0.0, doc="V, at which eddies pass by")
    speed: float = param(
        7.7, unit="m/s", at_least=0.0, doc="wind at 20 ft; 7.7 is light, 15 moderate"
    )
    mean: FloatArray = param([0.0, 0.0, 0.0], unit="m/s", shape=(3,), doc="mean wind")
    direction: float = param(0.0, unit="rad", doc="of u, from the world's x")

    lags = State(3, 2, doc="two lags in a row for each of u, v, w")

    def start(self, state: BlockState) -> None:
        lengths, sigmas = lengths_and_deviations(self.altitude, self.speed)
        state.mean = self.mean.copy()
        state.cos, state.sin = math.cos(self.direction), math.sin(self.direction)
        state.keep, state.pass_on = np.empty(3), np.empty(3)
        state.roots, state.gains = np.empty((3, 2, 2)), np.empty((3, 2))
        for i in range(3):
            a = state.dt * self.airspeed / lengths[i]
            state.keep[i] = math.exp(-a)
            state.pass_on[i] = a * math.exp(-a)
            state.roots[i] = root(noise_covariance(a))
            # In time constants, K / (1 + s) of white noise has the variance K^2 / 2.
            first = math.sqrt(3.0) if i else math.sqrt(2.0)
            state.gains[i] = sigmas[i] * np.array([first, 1.0 - math.sqrt(3.0) if i else 0.0])
            stationary = root(np.array([[0.5, 0.25], [0.25, 0.25]]))
            n1, n2 = state.rng.standard_normal(), state.rng.standard_normal()
            state.lags[i, 0] = stationary[0, 0] * n1
            state.lags[i, 1] = stationary[1, 0] * n1 + stationary[1, 1] * n2

    def output(self, state: BlockState, t: float) -> FloatArray:
        gust = np.empty(3)
        for i in range(3):
            gust[i] = state.gains[i, 0] * state.lags[i, 0] + state.gains[i, 1] * state.lags[i, 1]
        out: FloatArray = state.mean.copy()
        out[0] += state.cos * gust[0] - state.sin * gust[1]
        out[1] += state.sin * gust[0] + state.cos * gust[1]
        out[2] += gust[2]
        return out

    def update(self, state: BlockState, t: float) -> None:
        for i in range(3):
            n1, n2 = state.rng.standard_normal(), state.rng.standard_normal()
            before = state.lags[i, 0]
            state.lags[i, 0] = state.keep[i] * before + state.roots[i, 0, 0] * n1
            noise = state.roots[i, 1, 0] * n1 + state.roots[i, 1, 1] * n2
            state.lags[i, 1] = state.keep[i] * state.lags[i, 1] + state.pass_on[i] * before + noise
