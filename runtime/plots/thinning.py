"""Long series with fewer points, as many as a figure can show.

In: rows of a recording. Out: fewer rows with the same look: ``thin`` keeps the extremes of each
block of rows, so that a single spike is seen; ``block_means`` has the mean of each block.
"""

from __future__ import annotations

import numpy as np

from blocks.core import FloatArray


def thin(t: FloatArray, y: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    """A series of about ``most`` points that keeps the extremes of each block, and both ends."""
    if len(y) <= most:
        return t, y
    # Of each block of rows the smallest and the largest: every n-th row would lose single spikes,
    # and turn a sine that is faster than the blocks into a slow one (aliasing).
    size = -(-2 * len(y) // most)
    full = len(y) // size * size
    starts = np.arange(0, full, size)
    blocks = y[:full].reshape(-1, size)
    keep = [starts + blocks.argmin(axis=1), starts + blocks.argmax(axis=1), [0, len(y) - 1]]
    if full < len(y):
        keep.append([full + y[full:].argmin(), full + y[full:].argmax()])
    index = np.unique(np.concatenate(keep))
    return t[index], y[index]


def block_means(values: FloatArray, size: int) -> FloatArray:
    """Means over blocks of ``size`` rows, of the finite values; NaN where there are none."""
    full = len(values) // size * size
    blocks = [values[:full].reshape(-1, size, values.shape[1]), values[None, full:]]
    return np.concatenate([_means(block) for block in blocks if block.size])


def _means(blocks: FloatArray) -> FloatArray:
    """Means of the finite values over the second of three axes."""
    finite = np.isfinite(blocks)
    if finite.all():
        means: FloatArray = blocks.mean(axis=1)
        return means
    # A block without a finite value is 0 / 0, which is NaN as wanted.
    with np.errstate(invalid="ignore"):
        means = np.where(finite, blocks, 0.0).sum(axis=1) / finite.sum(axis=1)
    return means
