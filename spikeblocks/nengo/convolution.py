"""A convolutional transform as a matrix, which a graph's weights are.

In: a ``nengo.Convolution`` or ``nengo.ConvolutionTranspose``, and its kernel. Out: the matrix by
which it multiplies a signal::

    1 x 3 input, kernel [a, b] of one filter, padding "valid"  ->  [[a, b, 0], [0, a, b]]

The kernel is not flipped, as in neural networks. With padding "same", zeros stand around the input
so that there are ceil(n / stride) outputs along each axis, the odd zero behind (Nengo's
documentation; which side has the odd one, and groups, were compared with Nengo's output).
"""

from __future__ import annotations

from itertools import product
from typing import Any

import nengo
import numpy as np

from blocks.core import FloatArray

TRANSFORMS = (nengo.Convolution, nengo.ConvolutionTranspose)


def convolution_matrix(transform: Any, kernel: FloatArray) -> FloatArray:
    """The matrix (outputs, inputs) of a transform with a kernel of shape
    ``kernel_size + (channels of a group, filters)``.
    """
    if isinstance(transform, nengo.ConvolutionTranspose):
        # Of a convolution from its outputs to its inputs, whose kernel has these axes swapped.
        swapped = np.swapaxes(kernel, -1, -2)
        return _matrix(transform, transform.output_shape, transform.input_shape, swapped).T
    return _matrix(transform, transform.input_shape, transform.output_shape, kernel)


def _matrix(transform: Any, before: Any, after: Any, kernel: FloatArray) -> FloatArray:
    """The matrix of a convolution from signals of one shape to those of another."""
    size, new = before.spatial_shape, after.spatial_shape
    edges = [
        _padding(transform.padding, *each)
        for each in zip(size, new, kernel.shape, transform.strides, strict=False)
    ]
    inputs = _numbers(size, before.n_channels, transform.channels_last)
    outputs = _numbers(new, after.n_channels, transform.channels_last)
    result = np.zeros((outputs.size, inputs.size))
    groups = getattr(transform, "groups", 1)
    own = before.n_channels // groups  # channels that a filter reads
    filters = after.n_channels // groups
    for at in product(*map(range, new)):
        for offset in product(*map(range, kernel.shape[: len(size)])):
            place = tuple(
                i * stride + k - edge
                for i, stride, k, edge in zip(at, transform.strides, offset, edges, strict=True)
            )
            if all(0 <= i < n for i, n in zip(place, size, strict=True)):
                for g in range(groups):
                    mine = slice(g * filters, (g + 1) * filters)
                    rows, columns = outputs[at][mine], inputs[place][g * own : (g + 1) * own]
                    result[np.ix_(rows, columns)] += kernel[offset][:, mine].T
    return result


def _padding(padding: str, before: int, after: int, kernel: int, stride: int) -> int:
    """How many zeros are before the first number of an axis."""
    if padding == "valid":
        return 0
    return max((after - 1) * stride + kernel - before, 0) // 2


def _numbers(shape: tuple[int, ...], channels: int, channels_last: bool) -> Any:
    """The place of each number in the flat signal, channels last."""
    count = np.arange(int(np.prod(shape)) * channels)
    if channels_last:
        return count.reshape((*shape, channels))
    return np.moveaxis(count.reshape((channels, *shape)), 0, -1)
