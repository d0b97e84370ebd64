"""Neuron models: how a current becomes spikes or a rate, step by step and in the steady state.

A model is a short class. ``step`` advances all neurons by one step, in place::

    step(dt, current, spikes, voltage, refractory, recovery, constants)

with arrays of one entry per neuron: the input ``current``, the ``spikes`` that it writes (1/dt for
each spike, or a rate in Hz), up to three numbers per neuron that it keeps, and ``constants``, its
parameters in the order in which they are declared. It is a plain function without ``self``, so
that it can be compiled. ``rates`` gives the steady rates, from which decoders are solved; a model
may leave it out. A graph names a model of one's own with its file,
``neuron: {type: Mine, module: mine.py, ...}``.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from functools import lru_cache
from typing import ClassVar

import numpy as np

from blocks.core import FloatArray, Variant, kernel_of, param, portable

Step = Callable[..., None]
SETTLING, COUNTING, TABLE = 0.1, 1.0, 800
FEW = 300
STEP = ["dt", "current", "spikes", "voltage", "refractory", "recovery", "constants"]


class NeuronModel(Variant, root=True, registry="neurons"):
    """A neuron model; a subclass declares parameters, ``step`` and, if possible, ``rates``.

    spiking : whether ``spikes`` are spikes; their number per step is then limited by dt.
    """

    expected: ClassVar[str] = "a neuron model"
    of_ones_own = "; your own needs its file, as in {type: Mine, module: mine.py}"
    spiking: ClassVar[bool] = True
    initial_voltage: ClassVar[str] = "uniform(0, 1)"
    initial_recovery: ClassVar[float] = 0.0
    step: ClassVar[Step]

    def wrong(self) -> list[tuple[str, str]]:
        """Why the class itself is no neuron model."""
        step, name = inspect.getattr_static(type(self), "step", None), type(self).__name__
        taken = list(inspect.signature(type(self).step).parameters) if step is not None else []
        if isinstance(step, staticmethod) and taken == STEP:
            return []
        written = "has none" if step is None else f"has step({', '.join(taken)})"
        if step is not None and not isinstance(step, staticmethod):
            written += " that is no static method"
        return [
            (
                "",
                f"a neuron model has '@staticmethod def step({', '.join(STEP)})'; {name} {written}",
            )
        ]

    def rates(self, current: FloatArray) -> FloatArray:
        """Steady firing rates in Hz at constant currents, of the same shape.

        A model without a formula is simulated once for many currents, and interpolated between.
        """
        currents, rates = _table(self)
        return np.interp(current, currents, rates)

    @property
    def fastest(self) -> float:
        """The rate in Hz that is never reached."""
        return math.inf

    def too_long(self, dt: float) -> str:
        """Why a step is too long for the model; '' if it is not."""
        return ""

    @property
    def constants(self) -> FloatArray:
        """The parameters as ``step`` takes them."""
        return np.array([float(self.__dict__[name]) for name in self.declared])

    def gain_and_bias(
        self, max_rates: FloatArray, intercepts: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Gains and biases with which neurons fire at ``max_rates`` for an input of 1 along their
        encoder, and start to fire at ``intercepts``; by bisection of ``rates``.
        """
        first = self._current_at(np.zeros_like(max_rates), above=True)
        last = self._current_at(max_rates)
        gain = (last - first) / (1.0 - intercepts)
        return gain, last - gain

    def _current_at(self, rates: FloatArray, above: bool = False) -> FloatArray:
        """The smallest currents with a rate of at least, or ``above``, the given one."""
        low, high = np.full(rates.shape, -1.0), np.ones(rates.shape)
        for _ in range(60):
            short = self.rates(high) < rates if not above else self.rates(high) <= rates
            if not short.any():
                break
            high[short] *= 2.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            found = self.rates(middle)
            reached = found > rates if above else found >= rates
            low, high = np.where(reached, low, middle), np.where(reached, middle, high)
        return high

    def simulated_rates(self, current: FloatArray, dt: float = 0.001) -> FloatArray:
        """Spikes per second over 1 s, after 0.1 s to settle, of neurons at constant currents."""
        flat = np.ascontiguousarray(current, dtype=float).reshape(-1)
        voltage, refractory = np.zeros(flat.size), np.zeros(flat.size)
        if not self.initial_voltage.startswith("uniform"):
            voltage[:] = float(self.initial_voltage)
        recovery = np.full(flat.size, self.initial_recovery)
        spikes, total = np.zeros(flat.size), np.zeros(flat.size)
        constants = self.constants
        for k in range(round((SETTLING + COUNTING) / dt)):
            type(self).step(dt, flat, spikes, voltage, refractory, recovery, constants)
            if k >= round(SETTLING / dt):
                total += spikes
        return np.asarray(total * dt / COUNTING).reshape(np.shape(current))


@lru_cache(32)
def _table(model: NeuronModel) -> tuple[FloatArray, FloatArray]:
    """Currents, densest around zero, and a model's simulated rates there."""
    currents = np.sinh(np.linspace(-3.0, 8.0, TABLE))
    return currents, np.maximum.accumulate(model.simulated_rates(currents))


