"""Learning rules: how decoders, encoders and weights change with activities and errors.

Each changes its arrays in place by one step. The activities are filtered spikes, those of the step
included, as in Nengo::

    pes_step(weights, activity, error, gamma=learning_rate * dt / n)   # W -= gamma error s'

A rule is a class with its parameters, by which graphs name it, and a function with its arithmetic,
which has no ``self`` and compiles. The kernels are loops where NumPy's form allocates or masks.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from blocks.core import FloatArray, Variant, kernel_of, param
from blocks.core.portable import share_of


class DecoderRule(Variant, root=True):
    """A rule for the weights of a Decoder, with an error: ``pes``, or ``{rule: pes, ...}``."""

    key = "rule"
    expected: ClassVar[str] = "a learning rule"

    learning_rate: float = param(
        1e-4, at_least=0.0, tunable=True, doc="kappa; 0 freezes the weights"
    )
    tau: float = param(
        0.005, unit="s", at_least=0.0, doc="time constant of the activities; 0: none"
    )


class PES(DecoderRule, label="pes"):
    """W -= (kappa dt / n) error s' (MacNeil and Eliasmith, 2011)."""


class RLS(DecoderRule, label="rls"):
    """W -= error (P s)', P -= P s s' P / (1 + s' P s), with P = kappa dt / n at the start.

    Recursive least squares (Sussillo and Abbott, 2009): n x n numbers in memory.
    """

    # Only where P begins: a change later would do nothing.
    learning_rate: float = param(1e-3, at_least=0.0, doc="kappa; 0 freezes the weights")


class EncoderRule(Variant, root=True):
    """A rule for the encoders of an Ensemble: ``voja``."""

    key = "rule"
    expected: ClassVar[str] = "a learning rule"


class Voja(EncoderRule, label="voja"):
    """e_i += kappa dt s_i (x - e_i): active neurons turn to the input (Voelker et al., 2014)."""

    learning_rate: float = param(
        1e-2, at_least=0.0, tunable=True, doc="kappa; 0 freezes the encoders"
    )
    tau: float = param(
        0.005, unit="s", at_least=0.0, doc="time constant of the activities; 0: none"
    )


class WeightRule(Variant, root=True):
    """A rule for weights from neurons to neurons: ``bcm`` or ``oja``."""

    key = "rule"
    expected: ClassVar[str] = "a learning rule"

    learning_rate: float = param(
        1e-9, at_least=0.0, tunable=True, doc="kappa; 0 freezes the weights"
    )
    tau: float = param(
        0.005, unit="s", at_least=0.0, doc="time constant of the activities; 0: none"
    )


class BCM(WeightRule, label="bcm"):
    """W += kappa dt p (p - theta) s', theta the slow mean of the post-synaptic spikes
    (Bienenstock, Cooper and Munro, 1982)."""

    theta_tau: float = param(1.0, unit="s", above=0.0, doc="time constant of theta")


class Oja(WeightRule, label="oja"):
    """W += kappa dt (p s' - beta p^2 W) (Oja, 1982)."""

    learning_rate: float = param(
        1e-6, at_least=0.0, tunable=True, doc="kappa; 0 freezes the weights"
    )
    beta: float = param(1.0, at_least=0.0, tunable=True, doc="weight of forgetting")


def share_of_spikes(tau: float, dt: float) -> float:
    """What :func:`follow` takes of the spikes of a step: all of them without a time constant."""
    return share_of(tau, dt) if tau > 0.0 else 1.0


def follow(activity: FloatArray, spikes: FloatArray, share: float) -> None:
    """activity += share (spikes - activity)."""
    activity += share * (spikes - activity)


@kernel_of(follow)
def _follow_kernel(activity: FloatArray, spikes: FloatArray, share: float) -> None:
    for i in range(len(activity)):
        activity[i] += share * (spikes[i] - activity[i])


def smooth(activity: FloatArray, spikes: FloatArray, fade: float, share: float) -> None:
    """activity = fade activity + share spikes.

    With fade = 1 - share it is :func:`follow` but for rounding; the published runs of the paper's
    ensemble were made with this form.
    """
    activity *= fade
    activity += share * spikes


@kernel_of(smooth)
def _smooth_kernel(activity: FloatArray, spikes: FloatArray, fade: float, share: float) -> None:
    # One pass; the two statements above become four, by way of an array each.
    for i in range(len(activity)):
        activity[i] = activity[i] * fade + share * spikes[i]


def pes_step(
    weights: FloatArray,
    activity: FloatArray,
    error: FloatArray,
    gamma: float,
    keep: float = 1.0,
    groups: int = 1,
) -> None:
    """The PES rule with a leak, in place, for each group: W = keep W - gamma error s'.

    Parameters
    ----------
    weights, activity, error : (rows, n), (n,), (groups * rows,).
    """
    rows, n = weights.shape
    each = n // groups
    if keep != 1.0:
        weights *= np.array(keep)
    scaled = [gamma * e for e in error.tolist()]
    for row in range(rows):
        if groups > 1:
            weights[row] -= np.repeat(scaled[row::rows], each) * activity
        elif scaled[row] != 0.0:
            # NumPy takes an array without axes much faster than a number.
            weights[row] -= np.array(scaled[row]) * activity


