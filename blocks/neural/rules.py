"""Learning rules: how decoders, encoders and weights change with activities and errors.

Each changes its arrays in place by one step. The activities are filtered spikes, those of the step
included, as in Nengo::

    pes_step(weights, activity, error, gamma=learning_rate * dt / n)   # W -= gamma error s'

A rule is a class with its parameters, by which graphs name it, and a function with its arithmetic,
which has no ``self`` and compiles. The kernels are loops where NumPy's form allocates or masks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from blocks.core import FloatArray, SettingError, Variant, kernel_of, param
from blocks.neural.synapses import Synapse, passed, remember


class LearningRule(Variant, abstract=True):
    """What rules of all kinds have: a rate, and the synapse of the activities."""

    key = "rule"
    expected: ClassVar[str] = "a learning rule"
    together: ClassVar[type[Any] | None] = None  # the class of several rules, where they add up

    learning_rate: float = param(
        1e-4, at_least=0.0, tunable=True, doc="kappa; 0 freezes what the rule changes"
    )
    tau: Synapse = param(0.005, unit="s", doc="filter of the activities, or its time constant")

    def __init__(self, **values: Any) -> None:
        # A time constant of 0 is no filter.
        super().__init__(**{k: _filter(v) if k.endswith("tau") else v for k, v in values.items()})

    @classmethod
    def read(cls, written: Any) -> Any:
        if isinstance(written, list) and cls.together is not None and len(written) > 1:
            return cls.together([cls.read(each) for each in written])
        return super().read(written)

    @property
    def each(self) -> tuple[Any, ...]:
        """The rules of a list, or this one."""
        return (self,)


def _filter(tau: Any) -> Any:
    return "none" if isinstance(tau, (int, float)) and tau == 0 else tau


class Several:
    """Several rules that change the same numbers: their changes add up."""

    label = "several"

    def __init__(self, rules: Sequence[Any]) -> None:
        problems = self.problems(rules)
        if problems:
            raise SettingError([("", problems)])
        self.__dict__["rules"] = tuple(rules)

    def problems(self, rules: Sequence[Any]) -> str:
        """Why these rules do not go together; '' if they do."""
        return ""

    @property
    def each(self) -> tuple[Any, ...]:
        return tuple(self.__dict__["rules"])

    def written(self) -> Any:
        return [rule.written() for rule in self.each]


class DecoderRule(LearningRule, root=True):
    """A rule for the weights of a Decoder, with an error: ``pes``, or ``{rule: pes, ...}``."""


class PES(DecoderRule, label="pes"):
    """W -= (kappa dt / n) error s' (MacNeil and Eliasmith, 2011)."""


class RLS(DecoderRule, label="rls"):
    """W -= error (P s)', P -= P s s' P / (1 + s' P s), with P = kappa dt / n at the start.

    Recursive least squares (Sussillo and Abbott, 2009): n x n numbers in memory.
    """

    # Only where P begins: a change later would do nothing.
    learning_rate: float = param(1e-3, at_least=0.0, doc="kappa; 0 freezes the weights")


class EncoderRule(LearningRule, root=True):
    """A rule for the encoders of an Ensemble, ``voja``, or a list of them."""


class Voja(EncoderRule, label="voja"):
    """e_i += kappa dt s_i (x - e_i): active neurons turn to the input (Voelker et al., 2014)."""

    learning_rate: float = param(
        1e-2, at_least=0.0, tunable=True, doc="kappa; 0 freezes the encoders"
    )


class EncoderRules(Several, EncoderRule, abstract=True):
    """Several rules for the encoders."""

    def problems(self, rules: Sequence[Any]) -> str:
        if any(rule.tau.order not in (0, 1) for rule in rules):
            return "of several rules, each takes a time constant as its tau, or none"
        return ""


class WeightRule(LearningRule, root=True):
    """A rule for weights from neurons to neurons, ``bcm`` or ``oja``, or a list of both."""

    learning_rate: float = param(
        1e-9, at_least=0.0, tunable=True, doc="kappa; 0 freezes the weights"
    )
    post_tau: Synapse | None = param(
        None, unit="s", doc="filter of the activities after the weights; default tau"
    )

    @property
    def after(self) -> Synapse:
        """The filter of the activities after the weights."""
        return self.tau if self.post_tau is None else self.post_tau


