"""From a scan to chains of wall points: links, breaks, edges and averages along the chain.

Points are (m, 2) arrays of x and y (m) in the robot's frame, in the order of rising bearing: with
the wall on the right that is the direction of travel, and the robot is to the points' left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from blocks.core import BoolArray, FloatArray, IntArray, arctan2, directions, sin

LONGEST_LINK = 0.25  # m
MEDIAN = 9  # returns, over which ranges are filtered before lengths are measured
FARTHEST = 1e4  # m


def wrapped(angle: npt.NDArray[np.floating], low: float) -> FloatArray:
    """The same angles (rad) in [low, low + 2 pi)."""
    return np.asarray(np.remainder(angle - low, math.tau) + low)


@dataclass(frozen=True)
class Beams:
    """Directions of a scan's beams inside the bearing window, by rising bearing.

    order : index into the scan, (n,).
    bearing : rad, rising, (n,).
    direction : unit vectors, (n, 2).
    spacing : angle between neighbours (rad).
    """

    order: IntArray
    bearing: FloatArray
    direction: FloatArray
    spacing: float

    @classmethod
    def of(
        cls, beams: int, first: float, last: float, window: tuple[float, float], mirror: bool
    ) -> Beams:
        """Beams of a scan whose beam i points to ``first + i (last - first) / beams`` (rad).

        ``mirror`` negates bearings, so that a wall on the left looks like one on the right;
        ``window`` (rad, at most 2 pi wide) refers to the bearings after that, counted on from its
        first one: a window from -200 degrees begins 20 degrees to the left of straight behind.
        """
        spacing = (last - first) / beams
        bearing = first + np.arange(beams) * spacing
        bearing = wrapped(-bearing if mirror else bearing, window[0])
        # Once per run. A scan's own order begins where the sensor begins, often inside a wall.
        order = np.argsort(bearing, kind="stable")
        order = order[bearing[order] <= window[1]]
        bearing = bearing[order]
        direction = directions(bearing)
        return cls(order, bearing, direction, spacing)

    def incidence(self, wanted: float) -> float:
        """The ``wanted`` smallest incidence (rad), or more where beams are too sparse for that."""
        return max(wanted, 2.0 * self.spacing)


@dataclass(frozen=True)
class Returns:
    """The returns of a scan, by rising bearing.

    ranges : m, (m,).  bearing : rad, (m,).  points : the same as x and y, (m, 2) in m.
    """

    ranges: FloatArray
    bearing: FloatArray
    points: FloatArray

    @classmethod
    def of(cls, scan: FloatArray, beams: Beams) -> Returns:
        """Ranges (n,) in m; NaN, non-positive ranges and those beyond 10 km are not returns."""
        r = scan[beams.order]
        some = np.flatnonzero((r > 0.0) & (r < FARTHEST))
        r = r[some]
        return cls(r, beams.bearing[some], r[:, None] * beams.direction[some])

    def __getitem__(self, index: IntArray | BoolArray) -> Returns:
        return Returns(self.ranges[index], self.bearing[index], self.points[index])

    def __len__(self) -> int:
        return len(self.ranges)

    def hide(self, points: FloatArray, incidence: float) -> BoolArray:
        """Whether points (k, 2) lie behind the returns on either side of them, (k,).

        Returns that are ``incidence`` (rad) or more apart leave a gap that hides nothing.
        """
        phi = wrapped(arctan2(points[:, 1], points[:, 0]), self.bearing[0])
        after = np.searchsorted(self.bearing, phi)
        after = np.minimum(np.maximum(after, 1), len(self) - 1)
        front = np.maximum(self.ranges[after - 1], self.ranges[after])
        low, high = self.bearing[after - 1], self.bearing[after]
        between = (phi >= low) & (phi <= high) & (high - low < incidence)
        return np.asarray(between & (np.hypot(points[:, 0], points[:, 1]) > front))


@dataclass(frozen=True)
class Chains:
    """Returns linked into chains that are each one stretch of wall.

    returns : those of all chains, one chain after another.
    bounds : chain c holds returns[bounds[c]:bounds[c + 1]], (chains + 1,).
    edges : whether the wall ends at the chain's first and last return, (chains, 2): beams pass it
        there. It does not where something nearer hides the rest, or where the window or reach
        ends.
    """

    returns: Returns
    bounds: IntArray
    edges: BoolArray

    def __len__(self) -> int:
        return len(self.bounds) - 1


def link_limit(
    r1: FloatArray, r2: FloatArray, dphi: FloatArray, sigma: float, incidence: float
) -> FloatArray:
    """How far apart (m) neighbouring returns may be on one surface: an adaptive breakpoint.

    min(r1, r2) sin(dphi) / sin(lambda - dphi) + 4 sigma + 2 cm, where lambda (rad) is the smallest
    ``incidence`` of a beam on a wall that is still followed (Borges and Aldon, Journal of
    Intelligent and Robotic Systems 40, 2004, with 4 sigma + 2 cm for their 3 sigma). At most
    25 cm, which the quotient passes as dphi nears lambda; beyond lambda nothing links (-1).
    """
    rest = incidence - dphi
    slope = sin(dphi) / sin(np.maximum(rest, 1e-3))
    limit = np.minimum(np.minimum(r1, r2) * slope + (4.0 * sigma + 0.02), LONGEST_LINK)
    return np.where(rest > 0.0, limit, -1.0)


def steps(r: FloatArray, bearing: FloatArray) -> FloatArray:
    """Distances (m) of neighbours in polar form, (m - 1,): law of cosines, without cancelling."""
    near, far = r[:-1], r[1:]
    half = sin(0.5 * (bearing[1:] - bearing[:-1]))
    return np.asarray(np.sqrt((far - near) ** 2 + 4.0 * near * far * half**2))


def _broken(returns: Returns, sigma: float, incidence: float) -> BoolArray:
    """Whether a chain ends before each return, (m + 1,): also before the first and after all."""
    r, phi = returns.ranges, returns.bearing
    result = np.ones(len(returns) + 1, dtype=np.bool_)
    limit = link_limit(r[:-1], r[1:], phi[1:] - phi[:-1], sigma, incidence)
    result[1:-1] = steps(r, phi) > limit
    return result


def chain(
    returns: Returns, window: FloatArray, reach: float, sigma: float, incidence: float
) -> Chains | None:
    """Link returns into chains, keeping what lies within ``reach`` (m).

    A return that links to neither of its neighbours is dropped as noise.

    Parameters
    ----------
    returns : of one scan.
    window : the first and last bearing (rad) that the scan covers.
    reach : m. Returns beyond it take part in the linking, so that a cut there is no edge.
    sigma, incidence : see :func:`link_limit`.

    Returns
    -------
    None if nothing is left.
    """
    # Twice: without the noise between them, the two sides of a wall link to each other.
    broken = _broken(returns, sigma, incidence)
    linked = ~(broken[:-1] & broken[1:])
    if not linked.all():
        returns = returns[linked]
        broken = _broken(returns, sigma, incidence)
    if not len(returns):
        return None
    ends = _edges(returns, broken, window, incidence)
    inside = returns.ranges < reach
    cut = broken.copy()
    cut[1:-1] |= ~inside[1:] | ~inside[:-1]
    begins = np.flatnonzero(cut[:-1] & inside)
    stops = np.flatnonzero(cut[1:] & inside)
    if not len(begins):
        return None
    bounds = np.concatenate(([0], np.cumsum(stops - begins + 1)))
    return Chains(returns[inside], bounds, np.column_stack((ends[0, begins], ends[1, stops])))


def _edges(returns: Returns, broken: BoolArray, window: FloatArray, incidence: float) -> BoolArray:
    """Whether a chain begins (row 0) and ends (row 1) at each return with an edge, (2, m).

    It does where beams go past it: the next return is farther away, or there is none within the
    angle that a chain would bridge. Nothing is known beyond the window.
    """
    r, phi = returns.ranges, returns.bearing
    apart = phi[1:] - phi[:-1] >= incidence
    ends = np.empty((2, len(r)), dtype=np.bool_)
    ends[0, 0] = phi[0] - window[0] >= incidence
    ends[0, 1:] = broken[1:-1] & (apart | (r[:-1] > r[1:]))
    ends[1, -1] = window[1] - phi[-1] >= incidence
    ends[1, :-1] = broken[1:-1] & (apart | (r[1:] > r[:-1]))
    return ends


def chain_arcs(chains: Chains, width: int = MEDIAN) -> FloatArray:
    """Arc length (m) along each chain, from 0, (m,), measured on median-filtered ranges.

    Range noise would otherwise lengthen it: with 1 cm of noise 3 mm steps become 12 mm long.
    """
    size = np.diff(chains.bounds)
    low = np.repeat(chains.bounds[:-1], size)[:, None]
    high = np.repeat(chains.bounds[1:] - 1, size)[:, None]
    half = width // 2
    around = np.arange(len(low))[:, None] + np.arange(-half, half + 1)
    around = np.minimum(np.maximum(around, low), high)
    r = np.partition(chains.returns.ranges[around], half, axis=1)[:, half]
    arc = np.concatenate(([0.0], np.cumsum(steps(r, chains.returns.bearing))))
    return np.asarray(arc - np.repeat(arc[chains.bounds[:-1]], size))


def averages(chains: Chains, arc: FloatArray, spacing: float) -> tuple[FloatArray, IntArray]:
    """Mean points of bins of about ``spacing`` (m) of arc length, of all chains at once.

    Each chain has a whole number of equal bins; empty ones are left out. A spacing of 0 gives the
    points themselves.

    Parameters
    ----------
    chains, arc : the chains and the arc length along each, see :func:`chain_arcs`.
    spacing : m.

    Returns
    -------
    The averages (k, 2), and bounds (chains + 1,) of each chain's averages.
    """
    points = chains.returns.points
    if spacing == 0.0:
        return points, chains.bounds
    size = np.diff(chains.bounds)
    length = arc[chains.bounds[1:] - 1]
    bins = np.maximum(1, np.rint(length / spacing)).astype(np.intp)
    first = np.concatenate(([0], np.cumsum(bins)))
    slot = (arc * np.repeat(bins / np.maximum(length, 1e-12), size)).astype(np.intp)
    slot = np.minimum(slot, np.repeat(bins - 1, size)) + np.repeat(first[:-1], size)
    count = np.bincount(slot, minlength=first[-1])
    sums = [np.bincount(slot, weights=column, minlength=first[-1]) for column in points.T]
    full = count > 0
    before = np.concatenate(([0], np.cumsum(full)))
    return np.column_stack(sums)[full] / count[full, None], before[first]