def lif_step(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    """One step of LIF neurons; a spike inside a step shortens the refractory time by the rest."""
    tau_rc, tau_ref = constants.item(0), constants.item(1)
    refractory -= dt
    rise = np.subtract(current, voltage, out=spikes)  # written again below
    if len(voltage) <= FEW:
        # The same for all of them: fewer calls, which is what counts for few neurons.
        awake = np.minimum(np.maximum(refractory - dt, -dt), 0.0)
        awake /= tau_rc
        rise *= portable.expm1(awake, out=awake)
    else:
        partly = ((refractory > 0.0) & (refractory < dt)).nonzero()[0]
        waking = rise[partly] * portable.expm1((refractory[partly] - dt) / tau_rc)
        rise *= math.expm1(-dt / tau_rc)
        rise *= refractory <= 0.0
        rise[partly] = waking
    voltage -= rise
    spiking = (voltage > 1.0).nonzero()[0]
    since = (1.0 - voltage[spiking]) / (current[spiking] - 1.0)
    refractory[spiking] = tau_ref + dt + tau_rc * portable.log1p(since)
    np.maximum(voltage, 0.0, out=voltage)
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
    tau_rc, tau_ref = constants[0], constants[1]
    full, height = math.expm1(-dt / tau_rc), 1.0 / dt
    for i in range(len(voltage)):
        refractory[i] -= dt
        rise = full if refractory[i] <= 0.0 else 0.0
        voltage[i] = max(voltage[i] - (current[i] - voltage[i]) * rise, 0.0)
        spikes[i] = 0.0
    # The few that wake up, then those that spike: marked, then listed, without a branch.
    few, count = np.empty(len(voltage), dtype=np.int64), 0
    for i in range(len(voltage)):
        few[i] = (refractory[i] > 0.0) & (refractory[i] < dt)
    for i in range(len(voltage)):
        marked = few[i]
        few[count] = i
        count += marked
    for i in few[:count]:
        rise = math.expm1((refractory[i] - dt) / tau_rc)
        voltage[i] = max(voltage[i] - (current[i] - voltage[i]) * rise, 0.0)
    for i in range(len(voltage)):
        few[i] = voltage[i] > 1.0
    count = 0
    for i in range(len(voltage)):
        marked = few[i]
        few[count] = i
        count += marked
    for i in few[:count]:
        since = math.log1p((1.0 - voltage[i]) / (current[i] - 1.0))
        refractory[i] = tau_ref + dt + tau_rc * since
        voltage[i] = 0.0
        spikes[i] = height


def lif_rates(current: FloatArray, tau_rc: float, tau_ref: float) -> FloatArray:
    """1 / (tau_ref + tau_rc log1p(1 / (J - 1))) above J = 1, else 0."""
    above = np.asarray(current) - 1.0
    firing = above > 0.0
    rates = np.zeros(above.shape)
    rates[firing] = 1.0 / (tau_ref + tau_rc * portable.log1p(1.0 / above[firing]))
    return rates


class _Leaky(NeuronModel, abstract=True):
    """What LIF neurons have in common, spiking or not."""

    tau_rc: float = param(0.02, unit="s", above=0.0, doc="membrane time constant")
    tau_ref: float = param(0.002, unit="s", above=0.0, doc="refractory time")

    @property
    def fastest(self) -> float:
        return 1.0 / self.tau_ref

    def rates(self, current: FloatArray) -> FloatArray:
        return lif_rates(current, self.tau_rc, self.tau_ref)

    def gain_and_bias(
        self, max_rates: FloatArray, intercepts: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        z = -1.0 / portable.expm1((self.tau_ref - 1.0 / max_rates) / self.tau_rc)
        gain = (1.0 - z) / (intercepts - 1.0)
        return gain, 1.0 - gain * intercepts


class LIF(_Leaky):
    """Leaky integrate-and-fire: tau_rc V' = J - V; a spike where V passes 1, then silence."""

    step = staticmethod(lif_step)

    def too_long(self, dt: float) -> str:
        if dt <= self.tau_ref:
            return ""
        return (
            f"a step of {dt:g} s is longer than tau_ref = {self.tau_ref:g} s and would lose spikes"
        )


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
    for i in range(len(current)):
        above = current[i] - 1.0
        spikes[i] = 0.0
        if above > 0.0:
            spikes[i] = 1.0 / (constants[1] + constants[0] * math.log1p(1.0 / above))


class LIFRate(_Leaky):
    """The steady rate of LIF neurons, without spikes."""

    spiking = False
    initial_voltage = "0"

    step = staticmethod(lif_rate_step)


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
    recovery += (dt / constants.item(2)) * (constants.item(3) * spikes - recovery)


@kernel_of(adaptive_lif_step)
def _adaptive_lif_kernel(
    dt: float,
    current: FloatArray,
    spikes: FloatArray,
    voltage: FloatArray,
    refractory: FloatArray,
    recovery: FloatArray,
    constants: FloatArray,
) -> None:
    for i in range(len(current)):
        current[i] -= recovery[i]
    lif_step(dt, current, spikes, voltage, refractory, recovery, constants)
    share, raised = dt / constants[2], constants[3]
    for i in range(len(recovery)):
        recovery[i] += share * (raised * spikes[i] - recovery[i])


class AdaptiveLIF(LIF):
    """LIF of the current J - n, with tau_n n' = inc_n spikes - n (La Camera et al., 2004)."""

    tau_n: float = param(1.0, unit="s", above=0.0, doc="time constant of the adaptation")
    inc_n: float = param(0.01, at_least=0.0, doc="adaptation per spike")

    step = staticmethod(adaptive_lif_step)
