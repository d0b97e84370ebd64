"""Where rays first hit edges and circles: all rays against all shapes in a few array operations.

Both answers are linear in the rays' unit vectors up to a division or a root, and so begin with
one product of matrices, shapes by rays.
"""

from __future__ import annotations

import numpy as np

from blocks.core import FloatArray, product

# How far beyond its ends an edge still stops a ray, as a share of its length: rounding must not
# let one slip through a corner.
OVERHANG = 1e-12


def to_edges(
    x: float, y: float, units: FloatArray, corner: FloatArray, edge: FloatArray
) -> FloatArray:
    """Range (m) from (x, y) along each ray to the first edge, (n,); inf where none is hit.

    The range t and the place s on the edge solve x + t u = a + s e. Crossed with e and with u,
    t = (a - x) x e / u x e and s = (a - x) x u / u x e. With the edge turned round so that t's
    numerator is not negative, 0 <= s <= 1 and t >= 0 are one condition,
    abs((a + e / 2 - x) x u) <= (u x e) / 2.

    Parameters
    ----------
    units : the rays' unit vectors, (2, n).
    corner, edge : where each edge begins, and the way to its end (m), (2, s).
    """
    ex, ey = edge
    ax, ay = corner[0] - x, corner[1] - y
    reach = ax * ey - ay * ex
    facing = np.where(reach < 0.0, -1.0, 1.0)
    rows = np.concatenate((facing * (ey, -ex), (-ay - 0.5 * ey, ax + 0.5 * ex)), axis=1).T
    crossed, off_middle = product(rows, units).reshape(2, -1, units.shape[1])
    hit = np.abs(off_middle) < (0.5 + OVERHANG) * crossed
    t = np.full(crossed.shape, np.inf)
    np.divide(np.abs(reach)[:, None], crossed, out=t, where=hit)
    nearest: FloatArray = t.min(axis=0)
    return nearest


def to_circles(x: float, y: float, units: FloatArray, circles: FloatArray) -> FloatArray:
    """Range (m) from (x, y) along each ray to the first circle, (n,); inf where none is hit.

    With c the centre as seen from (x, y), t = u . c - sqrt(r^2 - (u x c)^2).

    Parameters
    ----------
    units : the rays' unit vectors, (2, n).
    circles : x, y and r (m), (3, c).
    """
    cx, cy, r = circles[0] - x, circles[1] - y, circles[2]
    rows = np.concatenate(((cx, cy), (cy, -cx)), axis=1).T
    along, across = product(rows, units).reshape(2, -1, units.shape[1])
    # From inside of a circle, the way out is the only one there is.
    side = np.where(cx * cx + cy * cy < r * r, -1.0, 1.0)
    with np.errstate(invalid="ignore"):
        t = along - side[:, None] * np.sqrt((r * r)[:, None] - across * across)
    nearest: FloatArray = np.where(t >= 0.0, t, np.inf).min(axis=0)
    return nearest
