"""The way of a robot that cannot turn on the spot: a contour with its concave kinks rounded."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

import numpy as np

from blocks.core import FloatArray
from blocks.world.curves import ROUNDING, Arc, Curve, meetings
from blocks.world.level_set import SMOOTH, joints

STEP = 1e-3
Span = tuple[float, float]


def filleted(loop: list[Curve], rho: float) -> list[Curve] | None:
    """Round the concave kinks of a closed loop by arcs of radius ``rho`` (m).

    A piece that is too short for the arcs at its ends is left out, and an arc joins its
    neighbours. None where no such arc exists.
    """
    ring = list(loop)
    corners = [point if turn > SMOOTH else None for point, turn in joints(loop)]
    while len(ring) > 1 or corners == [None]:
        arcs = []
        for i, corner in enumerate(corners):
            arc = None if corner is None else _fillet(ring[i - 1], ring[i], corner, rho)
            if corner is not None and arc is None:
                return None
            arcs.append(arc)
        spans = _spans(ring, arcs)
        worst = min(range(len(ring)), key=lambda i: spans[i][1] - spans[i][0])
        if spans[worst][1] - spans[worst][0] > -ROUNDING:
            return _assembled(ring, arcs, spans)
        eaten = ring.pop(worst)
        corners.pop(worst)
        corners[worst % len(corners)] = complex(eaten.at(np.array(0.5 * eaten.length)))
    return None


def _fillet(before: Curve, after: Curve, corner: complex, rho: float) -> Arc | None:
    """The left turn of radius ``rho`` nearest to a corner that touches both carriers."""
    arcs = []
    for centre in meetings(before.shifted(rho), after.shifted(rho)):
        enter, leave = (
            complex(curve.tangent(np.array(curve.locate(centre)))) for curve in (before, after)
        )
        sweep = cmath.phase(leave / enter)
        # Where the carriers meet once more, they do so the other way round.
        if sweep > 0.0:
            arcs.append(Arc(centre, rho, cmath.phase(-1j * enter), sweep))
    return min(arcs, key=lambda arc: abs(arc.centre - corner), default=None)


def _spans(ring: list[Curve], arcs: list[Arc | None]) -> list[Span]:
    """The part of each piece that its arcs leave, as arc lengths."""
    return [
        (
            0.0 if arc is None else piece.locate(arc.centre),
            piece.length if following is None else piece.locate(following.centre),
        )
        for piece, arc, following in zip(ring, arcs, [*arcs[1:], arcs[0]], strict=True)
    ]


def _assembled(ring: list[Curve], arcs: list[Arc | None], spans: list[Span]) -> list[Curve]:
    way: list[Curve] = []
    for piece, arc, (begin, end) in zip(ring, arcs, spans, strict=True):
        way += [] if arc is None else [arc]
        way += [piece.cut(begin, end)] if end - begin > ROUNDING else []
    return way


def deviation(
    distance: Callable[[FloatArray], FloatArray], found: list[list[Curve]], d: float, rho: float
) -> float:
    """Mean of ``|distance - d|`` (m) along loops that are rounded with radius ``rho`` (m).

    nan where there is no loop, or one cannot be rounded.
    """
    ways = [filleted(loop, rho) for loop in found]
    points, weights = [], []
    for way in ways:
        if way is None:
            return math.nan
        for piece in way:
            n = math.ceil(piece.length / STEP)
            step = piece.length / n
            points.append(piece.at(np.linspace(0.5 * step, piece.length - 0.5 * step, n)))
            weights.append(np.full(n, step))
    if not points:
        return math.nan
    z, weight = np.concatenate(points), np.concatenate(weights)
    error = np.abs(distance(np.column_stack((z.real, z.imag))) - d)
    return float((error * weight).sum() / weight.sum())
