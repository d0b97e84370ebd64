"""Level sets of the distance to a world's surfaces, as closed loops of lines and arcs.

The points at distance d from a union of solids lie on the edges moved out by d, on arcs of radius
d about outward corners and on the circles made larger by d. Cut at all their intersections, each
piece is on the level set as a whole or not at all. A robot that cannot turn on the spot follows
such a loop with its concave kinks rounded.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise

import numpy as np

from blocks.core import BoolArray, FloatArray
from blocks.world.curves import ROUNDING, Arc, ComplexArray, Line, LineOrArc, meetings
from blocks.world.reader import WorldShapes

# Of points given by x and y: the distance to the nearest solid, and which are inside of one.
Gap = Callable[[FloatArray, FloatArray], tuple[FloatArray, BoolArray]]

# How far (m) a point may be from the distance it should have.
TOLERANCE = 1e-8
# How far (m) from a surface its free side is tested.
AWAY = 1e-6
# Ends nearer than this (m) are one point; where curves touch, intersections are that inexact.
JOINED = 1e-5
# A joint that turns less (rad) is smooth.
SMOOTH = 1e-5


def level_set(shapes: WorldShapes, gap_at: Gap, d: float) -> list[LineOrArc]:
    """All pieces of the level set of distance ``d`` (m), unordered; the surfaces for d = 0.

    Free space beyond is to the left of each piece.
    """
    curves = [curve for curve in _offsets(shapes, d) if curve.length > ROUNDING]
    pieces = _cut(curves)
    if not pieces:
        return []
    away = AWAY if d == 0.0 else 0.0
    middles = np.array([complex(p.shifted(away).at(np.array(0.5 * p.length))) for p in pieces])
    gap, solid = gap_at(middles.real, middles.imag)
    on = ~solid & (np.abs(gap - d - away) < TOLERANCE)
    return _distinct(
        [p for p, is_on in zip(pieces, on.tolist(), strict=True) if is_on], middles[on]
    )


def _distinct(pieces: list[LineOrArc], middles: ComplexArray) -> list[LineOrArc]:
    """Pieces without duplicates: solids that are flush with each other share pieces."""
    lengths = np.array([piece.length for piece in pieces])
    same = np.abs(middles - middles[:, None]) < TOLERANCE
    same &= np.abs(lengths - lengths[:, None]) < TOLERANCE
    first = ~np.any(np.triu(same, 1), axis=0)
    return [pieces[i] for i in np.flatnonzero(first).tolist()]


def _offsets(shapes: WorldShapes, d: float) -> Iterator[LineOrArc]:
    """All curves on which the level set may lie."""
    polygons = (*(() if shapes.room is None else (shapes.room,)), *shapes.obstacles)
    for corners in polygons:
        points = [complex(x, y) for x, y in corners.tolist()]
        edges = [Line(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
        for before, edge in zip([edges[-1], *edges[:-1]], edges, strict=True):
            yield edge.shifted(d)
            turn = edge.along * before.along.conjugate()
            if turn.imag < 0.0 and d > 0.0:
                yield Arc(edge.start, d, cmath.phase(1j * before.along), cmath.phase(turn))
    for x, y, r in shapes.circles.tolist():
        yield Arc(complex(x, y), r + d, math.pi, -2.0 * math.pi)


def _cut(curves: list[LineOrArc]) -> list[LineOrArc]:
    """Cut curves where they meet, and at the ends of curves that share their carrier."""
    places: list[list[float]] = [[0.0, curve.length] for curve in curves]
    shared = []
    for i, j in _close_pairs(curves):
        a, b = curves[i], curves[j]
        if all(b.off(complex(a.at(np.array(part * a.length)))) < ROUNDING for part in (0, 0.5, 1)):
            shared.append((i, j))
        points = meetings(a, b)
        points += [p for p in _ends(a) if b.off(p) < ROUNDING]
        points += [p for p in _ends(b) if a.off(p) < ROUNDING]
        places[i] += [a.locate(p) for p in points]
        places[j] += [b.locate(p) for p in points]
    # Flush solids have curves on one carrier, and a long one meets more carriers than a short one.
    # Both are cut at the same places, so that what they share are equal pieces.
    own = [list(cuts) for cuts in places]
    for i, j in shared:
        places[i] += [curves[i].locate(complex(curves[j].at(np.array(s)))) for s in own[j]]
        places[j] += [curves[j].locate(complex(curves[i].at(np.array(s)))) for s in own[i]]
    return [
        curve.cut(begin, end)
        for curve, cuts in zip(curves, places, strict=True)
        for begin, end in _intervals(cuts, curve.length)
    ]


def _close_pairs(curves: list[LineOrArc]) -> Iterator[tuple[int, int]]:
    """Pairs that may meet: no point of a curve is farther from its middle than half its length."""
    lengths = np.array([curve.length for curve in curves])
    middles = np.array([complex(c.at(np.array(0.5 * c.length))) for c in curves])
    apart = np.abs(middles - middles[:, None])
    close = apart <= 0.5 * (lengths + lengths[:, None]) + JOINED
    i, j = np.nonzero(np.triu(close, 1))
    return zip(i.tolist(), j.tolist(), strict=True)


def _intervals(places: list[float], length: float) -> list[tuple[float, float]]:
    inside = sorted(s for s in places if 0.0 <= s <= length)
    return [(a, b) for a, b in pairwise(inside) if b - a > ROUNDING]


def _ends(curve: LineOrArc) -> tuple[complex, complex]:
    first, last = curve.at(np.array([0.0, curve.length])).tolist()
    return first, last


def loops(pieces: Iterable[LineOrArc]) -> list[list[LineOrArc]]:
    """Join pieces, each to the one that begins where it ends; longest loop first."""
    rest = {i: (piece, *_ends(piece)) for i, piece in enumerate(pieces)}
    joined = []
    while rest:
        piece, begin, end = rest.pop(next(iter(rest)))
        loop = [piece]
        while abs(end - begin) > JOINED:
            here = end
            nearest = min(rest, key=lambda i: abs(rest[i][1] - here), default=None)
            if nearest is None or abs(rest[nearest][1] - here) > JOINED:
                break
            piece, _, end = rest.pop(nearest)
            loop.append(piece)
        joined.append(loop)
    return sorted(joined, key=lambda loop: -sum(piece.length for piece in loop))


def joints(loop: list[LineOrArc]) -> list[tuple[complex, float]]:
    """Where each piece of a loop begins, and the angle (rad) by which the loop turns there."""
    turns = []
    for before, after in zip([loop[-1], *loop[:-1]], loop, strict=True):
        start = np.array(0.0)
        turn = complex(after.tangent(start)) / complex(before.tangent(np.array(before.length)))
        turns.append((complex(after.at(start)), cmath.phase(turn)))
    return turns


def kinks(loop: list[LineOrArc]) -> list[complex]:
    """Joints at which the loop turns sharply, into free space: its concave kinks."""
    return [point for point, turn in joints(loop) if turn > SMOOTH]


def sampled(loop: list[LineOrArc], spacing: float) -> FloatArray:
    """Points of a closed loop, no further apart than ``spacing`` (m); the first ends it, (k, 2)."""
    counts = [max(1, math.ceil(piece.length / spacing)) for piece in loop]
    parts = [
        piece.at(np.linspace(0.0, piece.length, n, endpoint=False))
        for piece, n in zip(loop, counts, strict=True)
    ]
    points = np.concatenate([*parts, parts[0][:1]])
    return np.column_stack((points.real, points.imag))


STEP = 1e-3
ArcRange = tuple[float, float]


def filleted(loop: list[LineOrArc], rho: float) -> list[LineOrArc] | None:
    """Round the concave kinks of a closed loop by arcs of radius ``rho`` (m).

    A piece that is too short for the arcs at its ends is removed, and an arc joins its
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


