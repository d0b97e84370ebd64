"""Spikes that are made of rates, and noise: what an Ensemble does beside the step of its model.

Rates in Hz (n,) go in and become spikes of 1/dt each, in place. In a step with 2.3 spikes on
average, ``regular`` makes 2 or 3 so that none is lost, ``stochastic`` 3 in 30 % of all steps and
else 2, and ``poisson`` any number::

    emit("stochastic", 0.001, spikes, voltage, rng)
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import FloatArray

EMISSIONS = ("regular", "stochastic", "poisson")
# A Poisson number that is expected to be larger is drawn from the normal distribution beside it.
MANY_SPIKES = 500.0


def emit_regular(dt: float, spikes: FloatArray, voltage: FloatArray) -> None:
    """V grows by rate dt; each whole passed is a spike, and a negative one below 0."""
    for i in range(len(spikes)):
        grown = voltage[i] + dt * spikes[i]
        whole = np.floor(grown)
        voltage[i] = grown - whole
        spikes[i] = whole / dt


def emit_stochastic(dt: float, spikes: FloatArray, rng: np.random.Generator) -> None:
    """The wholes in rate dt, and one more with the probability of the rest."""
    for i in range(len(spikes)):
        expected = dt * spikes[i]
        whole = np.floor(expected)
        more = 1.0 if rng.random() < expected - whole else 0.0
        spikes[i] = (whole + more) / dt


def emit_poisson(dt: float, spikes: FloatArray, rng: np.random.Generator) -> None:
    """A Poisson number with the mean rate dt; where that is negative, of negative spikes."""
    for i in range(len(spikes)):
        expected = abs(dt * spikes[i])
        count = 0.0
        if expected > MANY_SPIKES:
            count = np.floor(expected + math.sqrt(expected) * rng.standard_normal() + 0.5)
        else:
            # Spikes are exponential intervals apart.
            left = expected - rng.standard_exponential()
            while left > 0.0:
                count += 1.0
                left -= rng.standard_exponential()
        spikes[i] = count / dt if spikes[i] > 0.0 else -count / dt
