"""Synapses: linear filters, discretised exactly for inputs that hold between steps.

    x_k+1 = A x_k + B u_k,    y_k+1 = the last component of x_k+1

so that the output of tick k + 1 contains the spikes of step k, as in Nengo. Written as a number of
seconds (a lowpass), ``alpha(0.1)``, ``triangle(0.02)``, ``{type: linear, num: [5], den: [1, 5]}``
or ``none``; a block holds the state (order, k) and calls::

    value = passed(state.filtered, a, b, decoded)      # in output
    remember(state.filtered, a, b, decoded, value)     # in update
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from blocks.core import (
    FloatArray,
    SettingError,
    Variant,
    misspelt,
    param,
    product,
    show,
)
from blocks.core.portable import SELDOM, flush, share_of


class Filtering:
    """Filters row after row in place: ``filtering(rows)``.

    ``memory`` is the filter's state (order, width), and ``taken`` the number of rows so far.
    """

    def __init__(self, a: FloatArray, b: FloatArray, width: int) -> None:
        self.a, self.b = a, b
        self.memory = np.zeros((len(b), width))
        self.taken = 0  # not of a tick's number: a filter of recorded rows has none

    def __call__(self, rows: FloatArray) -> None:
        for row in rows:
            output = passed(self.memory, self.a, self.b, row)
            remember(self.memory, self.a, self.b, row, output)
            row[:] = output
            if self.taken % SELDOM == 0:
                flush(self.memory)
            self.taken += 1


class Synapse(Variant, root=True):
    """A filter: a number (the time constant of a lowpass), ``alpha(0.1)``, ``none``, ..."""

    expected: ClassVar[str] = "a synapse: a time constant in s, none, or one of"
    order: ClassVar[int] = 1

    def order_at(self, dt: float) -> int:
        """The number of rows of its state for a step of dt."""
        return self.order

    @classmethod
    def read(cls, written: Any) -> Any:
        if written is None:
            written = "none"
        if isinstance(written, (int, float)) and not isinstance(written, bool):
            if written == 0:
                raise SettingError([("", "expected a time constant above 0 s, got 0; write none")])
            return LowpassSynapse(tau=written)
        if isinstance(written, str) and written.endswith(")"):
            name, _, inside = written[:-1].partition("(")
            kind = cls.members.get(name.strip())
            numbers = [_number(part) for part in inside.split(",")]
            if kind is None or None in numbers or len(numbers) > len(kind.declared):
                forms = ", ".join(_form(member) for member in cls.members.values())
                text = f"expected a time constant in s, or {forms}, got {show(written)}"
                known = cls.members if kind is None else ()
                raise SettingError([("", misspelt("unknown-type", text, name, known))])
            return kind(**dict(zip(kind.declared, numbers, strict=False)))
        return super().read(written)

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        # One with arrays is written as a mapping only.
        named = [member for member in cls.members.values() if not _has_arrays(member)]
        return {_form(member): member.summary() for member in named}

    def written(self) -> Any:
        values = [self.__dict__[name] for name in self.declared]
        if isinstance(self, LowpassSynapse):
            return self.tau
        if any(isinstance(v, np.ndarray) for v in values):
            return super().written()
        return f"{self.label}({', '.join(map(repr, values))})" if values else self.label

    def matrices(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """A (m, m) and B (m,) for a step of dt."""
        raise NotImplementedError

    def filtering(self, dt: float, width: int) -> Filtering:
        """A function that filters row after row (n, width) in place, from zero on."""
        return Filtering(*self.matrices(dt), width)


class LowpassSynapse(Synapse, label="lowpass"):
    """1 / (tau s + 1)."""

    tau: float = param(unit="s", above=0.0, doc="time constant")

    def matrices(self, dt: float) -> tuple[FloatArray, FloatArray]:
        share = share_of(self.tau, dt)
        return np.array([[1.0 - share]]), np.array([share])


class NoSynapse(Synapse, label="none"):
    """What arrives is passed on."""

    order = 0

    def matrices(self, dt: float) -> tuple[FloatArray, FloatArray]:
        return np.zeros((0, 0)), np.zeros(0)


class _TwoPoles(Synapse, abstract=True):
    order = 2

    def continuous(self) -> tuple[float, float]:
        """a1 and a0 of 1 / (s^2 / a0 + a1 / a0 s + 1), all divided by the leading coefficient."""
        raise NotImplementedError

    def matrices(self, dt: float) -> tuple[FloatArray, FloatArray]:
        a1, a0 = self.continuous()
        system = np.array([[-a1, -a0, a0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) * dt
        # The exponential of [[A, B], [0, 0]] dt holds both matrices of the discrete system (Van
        # Loan, 1978), without the inverse of A that the integral for B would take.
        stepped = _exponential(system)
        return stepped[:2, :2].copy(), stepped[:2, 2].copy()


class AlphaSynapse(_TwoPoles, label="alpha"):
    """1 / (tau s + 1)^2."""

    tau: float = param(unit="s", above=0.0, doc="time constant of both poles")

    def continuous(self) -> tuple[float, float]:
        return 2.0 / self.tau, 1.0 / self.tau**2


class SecondOrderSynapse(_TwoPoles, label="second_order"):
    """omega^2 / (s^2 + 2 damping omega s + omega^2)."""

    omega: float = param(unit="rad/s", above=0.0, doc="natural frequency")
    damping: float = param(1.0, above=0.0, doc="damping ratio")

    def continuous(self) -> tuple[float, float]:
        return 2.0 * self.damping * self.omega, self.omega**2


class LinearSynapse(Synapse, label="linear"):
    """num(s) / den(s), polynomials with the highest power first; of z for ``discrete``."""

    num: FloatArray = param(shape=(None,), doc="coefficients of the numerator")
    den: FloatArray = param(shape=(None,), doc="coefficients of the denominator")
    discrete: bool = param(False, doc="the polynomials are of z, for the step of the block")
    order = -1  # of its parameters

    def wrong(self) -> list[tuple[str, str]]:
        if len(self.den) < 2 or self.den[0] == 0.0:
            return [("den", "expected two coefficients or more, the first of them not 0")]
        if not 0 < len(self.num) <= len(self.den):
            message = f"expected up to {len(self.den)} coefficients, as many as the denominator has"
            return [("num", message)]
        return []

    def order_at(self, dt: float) -> int:
        return len(self.den)

    def matrices(self, dt: float) -> tuple[FloatArray, FloatArray]:
        n = len(self.den) - 1
        den = self.den[1:] / self.den[0]
        num = np.concatenate([np.zeros(n + 1 - len(self.num)), self.num]) / self.den[0]
        # The controllable canonical form; what the numerator has beyond D den(s) is C.
        system = np.zeros((n + 1, n + 1))
        system[0, :n], system[0, n] = -den, 1.0
        system[range(1, n), range(n - 1)] = 1.0
        c, d = num[1:] - num[0] * den, num[0]
        stepped = system if self.discrete else _exponential(system * dt)
        a, b = stepped[:n, :n], stepped[:n, n]
        # A last row for the output: with a direct term as it is, and else of the step that ends
        # now, as for the other synapses.
        rows, ends = np.zeros((n + 1, n + 1)), np.zeros(n + 1)
        rows[:n, :n], ends[:n] = a, b
        rows[n, :n], ends[n] = (c, d) if d else (product(c[None], a)[0], float((c * b).sum()))
        return rows, ends


class TriangleSynapse(Synapse, label="triangle"):
    """Weights that fall linearly to 0 over a time, with an area of 1."""

    t: float = param(unit="s", above=0.0, doc="time after which an input is forgotten")
    order = -1  # of the step

    def order_at(self, dt: float) -> int:
        # One at least, and the output itself.
        return max(round(self.t / dt), 1) + 1

    def matrices(self, dt: float) -> tuple[FloatArray, FloatArray]:
        n = self.order_at(dt)
        # So many inputs count as whole steps fit, and the one of now.
        weights = np.arange(round(self.t / dt) + 1, 0.0, -1.0)
        weights /= weights.sum()
        a, b = np.zeros((n, n)), np.zeros(n)
        b[0], b[-1] = 1.0, weights[0]
        a[range(1, n - 1), range(n - 2)] = 1.0
        a[-1, : len(weights) - 1] = weights[1:]
        return a, b


def _exponential(matrix: FloatArray) -> FloatArray:
    """The matrix exponential, by its series after halving until the norm is small."""
    # Not scipy's expm, which calls LAPACK: these matrices are part of a run's bits. Halved four
    # times below a norm of 1, fifteen terms leave 1e-30.
    halvings = max(0, math.ceil(math.log2(max(float(np.abs(matrix).sum()), 1e-300))) + 4)
    scaled = matrix / 2.0**halvings
    total, term = np.eye(len(matrix)), np.eye(len(matrix))
    for i in range(1, 16):
        term = product(term, scaled) / i
        total = total + term
    for _ in range(halvings):
        total = product(total, total)
    return total


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _has_arrays(kind: type[Variant]) -> bool:
    return any(declared.kind == "array" for declared in kind.declared.values())


def _form(kind: type[Variant]) -> str:
    return f"{kind.label}({', '.join(kind.declared)})" if kind.declared else kind.label


def passed(memory: FloatArray, a: FloatArray, b: FloatArray, value: FloatArray) -> FloatArray:
    """What a synapse in the state ``memory`` (order, k) makes of an input (k,)."""
    if len(b) == 0:
        return value
    if len(b) == 1:
        # Not a memory + b value: at rest this stays exactly at the input.
        return np.asarray(memory[0] + b[0] * (value - memory[0]))
    if len(b) == 2:
        return np.asarray(a[1, 0] * memory[0] + a[1, 1] * memory[1] + b[1] * value)
    # In this order in both engines.
    total = b[-1] * value
    for j in range(len(b)):
        total = total + a[-1, j] * memory[j]
    return np.asarray(total)


def remember(
    memory: FloatArray, a: FloatArray, b: FloatArray, value: FloatArray, output: FloatArray
) -> None:
    """Advance a synapse's state, given its input and what :func:`passed` made of it."""
    if len(b) == 1:
        memory[0] = output
    elif len(b) == 2:
        memory[0] = a[0, 0] * memory[0] + a[0, 1] * memory[1] + b[0] * value
        memory[1] = output
    elif len(b) > 2:
        before = memory.copy()
        for i in range(len(b) - 1):
            row = b[i] * value
            for j in range(len(b)):
                if a[i, j] != 0.0:
                    row = row + a[i, j] * before[j]
            memory[i] = row
        memory[-1] = output
