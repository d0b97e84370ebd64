"""Neuron models: how a current becomes spikes or a rate, step by step and in the steady state.

A model is a short class. ``step`` advances all neurons by one step, in place::

    step(dt, current, spikes, voltage, refractory, recovery, constants)

with arrays of one entry per neuron: the input ``current``, the ``spikes`` that it writes (1/dt for
each spike, or a rate in Hz), up to three numbers per neuron that it keeps, and ``constants``, its
parameters in the order in which they are declared. A last argument ``rng``, the block's generator,
is for models that draw: ``rng.random()`` and the other methods that both engines have. It is a
plain function without ``self``, so that it can be compiled. ``rates`` gives the steady rates, from
which decoders are solved; a model may leave it out. A graph names a model of one's own with its
file, ``neuron: {type: Mine, module: mine.py, ...}``.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from functools import lru_cache
from typing import ClassVar

import numpy as np

from blocks.core import FloatArray, Variant, param
from blocks.neural.emission import EMISSIONS

NeuronStep = Callable[..., None]
# Seconds before and while spikes are counted, and the currents of a table of simulated rates.
SETTLING, COUNTING, TABLE = 0.1, 1.0, 800
# Steps that treat each neuron alone: see `independent`.
INDEPENDENT: set[NeuronStep] = set()
STEP = ["dt", "current", "spikes", "voltage", "refractory", "recovery", "constants"]


def independent(step: NeuronStep) -> NeuronStep:
    """Declare that what a step does to a neuron does not depend on the others, nor their number."""
    INDEPENDENT.add(step)
    return step


@lru_cache(32)  # asked for with each model that is constructed, and slow
def _arguments(step: Callable[..., None]) -> list[str]:
    return list(inspect.signature(step).parameters)


class NeuronModel(Variant, root=True, registry="neurons"):
    """A neuron model; a subclass declares parameters, ``step`` and, if possible, ``rates``.

    spiking : whether ``spikes`` are spikes; their number per step is then limited by dt.
    """

    expected: ClassVar[str] = "a neuron model"
    spiking: ClassVar[bool] = True
    initial_voltage: ClassVar[str] = "uniform(0, 1)"
    initial_recovery: ClassVar[float] = 0.0
    step: ClassVar[NeuronStep]

    amplitude: float = param(1.0, above=0.0, doc="what spikes, or rates, are multiplied by")

    def wrong(self) -> list[tuple[str, str]]:
        """Why the class itself is no neuron model."""
        step, name = inspect.getattr_static(type(self), "step", None), type(self).__name__
        taken = _arguments(type(self).step) if step is not None else []
        if isinstance(step, staticmethod) and taken in (STEP, [*STEP, "rng"]):
            return []
        written = "has none" if step is None else f"has step({', '.join(taken)})"
        if step is not None and not isinstance(step, staticmethod):
            written += " that is no static method"
        return [
            (
                "",
                f"a neuron model has '@staticmethod def step({', '.join(STEP)})', "
                f"with a last 'rng' if it draws; {name} {written}",
            )
        ]

    @property
    def draws(self) -> bool:
        """Whether the step takes random numbers."""
        return len(_arguments(type(self).step)) > len(STEP)

    @property
    def emission(self) -> str:
        """How the step's rates become spikes (:mod:`blocks.neural.emission`); '' if they do not."""
        return ""

    @property
    def first_voltage(self) -> str | float:
        """The distribution of initial voltages, or the one number."""
        try:
            return float(self.initial_voltage)
        except ValueError:
            return self.initial_voltage

    def responses(self, current: FloatArray) -> FloatArray:
        """Steady rates times amplitude: what is decoded."""
        return self.amplitude * self.rates(current)

    def rates(self, current: FloatArray) -> FloatArray:
        """Steady firing rates in Hz at constant currents, of the same shape.

        A model without a formula is simulated once for many currents, and interpolated between.
        """
        # A simulation per call would take seconds: decoders ask for rates at thousands of currents.
        currents, rates = _table(self)
        return np.interp(current, currents, rates)

    def stacked(self, each: int) -> NeuronStep | None:
        """The step of any number of populations of ``each`` neurons as one, with the same bits;
        None if none is known.
        """
        step = type(self).step  # a subclass may have one of its own
        return step if step in INDEPENDENT else None

    @property
    def fastest(self) -> float:
        """The rate in Hz that is never reached."""
        return math.inf

    @property
    def slowest(self) -> float:
        """The rate in Hz at the intercept: a neuron's largest rate has to exceed it."""
        return 0.0

    def too_long(self, dt: float) -> str:
        """Why a step is too long for the model; '' if it is not."""
        return ""

    @property
    def constants(self) -> FloatArray:
        """The parameters as ``step`` takes them: the numbers that the class itself declares."""
        common = NeuronModel.declared
        return np.array(
            [
                float(self.__dict__[name])
                for name, declared in self.declared.items()
                if declared != common.get(name) and declared.kind != "str"
            ]
        )

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
        # Bisection, since rates from a table have flat pieces, where Newton's method would stop.
        low, high = np.full(rates.shape, -1.0), np.ones(rates.shape)
        for _ in range(60):
            short = self.rates(high) < rates if not above else self.rates(high) <= rates
            if not short.any():
                break
            high[short] *= 2.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            middle_rates = self.rates(middle)
            reached = middle_rates > rates if above else middle_rates >= rates
            low, high = np.where(reached, low, middle), np.where(reached, middle, high)
        return high

    def simulated_rates(self, current: FloatArray, dt: float = 0.001) -> FloatArray:
        """Spikes per second over 1 s, after 0.1 s to settle, of neurons at constant currents."""
        flat = np.ascontiguousarray(current, dtype=float).reshape(-1)
        voltage, refractory = np.zeros(flat.size), np.zeros(flat.size)
        if isinstance(self.first_voltage, float):
            voltage[:] = self.first_voltage
        recovery = np.full(flat.size, self.initial_recovery)
        spikes, total = np.zeros(flat.size), np.zeros(flat.size)
        constants, drawing = self.constants, (np.random.default_rng(0),) if self.draws else ()
        for k in range(round((SETTLING + COUNTING) / dt)):
            type(self).step(dt, flat, spikes, voltage, refractory, recovery, constants, *drawing)
            if k >= round(SETTLING / dt):
                total += spikes
        return np.asarray(total * dt / COUNTING).reshape(np.shape(current))


class RateModel(NeuronModel, abstract=True):
    """A model whose step gives rates: they are passed on, or ``spikes`` are made of them."""

    spiking = False
    initial_voltage = "0"

    spikes: str = param(
        "none", choices=("none", *EMISSIONS), doc="how spikes are made of the rates"
    )

    @property
    def emission(self) -> str:
        return "" if self.spikes == "none" else self.spikes

    @property
    def first_voltage(self) -> str | float:
        # Where in its interval each neuron is, so that they do not spike at once.
        return "uniform(0, 1)" if self.spikes == "regular" else super().first_voltage


@lru_cache(32)
def _table(model: NeuronModel) -> tuple[FloatArray, FloatArray]:
    """Currents, densest around zero, and a model's simulated rates there."""
    currents = np.sinh(np.linspace(-3.0, 8.0, TABLE))
    # Counts of spikes in 1 s go up and down by one: made monotonic, so that they can be inverted.
    return currents, np.maximum.accumulate(model.simulated_rates(currents))
