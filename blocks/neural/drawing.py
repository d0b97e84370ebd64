"""What a population draws when a run begins: its tuning, and where its neurons are.

In: an Ensemble, its generator, its groups and their dimensions. Out: arrays by name::

    drawn(ensemble, rng, groups=1, d=2)["gain"]      # (n,); "encoders" are (n, d)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from blocks.core import FloatArray, ParameterError
from blocks.neural.distributions import Distribution


def drawn(block: Any, rng: np.random.Generator, groups: int, d: int) -> Mapping[str, FloatArray]:
    """Gains, biases, encoders and initial states, in one order: to fix one changes no other.

    Raises
    ------
    ParameterError : no neurons have these rates, intercepts or encoders; given numbers do not fit.
    """
    if block.direct:
        n = groups * d
        zeros = {name: np.zeros(n) for name in ("bias", "voltage", "refractory", "recovery")}
        encoders = np.tile(np.eye(d), (groups, 1))
        return {**zeros, "gain": np.full(n, block.radius), "encoders": encoders}
    n = block.neurons * groups
    problems: list[tuple[str, str]] = []

    def draw(name: str, distribution: Distribution, columns: int = 1) -> FloatArray:
        try:
            numbers = distribution.draw(rng, n, columns, dimensions=d)
        except ValueError as error:
            problems.append((name, str(error)))
            return np.full((n, columns), 0.5)
        return numbers

    rates = draw("max_rates", block.max_rates)[:, 0]
    intercepts = draw("intercepts", block.intercepts)[:, 0]
    encoders = draw("encoders", block.encoders, d)
    voltage = block.voltage_start or Distribution.read(block.neuron.first_voltage)
    recovery = block.recovery_start or Distribution.read(block.neuron.initial_recovery)
    # The voltages first: neurons whose other states begin at a number are then what they were.
    begin = {"voltage": voltage, "refractory": block.refractory_start, "recovery": recovery}
    states = {name: draw(name, each)[:, 0] for name, each in begin.items()}
    if states["refractory"].min() < 0.0:
        problems.append(("refractory", "expected times of 0 s or more"))
    lengths = np.linalg.norm(encoders, axis=1, keepdims=True)
    if not problems and not lengths.all():
        problems.append(("encoders", "an encoder of length 0 has no direction"))
    if block.normalize and lengths.all():
        encoders = encoders / lengths
    if block.gain is not None and block.bias is not None:
        gain, bias = draw("gain", block.gain)[:, 0], draw("bias", block.bias)[:, 0]
    elif not problems:
        problems += _impossible(block, rates, intercepts)
        if not problems:
            gain, bias = block.neuron.gain_and_bias(rates, intercepts)
    if problems:
        raise ParameterError(problems)
    return {**states, "gain": gain, "bias": bias, "encoders": encoders}


def _impossible(block: Any, rates: FloatArray, intercepts: FloatArray) -> list[tuple[str, str]]:
    problems = []
    slowest = block.neuron.slowest
    if rates.min() <= slowest:
        wanted = f"expected rates above {slowest:.6g} Hz"
        if slowest > 0.0:
            # Not refused, they would give gains of 0 or below: neurons that an input inhibits.
            wanted += f" and below {block.neuron.fastest:g} Hz, between which this neuron fires"
        problems.append(("max_rates", f"{wanted}, got {rates.min():.6g}"))
    elif rates.max() >= block.neuron.fastest:
        message = f"this neuron fires at less than {block.neuron.fastest:g} Hz"
        problems.append(("max_rates", f"{message}, got {rates.max():.6g}; lower the rates"))
    if intercepts.max() >= 1.0:
        message = f"expected intercepts below 1, got {intercepts.max():.6g}"
        problems.append(("intercepts", f"{message}: such a neuron is never driven"))
    return problems
