"""Vectors in space, matrices and quaternions of signals.

Vectors go in, vectors come out; a quaternion is (w, x, y, z), and a unit one turns a vector v of
the body into q v q* of the world::

    attitude (4,), force (3,)  ─▶ Rotate ─▶ force in the world (3,)
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Input,
    Output,
    Vector,
    cross_product,
    param,
    quaternion_product,
)


class Cross(Block):
    """The cross product of two vectors.

        left, right ─▶ [ Cross ] ─▶ out

    out = left x right: a torque of a lever and a force, a Coriolis term omega x v.
    """

    left = Input(Vector(3), doc="the first vector")
    right = Input(Vector(3), doc="the second one")
    out = Output(Vector(3), doc="left x right")

    def output(
        self, state: BlockState, t: float, left: FloatArray, right: FloatArray
    ) -> FloatArray:
        return cross_product(left, right)


class Normalize(Block):
    """A vector of length one.

        input ─▶ [ Normalize ] ─▶ out

    out = x / |x| with |x| = sqrt(sum x_i^2), and 0 where x is 0. Also brings a quaternion, of which
    rounding has changed the length, back to a rotation.
    """

    signal = Input(Vector("n"), name="input", doc="the vector x")
    out = Output(Vector("n"), through="input", doc="its direction")

    def output(self, state: BlockState, t: float, input: FloatArray) -> FloatArray:
        total = 0.0
        for i in range(len(input)):
            total += input[i] * input[i]
        length = math.sqrt(total)
        out = np.zeros(len(input))
        for i in range(len(input)):
            if length > 0.0:
                out[i] = input[i] / length
        return out


class MatrixMultiply(Block):
    """The product of two matrices that are signals, row by row.

        left, right ─▶ [ MatrixMultiply ] ─▶ out

    out = A B, A of ``rows`` x ``inner`` and B of ``inner`` x ``columns`` numbers. With one column,
    right and out are vectors. A matrix of numbers that do not change is a Gain.
    """

    left = Input(Vector("of_left"), doc="A, row after row")
    right = Input(Vector("of_right"), doc="B, row after row")
    out = Output(Vector("size"), doc="A B, row after row")

    rows: int = param(at_least=1, doc="rows of A")
    inner: int = param(at_least=1, doc="columns of A, and rows of B")
    columns: int = param(1, at_least=1, doc="columns of B")

    def sizes(self) -> dict[str, int]:
        sizes = super().sizes()
        if len(sizes) < 3:
            return sizes
        m, k, n = self.rows, self.inner, self.columns
        return {**sizes, "of_left": m * k, "of_right": k * n, "size": m * n}

    def start(self, state: BlockState) -> None:
        state.rows, state.inner, state.columns = self.rows, self.inner, self.columns

    def output(
        self, state: BlockState, t: float, left: FloatArray, right: FloatArray
    ) -> FloatArray:
        out = np.zeros(state.rows * state.columns)
        for i in range(state.rows):
            for j in range(state.columns):
                total = 0.0
                for k in range(state.inner):
                    total += left[i * state.inner + k] * right[k * state.columns + j]
                out[i * state.columns + j] = total
        return out


class Rotate(Block):
    """Turn a vector by a quaternion.

        vector, attitude ─▶ [ Rotate ] ─▶ out

    out = q v q* / |q|^2 with q = (w, r): ((w^2 - r.r) v + 2 (r.v) r + 2 w r x v) / |q|^2 (Kuipers,
    Quaternions and Rotation Sequences, 1999, section 5.6), so that a q that is not quite of length
    one turns all the same. With ``inverse``, by the opposite rotation: from the world to the body.
    """

    vector = Input(Vector(3), doc="the vector v, in the body")
    attitude = Input(Vector(4), doc="the quaternion q = (w, x, y, z)")
    out = Output(Vector(3), doc="v in the world")

    inverse: bool = param(False, doc="turn from the world to the body")

    def start(self, state: BlockState) -> None:
        state.sign = -1.0 if self.inverse else 1.0

    def why_not_finite(self) -> str:
        return "the quaternion has the length 0; it begins with (1, 0, 0, 0) for no rotation"

    def output(
        self, state: BlockState, t: float, vector: FloatArray, attitude: FloatArray
    ) -> FloatArray:
        w, r = attitude[0], state.sign * attitude[1:4]
        turned = cross_product(r, vector)
        along, inside = 0.0, 0.0
        for i in range(3):
            along += r[i] * vector[i]
            inside += r[i] * r[i]
        square = w * w + inside
        out = np.full(3, math.nan)
        for i in range(3):
            if square > 0.0:
                total = (w * w - inside) * vector[i] + 2.0 * along * r[i] + 2.0 * w * turned[i]
                out[i] = total / square
        return out


class QuaternionMultiply(Block):
    """One rotation after another.

        left, right ─▶ [ QuaternionMultiply ] ─▶ out

    out = left right (Hamilton's product): as a rotation, right first, then left.
    """

    left = Input(Vector(4), doc="a quaternion (w, x, y, z)")
    right = Input(Vector(4), doc="a quaternion")
    out = Output(Vector(4), doc="their product")

    inverse_left: bool = param(False, doc="take the inverse of left, as for an error of attitude")

    def start(self, state: BlockState) -> None:
        state.sign = -1.0 if self.inverse_left else 1.0

    def output(
        self, state: BlockState, t: float, left: FloatArray, right: FloatArray
    ) -> FloatArray:
        first = left.copy()
        for i in range(1, 4):
            first[i] = state.sign * left[i]
        return quaternion_product(first, right)
