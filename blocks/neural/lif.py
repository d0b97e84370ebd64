"""Leaky integrate-and-fire neurons: the one text of their step and of their steady rate.

    tau_rc V' = J - V;  a spike where V passes 1, then V = 0 for tau_ref
    r(J) = 1 / (tau_ref + tau_rc log1p(1 / (J - 1))) above J = 1, else 0

Arrays of n neurons go in and are changed in place: currents J in, spikes out. The models of an
Ensemble and the fused blocks (:mod:`blocks.neural.adaptive`) call the same functions::

    lif_step(0.001, current, spikes, voltage, refractory, recovery, LIF().constants)
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from blocks.core import FloatArray, kernel_of, param, portable
from blocks.core.polynomials import any_order, expm1, expm1_of, log1p, log1p_of
from blocks.neural.neurons import NeuronModel, NeuronStep, RateModel, independent

# From this many neurons, leaving out those that are awake for the whole step pays in Python.
MANY = 301
# The longest step, in tau_rc: exp(-30) of the way to J is left, 400 times the rounding of J. After
# 37, V is J, and when it passed 1 can no longer be told.
LONGEST_STEP = 30.0
ABOVE_ONE = float(np.nextafter(1.0, 2.0))
# NumPy takes an array without axes much faster than a number.
ZERO, ONE = np.array(0.0), np.array(1.0)


def lif_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """One step of LIF neurons; a spike inside a step shortens the refractory time by the rest.

    A neuron wakes inside the step if its refractory time ends there: V then rises for the rest of
    the step only. Of the same voltage and current, the time since a spike follows in closed form,
    tau_rc log1p((1 - V) / (J - 1)), so that rates are right at any step up to tau_ref.
    """
    lif_steps(len(voltage), dt, current, spikes, voltage, refractory, constants)


def lif_steps(
    each: int,
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    constants: FloatArray,
) -> None:
    """:func:`lif_step` of any number of populations of ``each`` neurons, with the same bits."""
    tau_rc, tau_ref, floor = constants.tolist()[:3]
    step, tau = np.array(dt), np.array(tau_rc)
    refractory -= step
    rise = np.subtract(current, voltage, out=spikes)  # written again below
    if len(voltage) < MANY:
        # The same for all of them: fewer calls, which is what counts for few neurons.
        awake = refractory - step
        np.maximum(awake, -step, out=awake)
        np.minimum(awake, ZERO, out=awake)
        awake /= tau
        rise *= portable.expm1(awake, out=awake)
    else:
        partly = ((refractory > 0.0) & (refractory < dt)).nonzero()[0]
        waking = rise[partly] * portable.expm1((refractory[partly] - dt) / tau_rc)
        # Many populations that are few neurons each have the bits of the case above.
        rise *= math.expm1(-dt / tau_rc) if each >= MANY else portable.expm1(-dt / tau_rc)
        rise *= refractory <= 0.0
        rise[partly] = waking
    voltage -= rise
    spiking = (voltage > ONE).nonzero()[0]
    since = np.subtract(ONE, voltage[spiking])
    since /= current[spiking] - ONE
    portable.log1p(since, out=since)
    since *= tau
    since += np.array(tau_ref + dt)
    refractory[spiking] = since
    np.maximum(voltage, np.array(floor), out=voltage)
    voltage[spiking] = 0.0
    spikes.fill(0.0)
    spikes[spiking] = 1.0 / dt


@kernel_of(lif_step)
def _lif_kernel(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    n, full, floor = len(voltage), expm1(np.divide(-dt, constants[0])), constants[2]
    marks = np.empty(n, dtype=np.int64)
    for i in any_order(n):
        left = refractory[i] - dt
        v = risen(voltage[i], current[i], full if left <= 0.0 else 0.0, floor)
        refractory[i], voltage[i], spikes[i] = left, v, 0.0
        marks[i] = marked(v, left, dt)
    wake_and_spike(dt, current, spikes, voltage, refractory, constants, marks)


def risen(voltage: float, current: float, rise: float, floor: float) -> float:
    """The voltage after a step, ``rise`` = expm1(-dt / tau_rc), in compiled code."""
    return max(voltage - (current - voltage) * rise, floor)


def marked(voltage: float, left: float, dt: float) -> int:
    """1 for a neuron that wakes up or spikes inside a step, in compiled code."""
    # Not by 'or', of which gcc makes no vector instructions here.
    return 1 if voltage > 1.0 else ((1 if left < dt else 0) if left > 0.0 else 0)


def wake_and_spike(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    constants: FloatArray,
    marks: npt.NDArray[np.int64],
) -> npt.NDArray[np.int64]:
    """What few neurons do in a step, in compiled code: returns those that are marked.

    They are listed without a branch, which a processor would guess wrongly for as many as there
    are, and computed side by side from the list.
    """
    tau_rc, tau_ref, height = constants[0], constants[1], np.divide(1.0, dt)
    floor = constants[2]
    few = np.flatnonzero(marks)
    rise, ratio = np.empty(len(few)), np.empty(len(few))
    for j in any_order(len(few)):
        left = refractory[max(few[j], 0)]  # none is counted from the end, which would be tested
        rise[j] = np.divide(left - dt, tau_rc) if (left > 0.0) & (left < dt) else 0.0
    expm1_of(rise)
    for j in range(len(few)):
        at = max(few[j], 0)
        v = risen(voltage[at], current[at], rise[j], floor)
        voltage[at], ratio[j] = v, np.divide(1.0 - v, current[at] - 1.0)
        marks[j] = 1 if v > 1.0 else 0
    fired = np.flatnonzero(marks[: len(few)])
    since = np.empty(len(fired))
    for j in any_order(len(fired)):
        since[j] = ratio[max(fired[j], 0)]
    log1p_of(since)
    for j in range(len(fired)):
        at = max(few[max(fired[j], 0)], 0)
        refractory[at], voltage[at], spikes[at] = tau_ref + dt + tau_rc * since[j], 0.0, height
    return few


def lif_rates(current: FloatArray, tau_rc: float, tau_ref: float) -> FloatArray:
    """1 / (tau_ref + tau_rc log1p(1 / (J - 1))) above J = 1, else 0."""
    above = np.asarray(current) - 1.0
    firing = above > 0.0
    rates = np.zeros(above.shape)
    rates[firing] = 1.0 / (tau_ref + tau_rc * portable.log1p(1.0 / above[firing]))
    return rates


def lif_gain_and_bias(z: FloatArray, intercepts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gain and bias of neurons that fire at their largest rate for an input of 1.

    gain = (1 - z) / (intercept - 1), bias = 1 - gain * intercept, where z, from the largest rate,
    is 1 / (1 - exp((tau_ref - 1 / rate) / tau_rc)): r(J) solved for J at that rate.
    """
    gain = (1.0 - z) / (intercepts - 1.0)
    return gain, 1.0 - gain * intercepts


