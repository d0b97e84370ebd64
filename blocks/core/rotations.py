"""Vectors in space and rotations, in loops that both engines compute alike.

A quaternion is (w, x, y, z); a unit one turns a vector v of the body into q v q* of the world::

    turned(rotation_matrix(np.array([0.0, 0.0, 0.0, 1.0])), np.array([1.0, 0.0, 0.0]))  # (-1, 0, 0)
"""

from __future__ import annotations

import numpy as np

from blocks.core.signals import FloatArray


def cross_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """a x b of vectors (3,)."""
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


def quaternion_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Hamilton's product a b of quaternions (4,)."""
    out = np.empty(4)
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    return out


def rotation_matrix(q: FloatArray) -> FloatArray:
    """R (3, 3) with R v = q v q* / |q|^2, of a quaternion (4,) that is not 0.

    Its columns are the axes of the body in the world. Divided by |q|^2, so that a quaternion whose
    length is not quite one still gives a rotation (Kuipers, 1999, section 5.6).
    """
    w, x, y, z = q[0], q[1], q[2], q[3]
    s = 2.0 / (w * w + x * x + y * y + z * z)
    out = np.empty((3, 3))
    out[0, 0], out[1, 1] = 1.0 - s * (y * y + z * z), 1.0 - s * (x * x + z * z)
    out[2, 2] = 1.0 - s * (x * x + y * y)
    out[0, 1], out[1, 0] = s * (x * y - w * z), s * (x * y + w * z)
    out[0, 2], out[2, 0] = s * (x * z + w * y), s * (x * z - w * y)
    out[1, 2], out[2, 1] = s * (y * z - w * x), s * (y * z + w * x)
    return out


def turned(matrix: FloatArray, v: FloatArray) -> FloatArray:
    """R v of a matrix and a vector (3,)."""
    out = np.empty(3)
    for i in range(3):
        out[i] = matrix[i, 0] * v[0] + matrix[i, 1] * v[1] + matrix[i, 2] * v[2]
    return out


def turned_back(matrix: FloatArray, v: FloatArray) -> FloatArray:
    """R' v of a matrix and a vector (3,)."""
    out = np.empty(3)
    for i in range(3):
        out[i] = matrix[0, i] * v[0] + matrix[1, i] * v[1] + matrix[2, i] * v[2]
    return out
