"""Solvers of decoders: from activities A (m, n) and targets Y (m, k) to decoders (n, k).

A graph names one, as in ``solver: {type: l2, reg: 0.05}``; it is called before the first tick::

    decoders = L2(reg=0.05).solve(rates, targets, rng)      # rates @ decoders is close to targets
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from blocks.core import FloatArray, Variant, param, product, solve

# Up to this many neurons, and multiplications, results have the same bits on every processor.
PORTABLE_NEURONS, PORTABLE_WORK = 200, 10**8
# Rounds of coordinate descent, and the relative change at which it has converged.
ROUNDS, CLOSE = 2_000, 1e-9


class SingularError(ArithmeticError):
    """The system has no solution; the message says why, and what to do."""


class DecoderSolver(Variant, root=True, registry="solvers"):
    """How decoders are solved: ``l2``, or ``{type: l2, reg: 0.1}``."""

    expected: ClassVar[str] = "a solver"
    sparse: ClassVar[bool] = False

    def solve(self, a: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Decoders (n, k) with A @ decoders close to Y.

        Raises
        ------
        SingularError : the system is singular.
        """
        raise NotImplementedError


class L2(DecoderSolver, label="l2"):
    """min |A D - Y|^2 + m (reg max A)^2 |D|^2: least squares with L2 regularisation."""

    reg: float = param(0.1, at_least=0.0, doc="regularisation, as a share of the largest rate")

    def solve(self, a: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
        return ridge(a, y, self.reg * float(a.max(initial=0.0)))


class L2NonZero(DecoderSolver, label="l2_nz"):
    """L2 with c_i = m (reg max A)^2 p_i for neuron i, p_i the share of points at which it fires.

    Neurons that fire at few points are regularised less.
    """

    reg: float = param(0.1, at_least=0.0, doc="regularisation, as a share of the largest rate")

    def solve(self, a: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
        gram = _regularised(a, nonzero(a, self.reg))
        try:
            return np.asarray(np.linalg.solve(gram, products(a.T, y)), dtype=np.float64)
        except np.linalg.LinAlgError:
            raise SingularError(_singular(a)) from None


class L2Noise(DecoderSolver, label="l2_noise"):
    """Least squares on activities with normal noise, which regularises as L2 does."""

    noise: float = param(0.1, above=0.0, doc="deviation, as a share of the largest rate")

    def solve(self, a: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
        # At least a tiny deviation: silent neurons would make the system singular.
        noisy: FloatArray = a + rng.normal(
            0.0, self.noise * max(float(a.max(initial=0.0)), 1e-12), a.shape
        )
        return ridge(noisy, y, 0.0)


class NNLS(DecoderSolver, label="nnls"):
    """min |A D - Y|^2 with D >= 0 (Lawson and Hanson)."""

    def solve(self, a: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
        from scipy.optimize import nnls  # scipy stays off the start-up path

        return np.stack([nnls(a, target)[0] for target in y.T], axis=1)


class NNLSL2(DecoderSolver, label="nnls_l2"):
    """min |G D - A'Y| with D >= 0, G = A'A + m (reg max A)^2 I: as L2, but no weight is negative.

    Where Y is negative, it counts as 0. So is Nengo's NnlsL2, by comparison of results.
    """

    reg: float = param(0.1, at_least=0.0, doc="regularisation, as a share of the largest rate")

    def sigma(self, a: FloatArray) -> FloatArray:
        """The regularisation of each neuron (n,)."""
        return np.full(a.shape[1], self.reg * float(a.max(initial=0.0)))

    def solve(self, a: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
        from scipy.optimize import nnls  # scipy stays off the start-up path

        gram, right = _regularised(a, self.sigma(a)), products(a.T, np.maximum(y, 0.0))
        return np.stack([nnls(gram, target)[0] for target in right.T], axis=1)


class NNLSL2NonZero(NNLSL2, label="nnls_l2_nz"):
    """As nnls_l2, with the regularisation of l2_nz."""

    def sigma(self, a: FloatArray) -> FloatArray:
        return nonzero(a, self.reg)


class Lasso(DecoderSolver, label="lasso"):
    """min |A D - Y|^2 / (2 m) + l1 s |D|_1 + l2 s^2 |D|^2 / 2 with s = max A: few decoders.

    Cyclic coordinate descent (Friedman, Hastie and Tibshirani, 2010).
    """

    l1: float = param(1e-4, at_least=0.0, doc="L1 regularisation, as a share of the largest rate")
    l2: float = param(1e-6, at_least=0.0, doc="L2 regularisation, as a share of its square")

    def solve(self, a: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
        largest, m = float(a.max(initial=0.0)), len(a)
        # Of the Gram matrix: a step costs n k operations, and m, the number of points, none.
        gram = products(a.T, a) / m
        right = products(a.T, y) / m
        threshold, ridge_term = self.l1 * largest, self.l2 * largest**2
        scale = gram.diagonal() + ridge_term
        decoders = np.zeros_like(right)
        left = right.copy()
        for _ in range(ROUNDS):
            change = 0.0
            for i in scale.nonzero()[0].tolist():
                old = decoders[i].copy()
                raw = left[i] + gram[i, i] * old
                new = np.sign(raw) * np.maximum(np.abs(raw) - threshold, 0.0) / scale[i]
                step = new - old
                if step.any():
                    left -= gram[:, i, None] * step
                    decoders[i] = new
                    change = max(change, float(np.abs(step).max()))
            if change * largest <= CLOSE * max(1.0, float(np.abs(decoders).max()) * largest):
                break
        return decoders


def products(a: FloatArray, b: FloatArray) -> FloatArray:
    """A matrix product: with the same bits everywhere up to a size, beyond that by BLAS."""
    if a.shape[0] * a.shape[1] * b.shape[1] <= PORTABLE_WORK:
        return product(a, b)
    return np.asarray(a @ b)


def nonzero(a: FloatArray, reg: float) -> FloatArray:
    """The regularisation sigma_i = reg max(A) sqrt(p_i) of each neuron (n,).

    p_i is the share of points at which it fires; a neuron that never fires gets 1, so that its
    weight is 0 and the system is not singular.
    """
    sigma: FloatArray = reg * float(a.max(initial=0.0)) * np.sqrt((a > 0.0).mean(axis=0))
    sigma[sigma == 0.0] = 1.0
    return sigma


def _regularised(a: FloatArray, sigma: FloatArray) -> FloatArray:
    gram = products(a.T, a)
    gram[np.diag_indices(len(gram))] += len(a) * sigma**2
    return gram


def ridge(a: FloatArray, y: FloatArray, sigma: float) -> FloatArray:
    """The D of (A'A + m sigma^2 I) D = A'Y; with fewer points than neurons, of the dual system.

    Raises
    ------
    SingularError : the matrix is singular to working precision.
    """
    m, n = a.shape
    is_dual = m < n
    # (A'A + c I)^-1 A' = A' (AA' + c I)^-1: the smaller of the two systems is solved.
    gram = products(a, a.T) if is_dual else products(a.T, a)
    gram[np.diag_indices(len(gram))] += m * sigma**2
    right = y if is_dual else products(a.T, y)
    try:
        if len(gram) <= PORTABLE_NEURONS:
            solved = solve(gram, right)
        else:
            solved = np.asarray(np.linalg.solve(gram, right), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise SingularError(_singular(a)) from None
    # A pivot that is not 0 but rounding leaves infinities.
    if not np.isfinite(solved).all():
        raise SingularError(_singular(a))
    return products(a.T, solved) if is_dual else solved


def _singular(a: FloatArray) -> str:
    silent = int((a.max(axis=0, initial=0.0) <= 0.0).sum())
    if silent == a.shape[1]:
        return "no neuron fires at any of the points; lower the intercepts, or raise the biases"
    dead = f"{silent} of {a.shape[1]} neurons are silent at all points, " if silent else ""
    return (
        f"the system is singular: {dead}some neurons respond alike; give the solver a reg above 0"
    )


def rmse(a: FloatArray, y: FloatArray, decoders: FloatArray) -> float:
    """The root mean square error of the decoded targets on the evaluation points."""
    error = products(a, decoders) - y
    return math.sqrt(float(np.square(error).sum()) / max(1, len(error)))
