"""Neuron models beside the LIF family: rectified linear, sigmoid, tanh, Izhikevich's.

Each is a class with its step (see :mod:`blocks.neural.neurons`): currents in, spikes or rates out::

    a: {type: Ensemble, neuron: {type: Sigmoid, tau_ref: 0.002}, max_rates: "uniform(300, 450)"}
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import FloatArray, kernel_of, param, portable
from blocks.neural.neurons import NeuronModel, NeuronStep, RateModel, independent

# exp(700) is about 1e304: a rate below 1e-300 Hz, where exp(710) would overflow.
LARGEST_EXPONENT = 700.0
BELOW_ONE = float(np.nextafter(1.0, 0.0))


class _Odd(NeuronModel, abstract=True):
    """A model whose intercept is at a current of 0."""

    def inverse(self, rates: FloatArray) -> FloatArray:
        """The currents at which the rates are these."""
        raise NotImplementedError

    def gain_and_bias(
        self, max_rates: FloatArray, intercepts: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        gain = self.inverse(max_rates) / (1.0 - intercepts)
        return gain, -gain * intercepts


class _Saturating(RateModel, _Odd, abstract=True):
    """A rate that is a function of the current alone, and never 1 / tau_ref."""

    tau_ref: float = param(0.0025, unit="s", above=0.0, doc="inverse of the largest rate")

    @property
    def fastest(self) -> float:
        return 1.0 / self.tau_ref

    def rates(self, current: FloatArray) -> FloatArray:
        currents = np.array(current, dtype=float).reshape(-1)
        rates, unused = np.empty(currents.size), np.zeros(0)
        type(self).step(1.0, currents, rates, unused, unused, unused, self.constants)
        return rates.reshape(np.shape(current))

    def share(self, rates: FloatArray) -> FloatArray:
        """Rates as shares of the largest: below 1, where rounding would make them 1."""
        return np.minimum(self.tau_ref * rates, BELOW_ONE)


@independent
def spiking_relu_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """V grows by max(J, 0) dt; each whole passed is a spike."""
    voltage += dt * np.maximum(current, 0.0)
    # More than one spike fits into a step; the rest stays, so that no rate is lost by rounding.
    whole = np.floor(voltage)
    voltage -= whole
    spikes[...] = whole / dt


class _Linear(_Odd, abstract=True):
    """Rates that are the current itself, where it is positive."""

    def rates(self, current: FloatArray) -> FloatArray:
        return np.maximum(current, 0.0)

    def inverse(self, rates: FloatArray) -> FloatArray:
        return rates


class SpikingReLU(_Linear):
    """Integrate-and-fire without a leak: V' = max(J, 0), a spike for each whole."""

    step = staticmethod(spiking_relu_step)


@independent
def relu_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """The current where it is positive."""
    spikes[...] = np.maximum(current, 0.0)


class ReLU(RateModel, _Linear):
    """A rate of max(J, 0)."""

    step = staticmethod(relu_step)


@independent
def sigmoid_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """The logistic function of the currents."""
    for i in range(len(current)):
        spikes[i] = 1.0 / (constants[0] * (1.0 + math.exp(min(-current[i], LARGEST_EXPONENT))))


class Sigmoid(_Saturating):
    """A rate of 1 / (tau_ref (1 + exp(-J))), half of the largest one at the intercept."""

    step = staticmethod(sigmoid_step)

    @property
    def slowest(self) -> float:
        return 0.5 / self.tau_ref

    def inverse(self, rates: FloatArray) -> FloatArray:
        return -portable.log(1.0 / self.share(rates) - 1.0)


@independent
def tanh_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """The hyperbolic tangent of the currents."""
    for i in range(len(current)):
        spikes[i] = math.tanh(current[i]) / constants[0]


class Tanh(_Saturating):
    """A rate of tanh(J) / tau_ref, negative on one side of the intercept."""

    step = staticmethod(tanh_step)

    def inverse(self, rates: FloatArray) -> FloatArray:
        return portable.atanh(self.share(rates))


@independent
def izhikevich_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """Izhikevich's equations by Euler's method, in ms; the voltage is reset in its own step."""
    # One step of Euler's method for v, as Nengo does; the paper's program takes two half steps.
    sharpness, coupling, reset_voltage, reset_recovery = constants.tolist()
    # Below -30, Euler's method with a step of 1 ms is unstable for some parameters.
    drive = np.maximum(current, -30.0)
    drive += (0.04 * voltage + 5.0) * voltage + 140.0 - recovery
    voltage += drive * (1000.0 * dt)
    spiking = voltage >= 30.0
    voltage[spiking] = reset_voltage
    recovery += sharpness * (coupling * voltage - recovery) * (1000.0 * dt)
    recovery[spiking] += reset_recovery
    spikes[...] = spiking / dt


@kernel_of(izhikevich_step)
def _izhikevich_kernel(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    # Without it, a graph of such neurons takes 1.3 times as long: each array is a pass.
    ms = 1000.0 * dt
    for i in range(len(voltage)):
        drive = max(current[i], -30.0)
        drive += (0.04 * voltage[i] + 5.0) * voltage[i] + 140.0 - recovery[i]
        voltage[i] += drive * ms
        spikes[i] = 0.0
        fired = voltage[i] >= 30.0
        if fired:
            voltage[i] = constants[2]
        recovery[i] += constants[0] * (constants[1] * voltage[i] - recovery[i]) * ms
        if fired:
            recovery[i] += constants[3]
            spikes[i] = 1.0 / dt


class Izhikevich(NeuronModel):
    """Izhikevich's neuron (2003): v' = 0.04 v^2 + 5 v + 140 - u + J, u' = a (b v - u), in ms."""

    initial_voltage = "-65"
    initial_recovery = 0.0

    tau_recovery: float = param(0.02, above=0.0, doc="a, in 1/ms")
    coupling: float = param(0.2, at_least=0.0, doc="b")
    reset_voltage: float = param(-65.0, unit="mV", doc="c, the voltage after a spike")
    reset_recovery: float = param(8.0, doc="d, added to u by a spike")
    step = staticmethod(izhikevich_step)

    @property
    def fastest(self) -> float:
        return 1000.0


@independent
def direct_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """The current, which is the represented value itself."""
    spikes[...] = current


class Direct(NeuronModel):
    """No neurons: the value itself, of which decoders compute their functions exactly."""

    spiking = False
    initial_voltage = "0"
    step = staticmethod(direct_step)

    def rates(self, current: FloatArray) -> FloatArray:
        return current

    def stacked(self, each: int) -> NeuronStep | None:
        return None
