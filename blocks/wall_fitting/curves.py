"""Splines through the chains of a scan, and the curves beside them at a distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from blocks.core import FloatArray
from blocks.wall_fitting.bspline import BSpline, control_points, fit
from blocks.wall_fitting.contour import Chains, Returns, averages, chain_arcs
from blocks.wall_fitting.offset import cap, left, nearest, runs, tangents, unit

STEP = 0.01  # m between samples of a curve
MOST = 600  # steps along all curves of a scan
SMOOTHING = 0.01  # of least-squares fits, see blocks.bspline.fit
CALM = 4  # samples on either side from which a curve's tangents are computed
ALONG = 0.08  # m on either side from which the direction of travel is computed


@dataclass(frozen=True)
class WallCurve:
    """A stretch of wall, sampled about every centimetre.

    position : m, (n, 2).  tangent : unit vectors, (n, 2).  travel : the same over so long a stretch
    that noise does not turn it back, (n, 2).
    """

    position: FloatArray
    tangent: FloatArray
    travel: FloatArray


def wall_curves(
    chains: Chains, degree: int, bin_length: float, spacing: float | None
) -> list[WallCurve]:
    """Fit a spline to each chain.

    Parameters
    ----------
    chains : of one scan.
    degree : k of the splines; lower where a chain has too few points for it.
    bin_length : arc (m) over which points are averaged to control points; 0 takes the points.
    spacing : distance (m) of control points of a least-squares fit to all points; None takes the
        averages as control points.
    """
    arc = chain_arcs(chains)
    # Random ranges make chains of 60 m, which are sampled more coarsely; a room's are 4 m long.
    step = max(STEP, float(arc[chains.bounds[1:] - 1].sum()) / MOST)
    means, first = averages(chains, arc, bin_length and max(bin_length, 2.0 * step))
    shortest = 1.5 * max(bin_length, 2.0 * step)
    points, own, bins = chains.returns.points, chains.bounds.tolist(), first.tolist()
    curves = []
    for a, b, c, d in zip(own[:-1], own[1:], bins[:-1], bins[1:], strict=True):
        length = float(arc[b - 1])
        if length < shortest:
            # A post: its direction is noise, so it is taken perpendicular to the beam.
            post = points[a:b].mean(axis=0)[None]
            around = unit(left(post))
            curves.append(WallCurve(post, around, around))
            continue
        if spacing is None:
            spline = BSpline(means[c:d], min(degree, d - c - 1))
        else:
            n = min(control_points(length, spacing, degree), b - a)
            spline = fit(points[a:b], n, min(degree, n - 1), arc[a:b] / length, SMOOTHING)
        # A fixed number of samples per control point, so that matrices are cached.
        each = max(2, round((bin_length if spacing is None else spacing) / step))
        position = spline.positions(each * len(spline.points))
        # Not the curve's own tangents, which are the most sensitive to noise.
        travel = tangents(position, max(CALM, round(ALONG * len(position) / length)))
        curves.append(WallCurve(position, tangents(position, CALM), travel))
    return curves


def offset_pieces(
    curves: list[WallCurve],
    chains: Chains,
    returns: Returns,
    distance: float,
    trim: float,
    incidence: float,
) -> list[FloatArray]:
    """The level set at a distance from all walls: curves moved to the left and trimmed.

    It continues around edges, see ``offset.cap``. Points nearer to any wall than
    ``distance - trim`` (m) and points behind a wall are dropped.

    Returns
    -------
    Pieces of rows, (n, 4) each with n > 2, in the order of the walls.
    """
    rows = []
    for curve, (begin, end) in zip(curves, chains.edges.tolist(), strict=True):
        position, tangent = curve.position, curve.tangent
        row = [np.column_stack((position + distance * left(tangent), curve.travel))]
        if begin:
            row.insert(0, cap(position[0], tangent[0], distance, 2.0 * STEP, begin=True))
        if end:
            row.append(cap(position[-1], tangent[-1], distance, 2.0 * STEP, begin=False))
        rows.append(np.concatenate(row))
    points = np.concatenate(rows)[:, :2]
    wall = np.concatenate([curve.position[::2] for curve in curves])
    clear = nearest(points, wall) >= distance - trim
    clear &= ~returns.hide(points, incidence)
    bounds = np.cumsum([0, *map(len, rows)]).tolist()
    return [
        row[a:b]
        for row, low, high in zip(rows, bounds[:-1], bounds[1:], strict=True)
        for a, b in runs(clear[low:high])
        if b - a > 2
    ]