class _Leaky(NeuronModel, abstract=True):
    """What LIF neurons have in common, spiking or not."""

    tau_rc: float = param(0.02, unit="s", above=0.0, doc="membrane time constant")
    tau_ref: float = param(0.002, unit="s", above=0.0, doc="refractory time")

    @property
    def fastest(self) -> float:
        return 1.0 / self.tau_ref

    @property
    def slowest(self) -> float:
        # Below the rate of the least current above 1, gains would round to 0. By math, since
        # a graph is checked without SciPy, which the rates take log1p from.
        return 1.0 / (self.tau_ref + self.tau_rc * math.log1p(1.0 / (ABOVE_ONE - 1.0)))

    def rates(self, current: FloatArray) -> FloatArray:
        return lif_rates(current, self.tau_rc, self.tau_ref)

    def gain_and_bias(
        self, max_rates: FloatArray, intercepts: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        z = -1.0 / portable.expm1((self.tau_ref - 1.0 / max_rates) / self.tau_rc)
        return lif_gain_and_bias(z, intercepts)


class LIF(_Leaky):
    """Leaky integrate-and-fire: tau_rc V' = J - V; a spike where V passes 1, then silence."""

    min_voltage: float = param(
        0.0, at_most=0.0, finite=False, doc="least voltage, which inhibition cannot pass; or -inf"
    )
    step = staticmethod(lif_step)

    def stacked(self, each: int) -> NeuronStep | None:
        if type(self).step is not lif_step:
            return super().stacked(each)

        def step(
            dt: float,
            current: FloatArray,
            spikes: FloatArray,
            voltage: FloatArray,
            refractory: FloatArray,
            recovery: FloatArray,
            constants: FloatArray,
        ) -> None:
            lif_steps(each, dt, current, spikes, voltage, refractory, constants)

        return step

    def too_long(self, dt: float) -> str:
        if dt > self.tau_ref:
            return (
                f"a step of {dt:g} s is longer than tau_ref = {self.tau_ref:g} s and would lose "
                "spikes"
            )
        if dt > LONGEST_STEP * self.tau_rc:
            return (
                f"a step of {dt:g} s is longer than {LONGEST_STEP:g} times tau_rc = "
                f"{self.tau_rc:g} s, so that the time of a spike in it cannot be told"
            )
        return ""


@independent
def lif_rate_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """The steady rates of LIF neurons at the currents of this step."""
    spikes[...] = lif_rates(current, constants.item(0), constants.item(1))


@kernel_of(lif_rate_step)
def _lif_rate_kernel(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    tau_rc, tau_ref = constants[0], constants[1]
    for i in any_order(len(current)):
        above = current[i] - 1.0
        rate = np.divide(1.0, tau_ref + tau_rc * log1p(np.divide(1.0, above)))
        spikes[i] = rate if above > 0.0 else 0.0


class LIFRate(RateModel, _Leaky):
    """The steady rate of LIF neurons, without spikes."""

    step = staticmethod(lif_rate_step)


@independent
def adaptive_lif_rate_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """LIF's rate at the current less the adaptation, which follows the rate."""
    current -= recovery
    lif_rate_step(dt, current, spikes, voltage, refractory, recovery, constants)
    recovery += (dt / constants.item(2)) * (constants.item(3) * spikes - recovery)


class _Adaptive(NeuronModel, abstract=True):
    """Parameters of a current that spikes raise and that decays."""

    tau_n: float = param(1.0, unit="s", above=0.0, doc="time constant of the adaptation")
    inc_n: float = param(0.01, at_least=0.0, doc="adaptation per spike")

    @property
    def constants(self) -> FloatArray:
        # Spikes are multiplied by the amplitude after the step, and the adaptation sees them so.
        values = super().constants
        values[-1] *= self.amplitude
        return values


class AdaptiveLIFRate(_Adaptive, LIFRate):
    """LIF's rate at the current J - n, with tau_n n' = inc_n rate - n."""

    step = staticmethod(adaptive_lif_rate_step)


def adaptive_lif_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """LIF of the current less the adaptation, which each spike raises and which decays."""
    current -= recovery
    lif_step(dt, current, spikes, voltage, refractory, recovery, constants)
    recovery += (dt / constants.item(3)) * (constants.item(4) * spikes - recovery)


class AdaptiveLIF(_Adaptive, LIF):
    """LIF of the current J - n, with tau_n n' = inc_n spikes - n (La Camera et al., 2004)."""

    step = staticmethod(adaptive_lif_step)
