"""Where a step of a solver ends: at an edge of a source, or where a guard changes its sign.

A guard is a number that is above zero while a condition holds. In go the guards after a step, out
comes whether one of them has been met; the step is then taken again from its start, with lengths
that close in on the time (ITP: Oliveira and Takahashi, ACM TOMS 47, 2020), until the bracket is a
1e-12th of a tick. What a plan does in a tick, ``search[PHASE]`` first::

    LOOK     guards at the time of the tick, without a step: signals may have jumped there
    TAKE     a step to the next edge or tick; its guards; one of them has changed its sign
    NARROW   the same step shorter, ten times or so; the last ends where the guard is met
    LOOK     the block acts, signals that jump are computed again; are other guards met by that?
    TAKE     the rest of the tick

The functions are shared by both engines: they are compiled as they are.
"""

from __future__ import annotations

import math

from blocks.core import FloatArray

# The entries of ``search``: the phase; the part of the tick that is done (s), and where its next
# step must end; the bracket, as lengths of a step (s), how near the guards are to being met at its
# two ends, the next length that is tried, how wide the bracket is to be by now; the events since
# the tick; how near the guards were at the last time that was accepted.
PHASE, DONE, END, LOW, HIGH, BELOW, ABOVE, TRIED, WIDTH, ACTED, NEAR = range(11)
SEARCH = 11
FINISHED, LOOK, TAKE, NARROW = range(4)
# What ``decided`` returns.
GO_ON, AGAIN, MET, EDGE, RESTLESS = range(5)
# The entries of ``stop``: whether the run was ended, the last distance from the level at a tick,
# the tick and the time at which it ended.
FOUND, BEFORE, TICK, TIME = range(4)
# The end of a search, and the first step after a guard was left at exactly zero by its own event,
# as shares of a tick.
CLOSE, AWAY = 1e-12, 1e-6
MAX_EVENTS = 1000
# A guard whose sign is not known: before the first tick, and after its own event.
UNKNOWN = 2.0


def next_end(edges: FloatArray, t: float, done: float, dt: float) -> float:
    """The time (s) from the tick at t to the first edge after ``done``, at most dt."""
    low, high, now = 0, len(edges), t + done + CLOSE * dt
    while low < high:
        middle = (low + high) // 2
        if edges[middle] <= now:
            low = middle + 1
        else:
            high = middle
    end = edges[low] - t if low < len(edges) else dt
    return float(min(end, dt))


def opened(search: FloatArray, edges: FloatArray, t: float, dt: float) -> None:
    """Begin a tick."""
    search[PHASE] = LOOK
    search[DONE] = 0.0
    search[ACTED] = 0.0
    search[END] = next_end(edges, t, 0.0, dt)


def proposed(
    search: FloatArray, sides: FloatArray, edges: FloatArray, t: float, dt: float
) -> float:
    """The length of the next step (s), at most; 0 to look at the guards alone."""
    if search[PHASE] == LOOK:
        return 0.0
    if search[PHASE] == NARROW:
        return float(search[TRIED])
    if search[DONE] >= search[END]:
        search[END] = next_end(edges, t, search[DONE], dt)
    h = search[END] - search[DONE]
    for j in range(len(sides)):
        # To which side the guard leaves is seen at once, before it could come back.
        if sides[j] == 0.0:
            h = min(h, AWAY * dt)
    return float(h)


def nearness(sides: FloatArray, directions: FloatArray, guards: FloatArray) -> float:
    """How near the guards are to being met, the nearest of them: above zero, or 0, if one is."""
    near = -math.inf
    for j in range(len(sides)):
        if sides[j] * sides[j] == 1.0 and sides[j] * directions[j] <= 0.0:
            near = max(near, -sides[j] * guards[j])
    return near


def met(sides: FloatArray, directions: FloatArray, guards: FloatArray, fired: FloatArray) -> bool:
    """Whether a guard is on the other side than it was, in its direction; ``fired`` has which."""
    found = False
    for j in range(len(sides)):
        fired[j] = 0.0
        is_armed = sides[j] * sides[j] == 1.0 and sides[j] * directions[j] <= 0.0
        if is_armed and (guards[j] > 0.0) != (sides[j] > 0.0):
            fired[j] = 1.0
            found = True
    return found


def accept(sides: FloatArray, guards: FloatArray, fired: FloatArray, moved: bool) -> None:
    """Keep the sides on which the guards are; one that its own event left at zero has none yet."""
    for j in range(len(sides)):
        if fired[j] > 0.0:
            sides[j] = UNKNOWN
        elif guards[j] > 0.0:
            sides[j] = 1.0
        elif guards[j] == 0.0 and not moved and sides[j] * sides[j] != 1.0:
            sides[j] = 0.0
        else:
            sides[j] = -1.0


def decided(
    search: FloatArray,
    sides: FloatArray,
    directions: FloatArray,
    guards: FloatArray,
    fired: FloatArray,
    h: float,
    dt: float,
) -> float:
    """What follows a step of length h: see the codes above.

    ``fired`` are the guards that are met at the time that is accepted.
    """
    near = nearness(sides, directions, guards)
    is_met = met(sides, directions, guards, fired)
    close = CLOSE * dt
    if search[PHASE] == TAKE and is_met and h > close:
        search[LOW], search[HIGH], search[WIDTH] = 0.0, h, h
        search[BELOW], search[ABOVE] = search[NEAR], near
        search[PHASE] = NARROW
        search[TRIED] = guess(search, close)
        return float(AGAIN)
    if search[PHASE] == NARROW:
        if is_met:
            search[HIGH], search[ABOVE] = h, near
        else:
            search[LOW], search[BELOW] = h, near
        if search[HIGH] - search[LOW] > close:
            search[TRIED] = guess(search, close)
            return float(AGAIN)
        if not is_met:
            search[TRIED] = search[HIGH]
            return float(AGAIN)
    accept(sides, guards, fired, h > 0.0)
    search[NEAR] = nearness(sides, directions, guards)
    done = search[DONE] + h
    search[DONE] = search[END] if search[END] - done <= close else done
    if is_met:
        search[PHASE] = LOOK
        search[ACTED] += 1.0
        return float(RESTLESS if search[ACTED] > MAX_EVENTS else MET)
    if h > 0.0 and search[END] < dt and search[DONE] == search[END]:
        search[PHASE] = LOOK
        return float(EDGE)
    search[PHASE] = TAKE if search[DONE] < dt else FINISHED
    return float(GO_ON)


def guess(search: FloatArray, close: float) -> float:
    """The next length in a bracket: a secant, moved to the wider side, never worse than halves."""
    low, high = search[LOW], search[HIGH]
    half, width = 0.5 * (low + high), high - low
    length = half
    change = search[ABOVE] - search[BELOW]
    if change > 0.0 and math.isfinite(change):
        length = low - search[BELOW] / change * width
    towards = 1.0 if half > length else -1.0
    push = max(0.2 * width * width / max(search[WIDTH], width), 0.4 * close)
    length = length + towards * push if push <= abs(half - length) else half
    reach = max(0.0, search[WIDTH] - 0.5 * width)
    search[WIDTH] *= 0.5
    if abs(length - half) > reach:
        length = half - towards * reach
    return float(min(max(length, low), high))


def noted(log: FloatArray, count: FloatArray, fired: FloatArray, t: float) -> None:
    """Append the events of one time to the log: rows of time and guard."""
    for j in range(len(fired)):
        n = int(count[0])
        if fired[j] > 0.0 and n < len(log):
            log[n, 0], log[n, 1] = t, float(j)
            count[0] += 1.0
