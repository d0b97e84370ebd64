"""Stability margins of a loop transfer function, and numbers of a step response.

In: a :class:`Linearization` with one input and one output. Out: numbers by python-control (extra
``control``). Of L = 1 / (s (s + 1)): no gain margin, a phase margin of 51.8 degrees at 0.786 rad/s.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np

from runtime.errors import UsageError
from runtime.runs.linearization import Linearization, control


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
    MissingExtraError : python-control is not installed.
    """
    _single(loop, "margins")
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        numbers = control().stability_margins(loop.to_control())
    gain, phase, modulus, gain_at, phase_at, modulus_at = (
        math.nan if each is None else float(each) for each in numbers
    )
    delay = math.radians(phase % 360.0) / phase_at if math.isfinite(phase_at) else math.inf
    closed = loop.a - np.outer(loop.b[:, 0], loop.c[0]) / (1.0 + loop.d[0, 0])
    poles = np.linalg.eigvals(closed)
    inside = np.abs(poles) < 1.0 if loop.period else poles.real < 0.0
    return Margins(gain, gain_at, phase, phase_at, delay, modulus, modulus_at, bool(inside.all()))


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
