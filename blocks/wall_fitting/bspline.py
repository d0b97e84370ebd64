"""B-spline curves as the paper writes them (section III-A), for any degree.

P(t) = sum_i N_{i,k}(t) P_i for t in [0, 1], with the quasi-uniform clamped knots of
:func:`knots` and the Cox-de Boor basis of :func:`basis`. Points are (n, 2) arrays of x and y (m).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from blocks.control import curvature
from blocks.core import FloatArray, arctan2, product, solve

CACHED = 64
LARGEST_CACHED = 50_000
RIDGE = 1e-9  # keeps a smoothed fit regular where the data do not even determine a line


@lru_cache(maxsize=CACHED)
def knots(points: int, degree: int) -> FloatArray:
    """Quasi-uniform clamped knots of the paper's equation (knot vector), shape (points + k + 1,).

    T = [0, ..., 0, 1/(n-k+1), ..., (n-k)/(n-k+1), 1, ..., 1], where n = points - 1 and both ends
    are written k + 1 times, k the ``degree``. The result is shared and read-only.

    Raises
    ------
    ValueError : if the degree is negative or there are not more points than the degree.
    """
    if not 0 <= degree < points:
        raise ValueError(f"degree {degree} needs at least {max(degree, 0) + 1} points")
    inner = np.linspace(0.0, 1.0, points - degree + 1)
    result = np.concatenate((np.zeros(degree), inner, np.ones(degree)))
    result.setflags(write=False)
    return result


def basis(t: FloatArray, points: int, degree: int, derivative: int = 0) -> FloatArray:
    """The basis N_{i,k}(t), or one of its derivatives, by the Cox-de Boor recursion.

    N_{i,k} = (t - t_i) / (t_{i+k} - t_i) N_{i,k-1}
    + (t_{i+k+1} - t) / (t_{i+k+1} - t_{i+1}) N_{i+1,k-1}, where 0/0 = 0. N_{i,0} is 1 on
    [t_i, t_{i+1}) and 0 elsewhere; the last span is closed, without which P(1) would be 0 and
    not P_N. Derivatives: N'_{i,k} = k / (t_{i+k} - t_i) N_{i,k-1}
    - k / (t_{i+k+1} - t_{i+1}) N_{i+1,k-1} (de Boor, A Practical Guide to Splines, 1978).

    Parameters
    ----------
    t : parameters in [0, 1], shape (m,).
    points : number of control points.
    degree : k.
    derivative : 0 for the basis itself, 1 or more for that derivative with respect to t.

    Returns
    -------
    Array (m, points); beyond [0, 1] all of it is 0.
    """
    if derivative > degree:
        return np.zeros((len(t), points))
    at = knots(points, degree)
    rows: FloatArray = _indicator(t, at, points, degree)
    column = t[:, None]
    for k in range(1, degree + 1):
        inverse = _inverse(at[k:] - at[:-k])
        if k <= degree - derivative:
            rising = (column - at[:-k]) * inverse * rows
            rows = rising[:, :-1] + (rows - rising)[:, 1:]
        else:
            slope = k * inverse * rows
            rows = slope[:, :-1] - slope[:, 1:]
    return rows


def _indicator(t: FloatArray, at: FloatArray, points: int, degree: int) -> FloatArray:
    """N_{i,0}(t) of all spans, shape (m, points + degree), the last one closed."""
    span = np.searchsorted(at, t, side="right") - 1
    span[t == 1.0] = points - 1
    inside = np.flatnonzero((t >= 0.0) & (t <= 1.0))
    rows = np.zeros((len(t), points + degree))
    rows[inside, span[inside]] = 1.0
    return rows


def _inverse(length: FloatArray) -> FloatArray:
    """1 / length, and 0 for spans without length: their basis functions are 0 anyway."""
    result = np.zeros_like(length)
    np.divide(1.0, length, out=result, where=length > 0.0)
    return result


def basis_matrices(points: int, degree: int, samples: int) -> FloatArray:
    """Basis, first and second derivative at even parameters, shape (3, samples, points).

    Small ones are cached, since a fitter needs the same ones ten times a second; read-only, each
    in the order of memory that :func:`combined` takes.
    """
    make = _cached_matrices if points * samples <= LARGEST_CACHED else _matrices
    return make(points, degree, samples)


def _matrices(points: int, degree: int, samples: int) -> FloatArray:
    t = np.linspace(0.0, 1.0, samples)
    result = np.empty((3, points, samples))
    for derivative in range(3):
        result[derivative] = basis(t, points, degree, derivative).T
    result.setflags(write=False)
    return result.swapaxes(1, 2)


_cached_matrices = lru_cache(maxsize=CACHED)(_matrices)


def combined(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """The product of a matrix (..., m, n), its columns contiguous, and points (n, 2): (..., m, 2).

    With both factors stored by columns, the inner loop of :func:`product` runs over the m rows,
    not over x and y alone, and takes a tenth of the time; each sum keeps its order.
    """
    return np.ascontiguousarray(product(matrix, np.asfortranarray(points)))


@dataclass(frozen=True)
class Samples:
    """Points along a curve: position (m) and derivatives by the parameter, (n, 2) each."""

    position: FloatArray
    first: FloatArray
    second: FloatArray

    @cached_property
    def theta(self) -> FloatArray:
        """Direction of the tangent (rad, continuous along the curve), shape (n,)."""
        return np.unwrap(arctan2(self.first[:, 1], self.first[:, 0]))

    @cached_property
    def kappa(self) -> FloatArray:
        """Signed curvature (1/m), positive where the curve bends left, shape (n,)."""
        return curvature(self.first, self.second)


@dataclass(frozen=True)
class BSpline:
    """The curve P(t) = sum_i N_{i,k}(t) P_i (paper, section III-A).

    Parameters
    ----------
    points : control points P_i, shape (n, 2) in m.
    degree : k; a curve has at least k + 1 control points.
    """

    points: FloatArray
    degree: int = 3

    def __call__(self, t: FloatArray, derivative: int = 0) -> FloatArray:
        """Position, or a derivative by t, at parameters (m,): an array (m, 2)."""
        return product(basis(t, len(self.points), self.degree, derivative), self.points)

    def at(self, t: FloatArray) -> Samples:
        """Position and two derivatives at parameters (m,)."""
        return Samples(self(t), self(t, 1), self(t, 2))

    def positions(self, samples: int) -> FloatArray:
        """Positions at that many even parameters, (samples, 2), by a cached matrix."""
        at = basis_matrices(len(self.points), self.degree, samples)[0]
        return combined(at, self.points)

    def sampled_evenly(
        self, spacing: float, samples: int, start: float = 0.0, fine: int = 0
    ) -> Samples:
        """Samples evenly spaced by arc length, the first one ``start`` metres along the curve.

        They are interpolated linearly between ``fine`` even parameters (default: four for each
        sample), which is off by h^2 kappa / 8 at a distance h between these. A curve that is too
        short is sampled more closely, if necessary from its beginning.
        """
        at = basis_matrices(len(self.points), self.degree, fine or 4 * samples)
        dense = combined(at, self.points)
        arc = arc_length(dense[0])
        length = (samples - 1) * spacing
        start = min(start, max(0.0, float(arc[-1]) - length))
        wanted = np.linspace(start, min(start + length, float(arc[-1])), samples)
        return Samples(*(interpolate(wanted, arc, values) for values in dense))


def arc_length(line: FloatArray) -> FloatArray:
    """Arc length (m) at each point of a polyline (n, 2), shape (n,)."""
    step = line[1:] - line[:-1]
    arc = np.zeros(len(line))
    np.cumsum(np.hypot(step[:, 0], step[:, 1]), out=arc[1:])
    return arc


def interpolate(wanted: FloatArray, at: FloatArray, values: FloatArray) -> FloatArray:
    """Columns of ``values`` (n, 2), given at rising ``at`` (n,), interpolated linearly, (m, 2)."""
    result = np.empty((len(wanted), 2))
    result[:, 0] = np.interp(wanted, at, values[:, 0])
    result[:, 1] = np.interp(wanted, at, values[:, 1])
    return result


def chord_length(points: FloatArray) -> FloatArray:
    """Parameters in [0, 1] in proportion to the arc length along the points, shape (m,).

    Evenly spaced if all points are equal.
    """
    arc = arc_length(points)
    if not arc[-1] > 0.0:
        return np.linspace(0.0, 1.0, len(points))
    return np.asarray(arc / arc[-1])


def fit(
    data: FloatArray,
    points: int,
    degree: int = 3,
    t: FloatArray | None = None,
    smoothing: float = 0.0,
) -> BSpline:
    """Least-squares fit of few control points to many points.

    Minimises sum_j |P(t_j) - data_j|^2 + smoothing m / n sum_i |P_i - 2 P_{i+1} + P_{i+2}|^2, the
    second term as in P-splines (Eilers and Marx, Statistical Science 11, 1996), for m data and n
    control points: it determines spans without data, and smooths the fit to noisy ones.

    Parameters
    ----------
    data : points (m, 2).
    points : number of control points n; at least degree + 1.
    degree : k.
    t : one parameter in [0, 1] for each of the data; default: chord lengths.
    smoothing : weight of the control polygon's bends, without unit; 0 is plain least squares
        (undetermined control points are then those of least norm).
    """
    t = chord_length(data) if t is None else t
    design = basis(t, points, degree)
    if smoothing > 0.0 and points > 2:
        bends = _bends(points) * (smoothing * len(data) / points)
        normal = product(design.T, design) + bends + RIDGE * np.eye(points)
        control = solve(normal, product(design.T, data))
    else:
        control = np.asarray(np.linalg.lstsq(design, data, rcond=None)[0], dtype=np.float64)
    return BSpline(control, degree)


@lru_cache(maxsize=CACHED)
def _bends(points: int) -> FloatArray:
    """D'D of the second differences D of control points, shape (points, points)."""
    second = np.diff(np.eye(points), n=2, axis=0)
    result = product(second.T, second)
    result.setflags(write=False)
    return result


@lru_cache(maxsize=CACHED)
def projection(points: int, degree: int, samples: int) -> FloatArray:
    """(B'B)^-1 B' of the basis B at even parameters, shape (points, samples), for `combined`."""
    # Not by pinv: B-splines are well conditioned, and a threaded SVD took up to 0.1 s.
    at = np.ascontiguousarray(basis_matrices(points, degree, samples)[0])
    result = np.asfortranarray(solve(product(at.T, at), at.T))
    result.setflags(write=False)
    return result


def fit_even(data: FloatArray, points: int, degree: int = 3) -> BSpline:
    """Least-squares fit to points that are evenly spaced along a curve.

    Equals :func:`fit` without smoothing, but with a cached matrix.

    Raises
    ------
    ValueError : if there are fewer data than control points.
    """
    if len(data) < points:
        raise ValueError(f"{points} control points need as many data, got {len(data)}")
    return BSpline(combined(projection(points, degree, len(data)), data), degree)


def control_points(length: float, spacing: float, degree: int) -> int:
    """How many control points a curve of that length (m) takes at that spacing (m)."""
    return degree + max(1, math.ceil(length / spacing))
