"""Figures of a linear system: poles, step responses and Bode plots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from blocks.core import FloatArray

MAX_LINES = 12
POINTS = 400


def draw_linear(
    matrices: Sequence[FloatArray], inputs: Sequence[str], outputs: Sequence[str], title: str
) -> Figure:
    """Poles, step responses, and gain and phase over frequency, of a linear system.

    Parameters
    ----------
    matrices : A, B, C, D. inputs, outputs : labels, of columns of B and rows of C.

    Every pair of an input and an output is a line, up to twelve of them.
    """
    from scipy import signal

    a, b, c, d = matrices
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    axes: Any = figure.subplots(2, 2)
    (plane, step), (gain, phase) = axes
    poles: Any = np.linalg.eigvals(a)
    _poles(plane, poles)
    t = np.linspace(0.0, _duration(poles), POINTS)
    frequencies = _frequencies(poles)
    pairs = [(j, i) for j in range(len(inputs)) for i in range(len(outputs))]
    for j, i in pairs[:MAX_LINES]:
        system = signal.StateSpace(a, b[:, [j]], c[[i]], d[[i]][:, [j]])
        label = f"{inputs[j]} to {outputs[i]}"
        step.plot(t, signal.step(system, T=t)[1], label=label)
        response = signal.freqresp(system, frequencies)[1]
        with np.errstate(divide="ignore"):
            gain.semilogx(frequencies, 20.0 * np.log10(np.abs(response)), label=label)
        phase.semilogx(frequencies, np.degrees(np.unwrap(np.angle(response))), label=label)
    step.set(title="step response", xlabel="time, s", ylabel="output per unit of input")
    gain.set(title="gain", xlabel="frequency, rad/s", ylabel="gain, dB")
    phase.set(title="phase", xlabel="frequency, rad/s", ylabel="phase, deg")
    if len(pairs) > 1:
        step.legend(fontsize="small")
    for each in axes.flat:
        each.grid(visible=True, alpha=0.3)
    figure.suptitle(title)
    return figure


def _poles(plane: Any, poles: Any) -> None:
    plane.axvline(0.0, color="0.6", linewidth=0.8)
    plane.plot(poles.real, poles.imag, "x", markersize=8)
    plane.set(title="poles", xlabel="real part, 1/s", ylabel="imaginary part, rad/s")


def _duration(poles: Any) -> float:
    """The time (s) in which a step response shows the slowest pole."""
    slowest = min((abs(p.real) or abs(p) / 20.0 for p in poles if abs(p) > 1e-9), default=1.0)
    return float(min(7.0 / slowest, 1e6))


def _frequencies(poles: Any) -> FloatArray:
    """Frequencies (rad/s) from a hundredth of the slowest pole to a hundred times the fastest."""
    sizes = [abs(p) for p in poles if abs(p) > 1e-9] or [1.0]
    return np.logspace(np.log10(min(sizes)) - 2.0, np.log10(max(sizes)) + 2.0, POINTS)
