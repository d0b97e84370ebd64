"""Figures of linear systems: responses, margins, Nyquist plots and root loci.

In: A, B, C, D with labels, in continuous time or sampled. Out: one figure. For x' = -x + u, y = x:
a pole at -1, a step response 1 - exp(-t), -3 dB and -45 degrees at 1 rad/s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from blocks.core import FloatArray, FrequencyResponse, delay_chains, eigenvalues, refined
from runtime.document import SECOND
from runtime.plots.log_axes import label_log
from runtime.plots.looks import LOOKS, fit, headline, styled
from runtime.plots.style import COLOURS, GREY, WIDTH, line_style

Title = tuple[str, str]  # the graph, and what is shown of it

Complex = npt.NDArray[np.complex128]
MAX_LINES = 12
POINTS = 400
ROUNDING = 1e-12  # a gain below is that of a signal without effect
GROWTH = 30.0  # of an unstable mode, after which its step response shows nothing else


@dataclass(frozen=True)
class LinearSystem:
    """What a figure shows: A, B, C, D with labels of columns of B and rows of C.

    period : that of a sampled system; 0 in continuous time. unit : what times are in.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray
    inputs: Sequence[str]
    outputs: Sequence[str]
    period: float = 0.0
    unit: str = SECOND

    @property
    def rates(self) -> Complex:
        """The poles as s; those of a sampled system that die in one period are left out."""
        poles = eigenvalues(self.a)
        if not self.period:
            return poles
        return np.asarray(np.log(poles[np.abs(poles) > 1e-6]) / self.period)

    @property
    def frequencies(self) -> FloatArray:
        """From a hundredth of the slowest pole to a hundred times the fastest, in rad per time."""
        sizes = _scales(self.rates) or [1.0]
        low, high = min(sizes) / 100.0, 100.0 * max(sizes)
        if self.period:
            high = math.pi / self.period
            low = min(low, high / 1000.0)
        delays = delay_chains(self.a, self.b.sum(axis=1)) if self.period else ()
        w = np.logspace(np.log10(low), np.log10(high), POINTS)
        return refined(w, self.period * len(delays))

    def response(self, j: int, i: int, frequencies: FloatArray) -> Complex:
        """c (pI - A)^-1 b + d at p = jw, or at e^(jw period), of an input j and an output i."""
        b, c, d = self.b[:, j], self.c[i], float(self.d[i, j])
        return FrequencyResponse(self.a, b, c, d, self.period)(frequencies)

    def step(self, j: int, i: int) -> tuple[FloatArray, FloatArray]:
        """Times and the response to a step of 1."""
        from scipy import signal

        b, c, d = self.b[:, [j]], self.c[[i]], self.d[[i]][:, [j]]
        end = step_end(self.rates)
        if not self.period:
            t = np.linspace(0.0, end, POINTS)
            return t, signal.step(signal.StateSpace(self.a, b, c, d), T=t)[1]
        count = min(max(10, math.ceil(end / self.period)), 20_000)
        t, (y,) = signal.dstep((self.a, b, c, d, self.period), n=count)
        return t, y[:, 0]


