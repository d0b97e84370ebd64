"""Leaky integrate-and-fire neurons in closed form: what they are made of, and their steady rate."""

from __future__ import annotations

import numpy as np

from blocks.core import FloatArray, portable


def gain_and_bias(
    max_rates: FloatArray, intercepts: FloatArray, tau_rc: float, tau_ref: float
) -> tuple[FloatArray, FloatArray]:
    """Gain and bias of LIF neurons that start to fire at ``intercepts`` and reach ``max_rates``.

    z = 1 / (1 - exp((tau_ref - 1/rate) / tau_rc)); gain = (1 - z) / (intercept - 1);
    bias = 1 - gain * intercept. Rates in Hz, times in seconds.
    """
    z = 1.0 / (1.0 - portable.exp((tau_ref - 1.0 / max_rates) / tau_rc))
    gain = (1.0 - z) / (intercepts - 1.0)
    return gain, 1.0 - gain * intercepts


def lif_rate(current: FloatArray, tau_rc: float, tau_ref: float) -> FloatArray:
    """Steady firing rate (Hz) of a LIF neuron: 1 / (tau_ref + tau_rc log1p(1 / (J - 1)))."""
    above = np.maximum(current - 1.0, 1e-300)
    return np.where(current > 1.0, 1.0 / (tau_ref + tau_rc * portable.log1p(1.0 / above)), 0.0)


def mean_squared_rate(
    max_rates: FloatArray, intercepts: FloatArray, tau_rc: float, tau_ref: float, nodes: int = 100
) -> float:
    """Mean squared firing rate (Hz^2), at input 0, of a large population of LIF neurons.

    Their maximum rates and intercepts are uniform over the two ranges. The midpoint rule, with
    ``nodes`` squared neurons.
    """
    middles = (np.arange(nodes) + 0.5) / nodes
    rates, starts = (low + (high - low) * middles for low, high in (max_rates, intercepts))
    _, bias = gain_and_bias(rates[:, None], starts[None, :], tau_rc, tau_ref)
    return float(np.mean(lif_rate(bias, tau_rc, tau_ref) ** 2))
