"""Figures of a linear system: poles, step responses and Bode plots.

In: A, B, C, D with labels. Out: one figure of four axes. For x' = -x + u, y = x: a pole at -1, a
step response 1 - exp(-t), a gain of -3 dB and a phase of -45 degrees at 1 rad/s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from blocks.core import FloatArray
from runtime.document import SECOND
from runtime.plots.style import STYLE, WIDTH, headline, line_style

MAX_LINES = 12
POINTS = 400
ROUNDING = 1e-12  # a gain below is that of a signal without effect


def draw_linear(
    matrices: Sequence[FloatArray],
    inputs: Sequence[str],
    outputs: Sequence[str],
    title: str,
    time_unit: str = SECOND,
) -> Figure:
    """Poles, step responses, and gain and phase over frequency, of a linear system.

    Parameters
    ----------
    matrices : A, B, C, D. inputs, outputs : labels, of columns of B and rows of C.
    time_unit : what times of the graph are in.

    Every pair of an input and an output is a line, up to twelve of them.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 0.8 * WIDTH), layout="constrained")
        _draw(figure, matrices, inputs, outputs, time_unit)
        headline(figure, title)
    return figure


def _draw(
    figure: Figure,
    matrices: Sequence[FloatArray],
    inputs: Sequence[str],
    outputs: Sequence[str],
    unit: str,
) -> None:
    from scipy import signal

    a, b, c, d = matrices
    axes: Any = figure.subplots(2, 2)
    (plane, step), (gain, phase) = axes
    poles: Any = np.linalg.eigvals(a)
    _poles(plane, poles, unit)
    t = np.linspace(0.0, _duration(poles), POINTS)
    frequencies = _frequencies(poles)
    pairs = [(j, i) for j in range(len(inputs)) for i in range(len(outputs))]
    for k, (j, i) in enumerate(pairs[:MAX_LINES]):
        system = signal.StateSpace(a, b[:, [j]], c[[i]], d[[i]][:, [j]])
        response = _response(a, b[:, j], c[i], d[i, j], frequencies)
        # log10 of rounding errors would be a curve at -300 dB that sets the scale for all others.
        response[np.abs(response) < ROUNDING] = np.nan
        none = "" if np.isfinite(response).any() else " (no effect)"
        how = {"label": f"{inputs[j]} to {outputs[i]}{none}", **line_style(k)}
        step.plot(t, signal.step(system, T=t)[1], **how)
        gain.semilogx(frequencies, 20.0 * np.log10(np.abs(response)), **how)
        phase.semilogx(frequencies, np.degrees(np.unwrap(np.angle(response))), **how)
    step.set(title="Step response", xlabel=f"time [{unit}]", ylabel="output per unit of input")
    gain.set(title="Gain", xlabel=f"frequency [rad/{unit}]", ylabel="gain [dB]")
    phase.set(title="Phase", xlabel=f"frequency [rad/{unit}]", ylabel="phase [deg]")
    if len(pairs) > 1:
        figure.legend(*step.get_legend_handles_labels(), loc="outside lower center", ncols=2)


def _poles(plane: Any, poles: Any, unit: str) -> None:
    plane.axvline(0.0, color="0.6", linewidth=0.8)
    plane.plot(poles.real, poles.imag, "x", markersize=6)
    plane.set(title="Poles", xlabel=f"real part [1/{unit}]", ylabel=f"imaginary part [rad/{unit}]")


def _response(
    a: FloatArray, b: FloatArray, c: FloatArray, d: float, frequencies: FloatArray
) -> npt.NDArray[np.complex128]:
    """c (jw - A)^-1 b + d at each frequency (rad/s)."""
    # Solved for all frequencies at once; an inverse would lose digits where the matrix is nearly
    # singular, as near an undamped pole.
    resolvent = 1j * frequencies[:, None, None] * np.eye(len(a)) - a
    states = np.linalg.solve(resolvent, np.broadcast_to(b[:, None], (len(frequencies), len(a), 1)))
    response: npt.NDArray[np.complex128] = states[..., 0] @ c + d
    return response


def _duration(poles: Any) -> float:
    """The time (s) in which a step response shows the slowest pole."""
    # An undamped pole has no decay: it is shown for some of its periods. Integrators (poles at 0)
    # have no time scale.
    slowest = min((abs(p.real) or abs(p) / 20.0 for p in poles if abs(p) > 1e-9), default=1.0)
    return float(min(7.0 / slowest, 1e6))


def _frequencies(poles: Any) -> FloatArray:
    """Frequencies (rad/s) from a hundredth of the slowest pole to a hundred times the fastest."""
    sizes = [abs(p) for p in poles if abs(p) > 1e-9] or [1.0]
    return np.logspace(np.log10(min(sizes)) - 2.0, np.log10(max(sizes)) + 2.0, POINTS)
