"""Frequency response and poles of a linear system, also of one with long delays and many states.

In: A, b, c, d of one input and one output. Out: c (pI - A)^-1 b + d at p = jw, or at p = e^(jwT).
Of A = -1, b = c = 1, d = 0 at w = 1: 0.5 - 0.5j.

A delay of m periods is m rows of A with one entry each: z x_i = g x_j. Its states are taken out as
x_i = g^m z^-m x_r, exactly, so that a delay of 2000 periods costs no more than one of 2.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from blocks.core.signals import FloatArray

Complex = npt.NDArray[np.complex128]
FEW_STATES = 40  # up to here (pI - A) x = b is solved as it is, which keeps the most digits
CHUNK = 1 << 20  # numbers of (pI - A) in memory at a time
MOST_TURN = 0.3  # rad, by which a delay turns between two frequencies
NO_VALUE = complex(np.inf, np.nan)  # at a pole on the axis, as python-control has it


def eigenvalues(a: FloatArray) -> Complex:
    """The eigenvalues of A, shape (n, n), by its parts that act on each other in circles.

    A delay between two other parts has exact zeros; of the whole matrix, rounding makes the
    eigenvalues of m delays as large as eps^(1/m), 0.89 for m = 300.
    """
    from scipy.sparse.csgraph import connected_components

    count, labels = connected_components(a != 0.0, connection="strong")
    if count < 2:
        return np.asarray(np.linalg.eigvals(a), dtype=complex)
    order = np.argsort(labels, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)
    return np.concatenate([np.linalg.eigvals(a[np.ix_(p, p)]) for p in parts], dtype=complex)


def refined(w: FloatArray, delay: float) -> FloatArray:
    """Ascending frequencies, shape (k,), and more where a delay turns too far between two."""
    fine = int(np.searchsorted(np.diff(w) * delay, MOST_TURN))
    if fine == len(w) - 1:
        return w
    count = int(np.ceil((w[-1] - w[fine]) * delay / MOST_TURN)) + 1
    return np.concatenate([w[:fine], np.linspace(w[fine], w[-1], count)])


def delay_chains(a: FloatArray, b: FloatArray) -> dict[int, tuple[int, int, float]]:
    """The states that are delayed copies of another one, or of the input (with the index n).

    Parameters
    ----------
    a : A, shape (n, n). b : its input, shape (n,).

    Returns
    -------
    For each: what it is a copy of, by how many periods it is later, and a factor.
    """
    rows = [np.flatnonzero(row) for row in np.column_stack([a, b])]
    sources = {
        i: int(columns[0]) if len(columns) else len(a)
        for i, columns in enumerate(rows)
        if len(columns) < 2 and i not in columns
    }
    factors = {
        i: float(b[i] if source == len(a) else a[i, source]) for i, source in sources.items()
    }
    chains: dict[int, tuple[int, int, float]] = {}
    for start in tuple(sources):
        path: dict[int, None] = {}
        at = start
        while at in sources and at not in chains and at not in path:
            path[at] = None
            at = sources[at]
        if at in path:  # a ring of delays: one of its states stays
            del sources[at]
        root, ticks, factor = chains.get(at, (at, 0, 1.0))
        for i in reversed(path):
            if i == at:
                root, ticks, factor = at, 0, 1.0
            else:
                root, ticks, factor = root, ticks + 1, factor * factors[i]
                chains[i] = root, ticks, factor
    return chains


class FrequencyResponse:
    """The response at any number of frequencies at once, from one input to one output.

    Parameters
    ----------
    a : A, shape (n, n). b, c : the column of B and the row of C, shape (n,). period : that of a
    sampled system; 0 in continuous time.
    """

    def __init__(
        self, a: FloatArray, b: FloatArray, c: FloatArray, d: float, period: float = 0.0
    ) -> None:
        n = len(a)
        chains = delay_chains(a, b) if period else {}
        kept = [i for i in range(n) if i not in chains]
        read = np.vstack([a[kept], c])  # by column: what reads a state
        taps: dict[int, list[tuple[int, FloatArray]]] = {n: []}  # the input first
        for i, (root, ticks, factor) in chains.items():
            if factor and read[:, i].any():
                taps.setdefault(root, []).append((ticks, factor * read[:, i]))
        self.period, self.delay = period, period * len(chains)
        self._taps, self._c = list(taps.values()), c[kept]
        self._direct = np.append(b[kept], d)
        self._roots = [kept.index(root) for root in taps if root != n]
        self._solve = _solver(a[np.ix_(kept, kept)])
        self._chunk = CHUNK // (1 + len(kept) * max(min(len(kept), FEW_STATES), len(taps))) + 1

    def __call__(self, w: FloatArray) -> Complex:
        """The values at frequencies w (rad per time), shape (k,): (inf, nan) at a pole."""
        parts = [w[k : k + self._chunk] for k in range(0, len(w), self._chunk)]
        with np.errstate(all="ignore"):
            found = np.concatenate([self._values(part) for part in parts])
        found[~np.isfinite(found)] = NO_VALUE
        return found

    def _values(self, w: FloatArray) -> Complex:
        p = np.asarray(np.exp(1j * self.period * w) if self.period else 1j * w, dtype=complex)
        # What comes in by a unit of the input, and of each state that is read late: columns of the
        # kept states and of the output, shape (k, kept + 1, 1 + roots).
        columns = np.zeros((len(w), len(self._direct), len(self._taps)), dtype=complex)
        columns[:, :, 0] = self._direct
        for j, taps in enumerate(self._taps):
            for ticks, read in taps:
                columns[:, :, j] += np.exp(-1j * self.period * ticks * w)[:, None] * read
        states = self._solve(p, columns[:, :-1])
        y = columns[:, -1] + np.einsum("i,kij->kj", self._c, states)
        if not self._roots:
            return np.asarray(y[:, 0])
        # The states that are read late are what the input and they themselves make of them.
        inner = states[:, self._roots]
        own = _solved(np.eye(len(self._roots)) - inner[:, :, 1:], inner[:, :, :1])
        return np.asarray(y[:, 0] + np.einsum("kj,kj->k", y[:, 1:], own[..., 0]))


def _solver(a: FloatArray) -> Callable[[Complex, Complex], Complex]:
    """(p, columns) to (pI - A)^-1 columns; shapes (k,) and (k, n, m).

    Many states are brought to triangular form once (Schur), after which each frequency costs n^2.
    """
    n = len(a)
    if n <= FEW_STATES:
        return lambda p, columns: _solved(p[:, None, None] * np.eye(n) - a, columns)
    from scipy.linalg import schur

    triangle, basis = schur(a, output="complex")

    def solve(p: Complex, columns: Complex) -> Complex:
        k, _, m = columns.shape
        x = basis.conj().T @ columns.transpose(1, 0, 2).reshape(n, k * m)
        x = x.reshape(n, k, m)
        for i in reversed(range(n)):
            later = triangle[i, i + 1 :] @ x[i + 1 :].reshape(n - i - 1, k * m)
            x[i] = (x[i] + later.reshape(k, m)) / (p - triangle[i, i])[:, None]
        return np.asarray((basis @ x.reshape(n, k * m)).reshape(n, k, m).transpose(1, 0, 2))

    return solve


def _solved(matrices: Complex, columns: Complex) -> Complex:
    """The solutions, NaN where a matrix is singular; shapes (k, n, n) and (k, n, m)."""
    try:
        return np.asarray(np.linalg.solve(matrices, columns))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full(columns.shape, np.nan + 0j)
        half = len(matrices) // 2
        parts = (slice(half), slice(half, None))
        return np.concatenate([_solved(matrices[part], columns[part]) for part in parts])
