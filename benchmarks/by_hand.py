"""What an engineer writes who needs one diagram and no more: loops in numpy and in numba.

Each loop is one function that knows the whole diagram and nothing else: no checks of values, no
outputs that nobody reads, nothing that could be taken out or put in.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numba
import numpy as np

from benchmarks import tracking
from benchmarks.agreement import Run
from blocks.core import FloatArray

TAU_RC, TAU_REF, TAU_SYN = 0.02, 0.002, 0.01


class CaseA(NamedTuple):
    """The numbers of case A; arrays are (2, n): the speed's ensemble, then the turn rate's.

    path : (samples, 3), x, y and heading; window, every : samples, ticks.
    """

    x0: tuple[float, float, float]
    dt: float
    every: int
    path: FloatArray
    window: int
    forward: float
    k: FloatArray
    kappa: tuple[float, float]
    encoders: FloatArray
    bias: FloatArray
    voltage: FloatArray


def numpy_case_a(a: CaseA, ticks: int, filtered: str = "spikes") -> Run:
    """Case A with numpy, both ensembles in each call.

    ``filtered="decoded"`` puts the synapse behind the decoders, as nengo does; the weights move
    so slowly that it makes little difference, but more than rounding.
    """
    dt, n = a.dt, a.bias.shape[1]
    x, y, theta = a.x0
    path_xy = np.ascontiguousarray(a.path[:, :2])
    (k00, k01, k02), (k10, k11, k12) = a.k.tolist()
    pass_on = -math.expm1(-dt / TAU_SYN)
    gamma = np.array(a.kappa) * dt / n
    voltage, refractory = a.voltage.copy(), np.zeros((2, n))
    activity, weights = np.zeros((2, n)), np.zeros((2, n))
    decoded, signals = np.zeros(2), np.zeros(2)
    current, awake, rise = np.empty((2, n)), np.empty((2, n)), np.empty((2, n))
    flat_current, flat_voltage = current.ravel(), voltage.ravel()
    flat_refractory, flat_activity = refractory.ravel(), activity.ravel()
    poses = np.empty((ticks, 3))
    last, v_held, omega_held = -1, 0.0, 0.0
    began = time.perf_counter()
    for tick in range(ticks):
        poses[tick] = x, y, theta
        if tick % a.every == 0:
            low = max(0, last - a.window) if last >= 0 else 0
            high = last + a.window + 1 if last >= 0 else len(path_xy)
            apart = path_xy[low:high] - (x, y)
            last = low + int(np.einsum("ij,ij->i", apart, apart).argmin())
            x_r, y_r, theta_r = a.path[last].tolist()
            dx, dy = x - x_r, y - y_r
            heading = math.remainder(theta - theta_r, math.tau)
            c, s = math.cos(theta_r), math.sin(theta_r)
            along, lateral = c * dx + s * dy, c * dy - s * dx
            v_held = a.forward - (k00 * along + k01 * lateral + k02 * heading)
            omega_held = -(k10 * along + k11 * lateral + k12 * heading)
            signals[0], signals[1] = math.hypot(dx, dy), heading
        if filtered == "spikes":
            decoded[0], decoded[1] = weights[0].dot(activity[0]), weights[1].dot(activity[1])
        v, omega = v_held + decoded.item(0), omega_held + decoded.item(1)
        if abs(omega) > 1.0:
            v, omega = v / abs(omega), math.copysign(1.0, omega)
        half = 0.25 * dt * omega
        chord = dt * v * (math.sin(half) / half if half else 1.0)
        x, y = x + chord * math.cos(theta + half), y + chord * math.sin(theta + half)
        theta += 2.0 * half

        np.multiply(a.encoders, signals[:, None], out=current)
        current += a.bias
        refractory -= dt
        np.subtract(dt, refractory, out=awake)
        np.clip(awake, 0.0, dt, out=awake)
        awake *= -1.0 / TAU_RC
        np.expm1(awake, out=awake)
        np.subtract(current, voltage, out=rise)
        rise *= awake
        voltage -= rise
        spiking = (flat_voltage > 1.0).nonzero()[0]
        over = (1.0 - flat_voltage[spiking]) / (flat_current[spiking] - 1.0)
        flat_refractory[spiking] = TAU_REF + dt + TAU_RC * np.log1p(over)
        flat_voltage[spiking] = 0.0
        np.maximum(voltage, 0.0, out=voltage)
        if filtered == "decoded":
            fired = np.zeros(2 * n)
            fired[spiking] = 1.0 / dt
            now = np.einsum("ij,ij->i", weights, fired.reshape(2, n))
            decoded += pass_on * (now - decoded)
        activity *= 1.0 - pass_on
        flat_activity[spiking] += pass_on / dt
        np.multiply(activity, (gamma * signals)[:, None], out=rise)
        weights -= rise
    return Run(time.perf_counter() - began, poses)


def numba_case_a(a: CaseA, ticks: int) -> Run:
    """Case A compiled as one function."""
    arguments = (*a[:-1], a.voltage.copy(), np.empty((ticks, 3)))
    _case_a(*arguments[:-2], a.voltage.copy(), np.empty((0, 3)))
    began = time.perf_counter()
    _case_a(*arguments)
    return Run(time.perf_counter() - began, arguments[-1])


@numba.njit(cache=True)
def _case_a(x0, dt, every, path, window, forward, k, kappa, encoders, bias, voltage, poses):  # type: ignore[no-untyped-def]
    x, y, theta = x0
    n = bias.shape[1]
    refractory, activity, weights = np.zeros((2, n)), np.zeros((2, n)), np.zeros((2, n))
    few = np.empty(n, dtype=np.int64)
    last, v_held, omega_held, position, heading = -1, 0.0, 0.0, 0.0, 0.0
    pass_on, whole = -math.expm1(-dt / TAU_SYN), math.expm1(-dt / TAU_RC)
    decoded_v, decoded_omega = 0.0, 0.0
    for tick in range(len(poses)):
        poses[tick, 0], poses[tick, 1], poses[tick, 2] = x, y, theta
        if tick % every == 0:
            low = max(0, last - window) if last >= 0 else 0
            high = min(len(path), last + window + 1) if last >= 0 else len(path)
            least = np.inf
            for i in range(low, high):
                dx, dy = path[i, 0] - x, path[i, 1] - y
                square = dx * dx + dy * dy
                if square < least:
                    least, last = square, i
            dx, dy = x - path[last, 0], y - path[last, 1]
            angle = theta - path[last, 2]
            heading = angle - 2.0 * math.pi * np.round(angle / (2.0 * math.pi))
            position = math.sqrt(dx * dx + dy * dy)
            c, s = math.cos(path[last, 2]), math.sin(path[last, 2])
            along, lateral = c * dx + s * dy, c * dy - s * dx
            v_held = forward - (k[0, 0] * along + k[0, 1] * lateral + k[0, 2] * heading)
            omega_held = -(k[1, 0] * along + k[1, 1] * lateral + k[1, 2] * heading)
        v, omega = v_held + decoded_v, omega_held + decoded_omega
        if abs(omega) > 1.0:
            v, omega = v / abs(omega), math.copysign(1.0, omega)
        half = 0.25 * dt * omega
        chord = dt * v * (math.sin(half) / half if half != 0.0 else 1.0)
        x, y = x + chord * math.cos(theta + half), y + chord * math.sin(theta + half)
        theta += 2.0 * half
        decoded_v = _ensemble(
            *(position, kappa[0] * dt / n, dt, pass_on, whole, encoders[0], bias[0]),
            *(voltage[0], refractory[0], activity[0], weights[0], few),
        )
        decoded_omega = _ensemble(
            *(heading, kappa[1] * dt / n, dt, pass_on, whole, encoders[1], bias[1]),
            *(voltage[1], refractory[1], activity[1], weights[1], few),
        )


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _ensemble(  # type: ignore[no-untyped-def]
    signal, gamma, dt, pass_on, whole, encoders, bias, voltage, refractory, activity, weights, few
):
    """One step of an ensemble; returns what the next tick decodes.

    First what most neurons do, without branches, which the compiler turns into vector
    instructions; then the few that wake or spike in this step, listed without branches, too.
    """
    fade, kick = 1.0 - pass_on, pass_on / dt
    for i in range(len(bias)):
        refractory[i] -= dt
        rise = whole if refractory[i] <= 0.0 else 0.0
        current = encoders[i] * signal + bias[i]
        voltage[i] = max(voltage[i] - (current - voltage[i]) * rise, 0.0)
        activity[i] *= fade
    count = 0
    for i in range(len(bias)):
        few[count] = i
        count += (voltage[i] > 1.0) | ((refractory[i] > 0.0) & (refractory[i] < dt))
    for i in few[:count]:
        left = refractory[i]
        current = encoders[i] * signal + bias[i]
        if left > 0.0 and left < dt:
            rise = math.expm1(-(dt - left) / TAU_RC)
            voltage[i] = max(voltage[i] - (current - voltage[i]) * rise, 0.0)
        if voltage[i] > 1.0:
            since = math.log1p((1.0 - voltage[i]) / (current - 1.0))
            refractory[i] = TAU_REF + dt + TAU_RC * since
            voltage[i] = 0.0
            activity[i] += kick
    slope, decoded = gamma * signal, 0.0
    for i in range(len(bias)):
        weights[i] -= slope * activity[i]
        decoded += weights[i] * activity[i]
    return decoded


def numba_lif(
    encoders: FloatArray, bias: FloatArray, voltage: FloatArray, dt: float, ticks: int
) -> tuple[float, FloatArray]:
    """Seconds for a population of LIF neurons (n,) that is driven by a sine, and its voltages."""
    voltage = voltage.copy()
    _lif(encoders, bias, voltage.copy(), dt, 0)
    began = time.perf_counter()
    _lif(encoders, bias, voltage, dt, ticks)
    return time.perf_counter() - began, voltage


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _lif(encoders, bias, voltage, dt, ticks):  # type: ignore[no-untyped-def]
    """As :func:`_ensemble`, without decoding: first all neurons, then those that wake or spike."""
    n, whole = len(bias), math.expm1(-dt / TAU_RC)
    refractory, spikes, few = np.zeros(n), np.zeros(n), np.empty(n, dtype=np.int64)
    for tick in range(ticks):
        signal = 0.5 * math.sin(8.0 * (tick * dt))
        for i in range(n):
            refractory[i] -= dt
            rise = whole if refractory[i] <= 0.0 else 0.0
            current = encoders[i] * signal + bias[i]
            voltage[i] = max(voltage[i] - (current - voltage[i]) * rise, 0.0)
            spikes[i] = 0.0
        count = 0
        for i in range(n):
            few[count] = i
            count += (voltage[i] > 1.0) | ((refractory[i] > 0.0) & (refractory[i] < dt))
        for i in few[:count]:
            left = refractory[i]
            current = encoders[i] * signal + bias[i]
            if left > 0.0 and left < dt:
                rise = math.expm1(-(dt - left) / TAU_RC)
                voltage[i] = max(voltage[i] - (current - voltage[i]) * rise, 0.0)
            if voltage[i] > 1.0:
                since = math.log1p((1.0 - voltage[i]) / (current - 1.0))
                refractory[i] = TAU_REF + dt + TAU_RC * since
                voltage[i], spikes[i] = 0.0, 1.0 / dt


def numba_tracking(steps: int, dt: float) -> Run:
    """The diagram without neurons compiled as one function."""
    poses = np.empty((steps, 3))
    k = np.array(tracking.gain(dt))
    _tracking(tracking.X0, dt, k, np.empty((0, 3)))
    began = time.perf_counter()
    _tracking(tracking.X0, dt, k, poses)
    return Run(time.perf_counter() - began, poses)


@numba.njit(cache=True)
def _tracking(x0, dt, k, poses):  # type: ignore[no-untyped-def]
    x, y, theta = x0
    for tick in range(len(poses)):
        poses[tick, 0], poses[tick, 1], poses[tick, 2] = x, y, theta
        dy = y - 1.0
        dtheta = theta - 2.0 * math.pi * np.round(theta / (2.0 * math.pi))
        v = 1.0 - (k[0, 1] * dy + k[0, 2] * dtheta)
        omega = -(k[1, 1] * dy + k[1, 2] * dtheta)
        if abs(omega) > 1.0:
            v, omega = v / abs(omega), math.copysign(1.0, omega)
        x += dt * v * math.cos(theta)
        y += dt * v * math.sin(theta)
        theta += dt * 0.5 * omega