def draw_linear(system: LinearSystem, title: Title, look: str = "screen") -> Figure:
    """Poles, step responses, and gain and phase over frequency, of a linear system.

    Every pair of an input and an output is a line, up to twelve of them.
    """
    with styled(look):
        figure = Figure(figsize=(WIDTH, 0.8 * WIDTH), layout="constrained")
        axes: Any = figure.subplots(2, 2)
        (plane, step), (gain, phase) = axes
        _poles(plane, system)
        frequencies = system.frequencies
        pairs = [(j, i) for j in range(len(system.inputs)) for i in range(len(system.outputs))]
        for k, (j, i) in enumerate(pairs[:MAX_LINES]):
            response = system.response(j, i, frequencies)
            # log10 of rounding errors would be a curve at -300 dB that sets the scale for all.
            response[np.abs(response) < ROUNDING] = np.nan
            none = "" if np.isfinite(response).any() else " (no effect)"
            how = {"label": f"{system.inputs[j]} to {system.outputs[i]}{none}", **line_style(k)}
            _bode(gain, phase, frequencies, response, how)
            t, y = system.step(j, i)
            if system.period:
                how["drawstyle"] = "steps-post"
            step.plot(t, y, **how)
        step.set(
            title="Step response", xlabel=f"time [{system.unit}]", ylabel="output per unit of input"
        )
        _name_bode(gain, phase, system)
        if len(pairs) > 1:
            figure.legend(*step.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        headline(figure, *title, look)
        fit(figure, LOOKS[look])
    return figure


def draw_margins(
    system: LinearSystem, crossings: Sequence[tuple[float, str]], title: Title, look: str = "screen"
) -> Figure:
    """Gain and phase of a loop transfer function, with its margins.

    crossings : frequencies with what is marked there.
    """
    with styled(look):
        figure = Figure(figsize=(WIDTH, 0.75 * WIDTH), layout="constrained")
        gain, phase = figure.subplots(2, 1, sharex=True)
        frequencies = system.frequencies
        response = system.response(0, 0, frequencies)
        phases = _bode(gain, phase, frequencies, response, line_style(0))
        gain.axhline(0.0, color=GREY, linewidth=0.8)
        spread = np.geomspace(frequencies[0], frequencies[-1], POINTS)
        middle = np.median(np.interp(spread, frequencies, phases))
        turn = 360.0 * np.round((middle + 180.0) / 360.0) - 180.0
        phase.axhline(turn, color=GREY, linewidth=0.8)
        for k, (at, text) in enumerate(crossings):
            value = system.response(0, 0, np.array([at]))[0]
            here = np.interp(np.log(at), np.log(frequencies), phases)
            colour = COLOURS[1 + k % (len(COLOURS) - 1)]
            for axes, y, level in (
                (gain, 20.0 * np.log10(abs(value)), 0.0),
                (phase, here, 360.0 * np.round((here + 180.0) / 360.0) - 180.0),
            ):
                axes.axvline(at, color=colour, linewidth=0.6, linestyle=":")
                axes.plot([at, at], [level, y], color=colour, linewidth=1.8, solid_capstyle="butt")
            gain.plot([], [], color=colour, label=text)
        _name_bode(gain, phase, system)
        if crossings:
            gain.legend(loc="best")
        headline(figure, *title, look)
        fit(figure, LOOKS[look])
    return figure


def draw_nyquist(system: LinearSystem, title: Title, look: str = "screen") -> Figure:
    """The loop transfer function in the complex plane, and the sensitivity over frequency."""
    with styled(look):
        figure = Figure(figsize=(WIDTH, 0.55 * WIDTH), layout="constrained")
        plane, sensitivity = figure.subplots(1, 2)
        frequencies = system.frequencies
        response = system.response(0, 0, frequencies)
        plane.add_patch(
            matplotlib.patches.Circle((0.0, 0.0), 1.0, fill=False, color=GREY, linewidth=0.6)
        )
        for values, how in ((response, "-"), (response.conj(), "--")):
            plane.plot(values.real, values.imag, how, color=COLOURS[0])
        for k in _arrows(response):
            ahead, here = response[k + 1], response[k]
            plane.annotate(
                "",
                xy=(ahead.real, ahead.imag),
                xytext=(here.real, here.imag),
                arrowprops={"arrowstyle": "->", "color": COLOURS[0]},
            )
        plane.plot([-1.0], [0.0], "+", color=COLOURS[1], markersize=9, markeredgewidth=1.6)
        # What is far from -1, as near an integrator's pole, says nothing about stability.
        near = response[np.abs(response) < 4.0]
        reach = max(2.0, 1.1 * float(np.abs(near).max(initial=0.0)))
        plane.set(
            title="Nyquist plot",
            xlabel="real part",
            ylabel="imaginary part",
            xlim=(-reach, reach),
            ylim=(-reach, reach),
            aspect="equal",
        )
        for k, (values, name) in enumerate(
            ((1.0 / (1.0 + response), "S = 1 / (1 + L)"), (response / (1.0 + response), "T = L S"))
        ):
            sensitivity.semilogx(
                frequencies, 20.0 * np.log10(np.abs(values)), label=name, **line_style(k)
            )
        sensitivity.axhline(0.0, color=GREY, linewidth=0.8)
        sensitivity.set(
            title="Sensitivity", xlabel=f"frequency [rad/{system.unit}]", ylabel="gain [dB]"
        )
        sensitivity.legend(loc="lower center")
        headline(figure, *title, look)
        fit(figure, LOOKS[look])
    return figure


def draw_locus(
    values: FloatArray,
    poles: Sequence[Complex],
    name: str,
    period: float,
    unit: str,
    title: Title,
    look: str = "screen",
) -> Figure:
    """Poles while a parameter changes: one point for each pole and value."""
    with styled(look):
        figure = Figure(figsize=(0.8 * WIDTH, 0.65 * WIDTH), layout="constrained")
        plane = figure.subplots()
        _stability(plane, period)
        every = np.concatenate([np.full(len(p), v) for v, p in zip(values, poles, strict=True)])
        points = np.concatenate([*poles])
        is_log = bool(values.min() > 0.0 and values.max() / values.min() >= 20.0)
        norm: Any = matplotlib.colors.LogNorm() if is_log else None
        shown = plane.scatter(
            points.real, points.imag, c=every, s=9.0, cmap="viridis", norm=norm, zorder=3
        )
        for p, mark in ((poles[0], "x"), (poles[-1], "s")):
            plane.plot(
                p.real,
                p.imag,
                mark,
                color="black",
                markersize=6,
                fillstyle="none",
                linestyle="none",
                zorder=4,
                label=f"{name} = {values[0 if mark == 'x' else -1]:.4g}",
            )
        _name_plane(plane, period, unit, "Poles")
        plane.legend(loc="best")
        figure.colorbar(shown, ax=plane, label=name)
        headline(figure, *title, look)
        fit(figure, LOOKS[look])
    return figure


def _scales(rates: Complex) -> list[float]:
    """The sizes of poles; one that is 0 but for rounding is an integrator's."""
    sizes = np.abs(rates)
    least = 1e-6 * float(sizes.max(initial=0.0))
    return [float(each) for each in sizes if each > max(least, 1e-9)]


def step_end(rates: Complex) -> float:
    """The time up to which a step response says something, of poles s."""
    # An undamped pole has no decay: it is shown for some of its periods. Integrators (poles at 0)
    # have no time scale. A mode that grows soon hides all others.
    least = 1e-9 * max(_scales(rates), default=0.0)
    sizes = [abs(p.real) if abs(p.real) > least else abs(p) / 20.0 for p in rates]
    slowest = min((each for each in sizes if each > 1e3 * least), default=1.0)
    end = float(min(7.0 / slowest, 1e6))
    growth = max((p.real for p in rates), default=0.0)
    return min(end, math.log(GROWTH) / growth) if growth > 1e-6 else end


def _bode(
    gain: Any, phase: Any, frequencies: FloatArray, response: Complex, how: dict[str, Any]
) -> FloatArray:
    """Draw gain and phase; returns the phase in degrees."""
    phases = np.degrees(np.unwrap(np.angle(response)))
    gain.semilogx(frequencies, 20.0 * np.log10(np.abs(response)), **how)
    phase.semilogx(frequencies, phases, **how)
    label_log(gain.xaxis, phase.xaxis)
    return np.asarray(phases)


def _name_bode(gain: Any, phase: Any, system: LinearSystem) -> None:
    frequency = f"frequency [rad/{system.unit}]"
    gain.set(title="Gain", xlabel=frequency, ylabel="gain [dB]")
    phase.set(title="Phase", xlabel=frequency, ylabel="phase [deg]")


def _arrows(response: Complex) -> list[int]:
    """Where the direction of a curve is shown: once where it is near -1."""
    near = np.flatnonzero(np.abs(response[:-1] + 1.0) < 2.0)
    return [int(near[len(near) // 2])] if len(near) else []


def _poles(plane: Any, system: LinearSystem) -> None:
    poles = eigenvalues(system.a)
    _stability(plane, system.period)
    plane.plot(poles.real, poles.imag, "x", markersize=6)
    _name_plane(plane, system.period, system.unit, "Poles")


def _stability(plane: Any, period: float) -> None:
    """The boundary of stability: the imaginary axis, or the unit circle."""
    if period:
        circle = matplotlib.patches.Circle((0.0, 0.0), 1.0, fill=False, color=GREY, linewidth=0.8)
        plane.add_patch(circle)
        plane.set_aspect("equal", adjustable="datalim")
    else:
        plane.axvline(0.0, color=GREY, linewidth=0.8)


def _name_plane(plane: Any, period: float, unit: str, title: str) -> None:
    if period:
        plane.set(title=f"{title}, z", xlabel="real part", ylabel="imaginary part")
    else:
        plane.set(
            title=title, xlabel=f"real part [1/{unit}]", ylabel=f"imaginary part [rad/{unit}]"
        )
