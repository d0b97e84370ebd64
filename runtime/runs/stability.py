"""Stability margins of a loop transfer function, and numbers of a step response.

In: a :class:`Linearization` with one input and one output. Out: numbers; those of a step response
by python-control's ``step_info`` (extra ``control``). Of L = 1 / (s (s + 1)): no gain margin, a
phase margin of 51.8 degrees at 0.786 rad/s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from blocks.core import FloatArray, FrequencyResponse, eigenvalues, refined
from runtime.errors import UsageError
from runtime.runs.linearization import Linearization, control, is_inside

POINTS = 20_000
NONE = (math.inf, math.nan)


@dataclass(frozen=True)
class Margins:
    """By how much a loop may differ before it is unstable; infinite where nothing limits it.

    gain : the factor. phase : degrees. delay : the time. modulus : the distance of L from -1, the
    inverse of the largest sensitivity. Each ``at`` is the frequency (rad per time), NaN for none.
    """

    gain: float
    gain_at: float
    phase: float
    phase_at: float
    delay: float
    modulus: float
    modulus_at: float
    is_stable: bool

    @property
    def sensitivity(self) -> float:
        """The largest gain of S = 1 / (1 + L)."""
        return 1.0 / self.modulus if self.modulus else math.inf


def margins(loop: Linearization) -> Margins:
    """The margins of a loop transfer function L, of 1 + L = 0.

    Raises
    ------
    UsageError : it has not one input and one output.
    """
    _single(loop, "margins")
    b, c, d = loop.b[:, 0], loop.c[0], float(loop.d[0, 0])
    response = FrequencyResponse(loop.a, b, c, d, loop.period)
    w = _frequencies(loop, response.delay)
    values = response(w)

    def at(each: float) -> complex:
        return complex(response(np.array([each]))[0])

    real = _roots(lambda x: at(x).imag, w, values.imag)
    gains = [(-1.0 / at(x).real, x) for x in real if at(x).real < 0.0]
    if loop.period and values[-1].real < 0.0:
        gains.append((-1.0 / values[-1].real, w[-1]))  # L is real at half the sampling rate
    if _is_finite_at_rest(loop) and at(0.0).real < 0.0:
        gains.append((-1.0 / at(0.0).real, 0.0))  # as below a gain that holds an unstable plant
    turns = [
        ((np.degrees(np.angle(at(x))) + 360.0) % 360.0 - 180.0, x)
        for x in _roots(lambda x: abs(at(x)) - 1.0, w, np.abs(values) - 1.0)
    ]
    gain, gain_at = min(gains, key=lambda each: abs(math.log(each[0])), default=NONE)
    phase, phase_at = min(turns, key=lambda each: abs(each[0]), default=NONE)
    delay = min((math.radians(p % 360.0) / x for p, x in turns), default=math.inf)
    nearest = int(np.argmin(np.abs(1.0 + values)))
    modulus = float(np.abs(1.0 + values[nearest]))
    closed = loop.a - np.outer(loop.b[:, 0], loop.c[0]) / (1.0 + loop.d[0, 0])
    is_stable = is_inside(eigenvalues(closed), bool(loop.period))
    delay, modulus_at = float(delay), float(w[nearest])
    return Margins(
        gain=float(gain),
        gain_at=float(gain_at),
        phase=float(phase),
        phase_at=float(phase_at),
        delay=delay,
        modulus=modulus,
        modulus_at=modulus_at,
        is_stable=is_stable,
    )


def _frequencies(loop: Linearization, delay: float) -> FloatArray:
    """Frequencies (rad per time) far beyond those of all poles, densely, of a delay's turns too.

    python-control's own search solves for roots of polynomials in z, which are lost in rounding if
    the sampling is fast: poles are then near 1, and those of integrators no longer at 1.
    """
    sizes = np.abs(loop.equivalent[np.isfinite(loop.equivalent)])
    sizes = sizes[sizes > 1e-6 * sizes.max(initial=0.0)]
    low, high = sizes.min(initial=1.0) / 1e3, 1e4 * sizes.max(initial=1.0)
    high = math.pi / loop.period if loop.period else high
    return refined(np.geomspace(low, high, POINTS), delay)


def _is_finite_at_rest(loop: Linearization) -> bool:
    """Whether L has no pole at frequency 0; a sampled integrator's may be off by rounding."""
    sizes = np.abs(loop.equivalent[np.isfinite(loop.equivalent)])
    return bool((sizes > 1e-6 * sizes.max(initial=0.0)).all())


def _roots(function: Callable[[float], float], w: FloatArray, values: FloatArray) -> list[float]:
    """Where a function of frequency changes its sign."""
    from scipy.optimize import brentq

    changes = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0)
    return [float(brentq(function, w[i], w[i + 1], rtol=1e-13)) for i in changes]


def step_info(system: Linearization) -> dict[str, float]:
    """Rise time, settling time, overshoot and more of the response to a step of 1.

    Raises
    ------
    UsageError : it has not one input and one output, or is unstable.
    MissingExtraError : python-control is not installed.
    """
    _single(system, "the numbers of a step response")
    if not system.is_stable:
        raise UsageError("the system is not stable, so its step response has no final value")
    found = control().step_info(system.to_control())
    return {key: float(value) for key, value in found.items()}


def _single(system: Linearization, what: str) -> None:
    if len(system.inputs) != 1 or len(system.outputs) != 1:
        raise UsageError(
            f"{what}: expected one input and one output, got {len(system.inputs)} and "
            f"{len(system.outputs)}; name a component, as in plant.pose.x"
        )
