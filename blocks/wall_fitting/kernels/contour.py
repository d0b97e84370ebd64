"""Kernels of :mod:`blocks.wall_fitting.contour`.

Returns are rows of range, bearing, x and y (m, 4), in place of the class there: one array goes
through all steps, and a loop ends at the count of rows that are left, where NumPy masks.
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import BoolArray, FloatArray, IntArray
from blocks.wall_fitting.contour import FARTHEST, LONGEST_LINK, MEDIAN


def returned(
    scan: FloatArray, order: IntArray, bearing: FloatArray, direction: FloatArray
) -> FloatArray:
    """The returns of a scan, (m, 4), by the arrays of that scan's ``Beams``."""
    result = np.empty((len(order), 4))
    m = 0
    for i in range(len(order)):
        r = scan[order[i]]
        if 0.0 < r < FARTHEST:
            result[m, 0], result[m, 1] = r, bearing[i]
            result[m, 2], result[m, 3] = r * direction[i, 0], r * direction[i, 1]
            m += 1
    return result[:m]


def link_limit_kernel(r1: float, r2: float, dphi: float, sigma: float, incidence: float) -> float:
    """How far apart (m) two returns may be on one surface."""
    rest = incidence - dphi
    if rest <= 0.0:
        return -1.0
    slope = math.sin(dphi) / math.sin(max(rest, 1e-3))
    return min(min(r1, r2) * slope + (4.0 * sigma + 0.02), LONGEST_LINK)


def stride(near: float, far: float, dphi: float) -> float:
    """Distance (m) of two points in polar form; ``contour.steps`` of one step."""
    half = math.sin(0.5 * dphi)
    return math.sqrt((far - near) * (far - near) + 4.0 * near * far * (half * half))


def broken(returns: FloatArray, sigma: float, incidence: float) -> BoolArray:
    """Whether a chain ends before each return, (m + 1,): also before the first and after all."""
    result = np.ones(len(returns) + 1, np.bool_)
    for i in range(1, len(returns)):
        r1, r2, dphi = returns[i - 1, 0], returns[i, 0], returns[i, 1] - returns[i - 1, 1]
        result[i] = stride(r1, r2, dphi) > link_limit_kernel(r1, r2, dphi, sigma, incidence)
    return result


def linked(returns: FloatArray, sigma: float, incidence: float) -> FloatArray:
    """The returns that link to one of their neighbours."""
    apart = broken(returns, sigma, incidence)
    result = np.empty((len(returns), 4))
    m = 0
    for i in range(len(returns)):
        if not (apart[i] and apart[i + 1]):
            for c in range(4):
                result[m, c] = returns[i, c]
            m += 1
    return result[:m]


def chain_kernel(
    returns: FloatArray, window: FloatArray, reach: float, sigma: float, incidence: float
) -> tuple[FloatArray, IntArray, BoolArray]:
    """The returns of all chains, their bounds and edges; ``window`` begins and ends the scan."""
    returns = linked(returns, sigma, incidence)
    apart = broken(returns, sigma, incidence)
    m = len(returns)
    points = np.empty((m, 4))
    bounds = np.zeros(m + 1, np.int64)
    edges = np.zeros((m, 2), np.bool_)
    chains, n = 0, 0
    for i in range(m):
        if not returns[i, 0] < reach:
            continue
        for c in range(4):
            points[n, c] = returns[i, c]
        n += 1
        if apart[i] or not returns[i - 1, 0] < reach:
            edges[chains, 0] = passed(returns, apart, i, i - 1, window[0], incidence)
        if apart[i + 1] or not returns[i + 1, 0] < reach:
            edges[chains, 1] = passed(returns, apart, i, i + 1, window[-1], incidence)
            chains += 1
            bounds[chains] = n
    return points[:n], bounds[: chains + 1], edges[:chains]


def passed(
    returns: FloatArray, apart: BoolArray, i: int, other: int, window: float, incidence: float
) -> bool:
    """Whether a wall ends at return ``i`` towards its neighbour ``other`` with an edge."""
    side = other - i
    if not 0 <= other < len(returns):
        outside: bool = side * (window - returns[i, 1]) >= incidence
        return outside
    far = side * (returns[other, 1] - returns[i, 1]) >= incidence
    return bool(apart[max(i, other)] and (far or returns[other, 0] > returns[i, 0]))


def chain_arcs_kernel(returns: FloatArray, bounds: IntArray) -> FloatArray:
    """Arc length (m) from the begin of each chain, (m,), on median-filtered ranges."""
    arc = np.empty(len(returns))
    window = np.empty(MEDIAN)
    total, before = 0.0, 0.0
    for c in range(len(bounds) - 1):
        start = 0.0
        for i in range(bounds[c], bounds[c + 1]):
            r = median(returns, i, bounds[c], bounds[c + 1] - 1, window)
            if i > 0:
                total += stride(before, r, returns[i, 1] - returns[i - 1, 1])
            if i == bounds[c]:
                start = total
            arc[i] = total - start
            before = r
    return arc


def median(returns: FloatArray, i: int, low: int, high: int, window: FloatArray) -> float:
    """The median of the ranges around a return; beyond ``low`` and ``high`` these are repeated.

    ``window``, whose length is the number of ranges, is overwritten with them in order.
    """
    half = len(window) // 2
    for k in range(len(window)):
        r = returns[min(max(i + k - half, low), high), 0]
        place = k
        while place > 0 and window[place - 1] > r:
            window[place] = window[place - 1]
            place -= 1
        window[place] = r
    return float(window[half])


def averages_kernel(
    returns: FloatArray, bounds: IntArray, arc: FloatArray, spacing: float
) -> tuple[FloatArray, IntArray]:
    """Mean points of bins of about ``spacing`` (m) of arc, (k, 2), and the chains' bounds."""
    means = np.zeros((len(returns), 2))
    count = np.zeros(len(returns))
    first = np.zeros(len(bounds), np.int64)
    n = 0
    for c in range(len(bounds) - 1):
        length = arc[bounds[c + 1] - 1]
        bins = max(1, round(length / spacing)) if spacing > 0.0 else 0
        scale = bins / max(length, 1e-12)
        before = -1
        for i in range(bounds[c], bounds[c + 1]):
            slot = min(int(arc[i] * scale), bins - 1) if spacing > 0.0 else i
            if slot != before:
                before = slot
                n += 1
            count[n - 1] += 1.0
            means[n - 1, 0] += returns[i, 2]
            means[n - 1, 1] += returns[i, 3]
        first[c + 1] = n
    for k in range(n):
        means[k, 0] /= count[k]
        means[k, 1] /= count[k]
    return means[:n], first