def _fillet(before: LineOrArc, after: LineOrArc, corner: complex, rho: float) -> Arc | None:
    """The left turn of radius ``rho`` nearest to a corner that touches both carriers."""
    arcs = []
    for centre in meetings(before.shifted(rho), after.shifted(rho)):
        enter, leave = (
            complex(curve.tangent(np.array(curve.locate(centre)))) for curve in (before, after)
        )
        sweep = cmath.phase(leave / enter)
        # At their other intersection the carriers turn right.
        if sweep > 0.0:
            arcs.append(Arc(centre, rho, cmath.phase(-1j * enter), sweep))
    return min(arcs, key=lambda arc: abs(arc.centre - corner), default=None)


def _spans(ring: list[LineOrArc], arcs: list[Arc | None]) -> list[ArcRange]:
    """The part of each piece that its arcs leave, as arc lengths."""
    return [
        (
            0.0 if arc is None else piece.locate(arc.centre),
            piece.length if following is None else piece.locate(following.centre),
        )
        for piece, arc, following in zip(ring, arcs, [*arcs[1:], arcs[0]], strict=True)
    ]


def _assembled(
    ring: list[LineOrArc], arcs: list[Arc | None], spans: list[ArcRange]
) -> list[LineOrArc]:
    path: list[LineOrArc] = []
    for piece, arc, (begin, end) in zip(ring, arcs, spans, strict=True):
        path += [] if arc is None else [arc]
        path += [piece.cut(begin, end)] if end - begin > ROUNDING else []
    return path


def deviation(
    distance: Callable[[FloatArray], FloatArray],
    contours: list[list[LineOrArc]],
    d: float,
    rho: float,
) -> float:
    """Mean of ``|distance - d|`` (m) along loops that are rounded with radius ``rho`` (m).

    nan where there is no loop, or one cannot be rounded.
    """
    paths = [filleted(loop, rho) for loop in contours]
    points, weights = [], []
    for path in paths:
        if path is None:
            return math.nan
        for piece in path:
            n = math.ceil(piece.length / STEP)
            step = piece.length / n
            points.append(piece.at(np.linspace(0.5 * step, piece.length - 0.5 * step, n)))
            weights.append(np.full(n, step))
    if not points:
        return math.nan
    z, weight = np.concatenate(points), np.concatenate(weights)
    error = np.abs(distance(np.column_stack((z.real, z.imag))) - d)
    return float((error * weight).sum() / weight.sum())