@kernel_of(pes_step)
def _pes_kernel(
    weights: FloatArray,
    activity: FloatArray,
    error: FloatArray,
    gamma: float,
    keep: float = 1.0,
    groups: int = 1,
) -> None:
    rows, n = weights.shape
    each = n // groups
    for group in range(groups):
        for row in range(rows):
            cells, scaled = weights[row], gamma * error[group * rows + row]
            # A pause, or a path without error, is frequent: then nothing is read or written.
            if keep != 1.0 or scaled != 0.0:
                for i in range(group * each, (group + 1) * each):
                    cells[i] = keep * cells[i] - scaled * activity[i]


def pes_each(weights: FloatArray, activity: FloatArray, scaled: FloatArray) -> None:
    """The rule PES for each member: W -= scaled s', (m, rows, n), (m, 1, n) and (m, rows, 1)."""
    if np.count_nonzero(scaled) == scaled.size:
        weights -= scaled * activity
        return
    # Rows without an error stay as they are: subtracting 0 would change the sign of a zero.
    for i, row in zip(*scaled[:, :, 0].nonzero(), strict=True):
        weights[i, row] -= scaled[i, row] * activity[i, 0]


def rls_step(
    weights: FloatArray, inverse: FloatArray, activity: FloatArray, error: FloatArray
) -> None:
    """One step of recursive least squares; inverse is P (n, n), symmetric."""
    # P -= d d' / (1 + s' P s) with d = P s, and P s again with the new P: the same as the gain
    # d / (1 + s' P s), and what the published method does.
    direction = np.einsum("ij,j->i", inverse, activity)
    direction /= math.sqrt(1.0 + float(np.add.reduce(direction * activity)))
    inverse -= direction[:, None] * direction
    step = np.einsum("ij,j->i", inverse, activity)
    for row in range(len(weights)):
        weights[row] -= error[row] * step


@kernel_of(rls_step)
def _rls_kernel(
    weights: FloatArray, inverse: FloatArray, activity: FloatArray, error: FloatArray
) -> None:
    n = len(activity)
    direction = np.zeros(n)
    norm = 1.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += inverse[i, j] * activity[j]
        direction[i] = total
        norm += total * activity[i]
    norm = math.sqrt(norm)
    for i in range(n):
        direction[i] /= norm
    for i in range(n):
        total = 0.0
        for j in range(n):
            # The row is complete when it is multiplied: one pass over P instead of two.
            inverse[i, j] -= direction[i] * direction[j]
            total += inverse[i, j] * activity[j]
        for row in range(len(weights)):
            weights[row, i] -= error[row] * total


def voja_step(
    rows: FloatArray, activity: FloatArray, scale: FloatArray, point: FloatArray, rate: float
) -> None:
    """rows += rate s (scale x - rows); rows (d, total), scale (total,), point (groups, d)."""
    groups, d = point.shape
    each = rows.shape[1] // groups
    amount = rate * activity
    for j in range(d):
        target = scale * np.repeat(point[:, j], each)
        rows[j] += amount * (target - rows[j])


@kernel_of(voja_step)
def _voja_kernel(
    rows: FloatArray, activity: FloatArray, scale: FloatArray, point: FloatArray, rate: float
) -> None:
    groups, d = point.shape
    each = len(activity) // groups
    for j in range(d):
        for group in range(groups):
            for i in range(group * each, (group + 1) * each):
                rows[j, i] += rate * activity[i] * (scale[i] * point[group, j] - rows[j, i])


def bcm_step(
    weights: FloatArray,
    before: FloatArray,
    after: FloatArray,
    theta: FloatArray,
    rates: FloatArray,
) -> None:
    """W_ij += rate_i p_i (p_i - theta_i) s_j."""
    # Rows of silent neurons do not change, and most are silent.
    factor = rates * after * (after - theta)
    for row in factor.nonzero()[0].tolist():
        weights[row] += factor[row] * before


@kernel_of(bcm_step)
def _bcm_kernel(
    weights: FloatArray,
    before: FloatArray,
    after: FloatArray,
    theta: FloatArray,
    rates: FloatArray,
) -> None:
    for row in range(len(after)):
        factor = rates[row] * after[row] * (after[row] - theta[row])
        for i in range(len(before)):
            weights[row, i] += factor * before[i]


def oja_step(
    weights: FloatArray,
    before: FloatArray,
    after: FloatArray,
    rates: FloatArray,
    forgets: float,
) -> None:
    """W_ij += rate_i p_i s_j - forgets p_i^2 W_ij."""
    factor, forget = rates * after, forgets * after * after
    for row in factor.nonzero()[0].tolist():
        weights[row] += factor[row] * before - forget[row] * weights[row]


@kernel_of(oja_step)
def _oja_kernel(
    weights: FloatArray,
    before: FloatArray,
    after: FloatArray,
    rates: FloatArray,
    forgets: float,
) -> None:
    for row in range(len(after)):
        factor, forget = rates[row] * after[row], forgets * after[row] * after[row]
        for i in range(len(before)):
            weights[row, i] += factor * before[i] - forget * weights[row, i]