class BCM(WeightRule, label="bcm"):
    """W += kappa dt p (p - theta) s', theta the slow mean of the post-synaptic spikes
    (Bienenstock, Cooper and Munro, 1982)."""

    theta_tau: Synapse = param(1.0, unit="s", doc="filter of theta, or its time constant")


class Oja(WeightRule, label="oja"):
    """W += kappa dt (p s' - beta p^2 W) (Oja, 1982)."""

    learning_rate: float = param(
        1e-6, at_least=0.0, tunable=True, doc="kappa; 0 freezes the weights"
    )
    beta: float = param(1.0, at_least=0.0, tunable=True, doc="weight of forgetting")


class WeightRules(Several, WeightRule, abstract=True):
    """Both rules for the weights."""

    def problems(self, rules: Sequence[Any]) -> str:
        if len({type(rule) for rule in rules}) < len(rules):
            return "of one kind, one rule learns: add up the learning rates"
        if len({(rule.tau, rule.after) for rule in rules}) > 1:
            return "several rules see the same activities: give them equal tau and post_tau"
        return ""


EncoderRule.together, WeightRule.together = EncoderRules, WeightRules


def share_of_spikes(tau: Synapse, dt: float) -> float:
    """What :func:`follow` takes of the spikes of a step: all of them without a filter."""
    share = tau.matrices(dt)[1]
    return float(share[0]) if len(share) == 1 else 1.0


def trace_matrices(tau: Synapse, dt: float) -> tuple[FloatArray, FloatArray]:
    """The matrices of a filter of the second order or higher; empty ones of a lowpass."""
    a, b = tau.matrices(dt)
    return (a, b) if len(b) > 1 else (np.zeros((0, 0)), np.zeros(0))


def trace_order(tau: Synapse, dt: float) -> int:
    """How many states a filter has beside its output, 0 for a lowpass."""
    return len(trace_matrices(tau, dt)[1])


def trace(
    activity: FloatArray,
    memory: FloatArray,
    a: FloatArray,
    b: FloatArray,
    spikes: FloatArray,
    share: float,
) -> None:
    """Filter the spikes of a step into the activities, those of the step included.

    ``memory`` has the states of a filter of the second order or higher, whose matrices are a, b;
    of a lowpass, which takes a ``share`` of the step, they are empty (:func:`trace_matrices`).
    """
    if len(b) > 0:
        activity[:] = passed(memory, a, b, spikes)
        remember(memory, a, b, spikes, activity)
    else:
        follow(activity, spikes, share)


def follow(activity: FloatArray, spikes: FloatArray, share: float) -> None:
    """activity += share (spikes - activity)."""
    activity += share * (spikes - activity)


def smooth(activity: FloatArray, spikes: FloatArray, fade: float, share: float) -> None:
    """activity = fade activity + share spikes.

    With fade = 1 - share it is :func:`follow` but for rounding; the published runs of the paper's
    ensemble were made with this form.
    """
    activity *= fade
    activity += share * spikes


@kernel_of(smooth)
def _smooth_kernel(activity: FloatArray, spikes: FloatArray, fade: float, share: float) -> None:
    # One pass, as the two statements above are not: ensembles take 1.04 to 1.1 times as long.
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


def voja_step(rows: FloatArray, amount: FloatArray, scale: FloatArray, point: FloatArray) -> None:
    """rows += amount (scale x - rows), amount the sum of rate s over the rules.

    rows (d, total), amount and scale (total,), point (groups, d).
    """
    groups, d = point.shape
    each = rows.shape[1] // groups
    for j in range(d):
        target = scale * np.repeat(point[:, j], each)
        rows[j] += amount * (target - rows[j])


@kernel_of(voja_step)
def _voja_kernel(
    rows: FloatArray, amount: FloatArray, scale: FloatArray, point: FloatArray
) -> None:
    groups, d = point.shape
    each = len(amount) // groups
    for j in range(d):
        for group in range(groups):
            for i in range(group * each, (group + 1) * each):
                rows[j, i] += amount[i] * (scale[i] * point[group, j] - rows[j, i])


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
