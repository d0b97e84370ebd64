"""Where a step of a solver ends: at an edge of a source, or where a guard changes its sign.

A guard is a number that is above zero while a condition holds. In go the guards after a step, out
comes whether one of them has been met; the step is then taken again from its start, with lengths
that close in on the time (ITP: Oliveira and Takahashi, ACM TOMS 47, 2020), until the bracket is a
1e-12th of a tick. What a plan does in a tick, ``search[PHASE]`` first::

    LOOK     guards at the time of the tick, without a step: signals may have jumped there
    TAKE     a step to the next edge or tick; its guards; one of them has changed its sign
    NARROW   the same step shorter, ten times or so; the last ends where the guard is met
    FOLLOW   the first step after an event much shorter, and then longer, where the event left the
             guard near zero and it is on the same side afterwards: did it come back in between?
    RETAKE   that step whole, if it did not
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
# the tick; how near the guards were at the last time that was accepted; the time of the tick (s).
PHASE, DONE, END, LOW, HIGH, BELOW, ABOVE, TRIED, WIDTH, ACTED, NEAR, NOW = range(12)
SEARCH = 12
FINISHED, LOOK, TAKE, NARROW, FOLLOW, RETAKE = range(6)
# The rows of ``sides``, each with a number for every guard: the side on which it is; its value
# after its own last event, and before that event acted; when it last passed to above zero, and to
# zero or below; the time between two such passages of one direction, the last ones.
SIDE, LEFT, MET_AT, ROSE, FELL, APART = range(6)
MEMORY = 6
# What ``decided`` returns.
GO_ON, AGAIN, MET, EDGE, RESTLESS = range(5)
# The entries of ``stop``: whether the run was ended, the last distance from the level at a tick,
# the tick and the time at which it ended.
FOUND, BEFORE, TICK, TIME = range(4)
# The end of a search, the first step after a guard was left at exactly zero by its own event, and
# how far apart events are at least that do not come to rest, as shares of a tick.
CLOSE, AWAY, APART_LEAST = 1e-12, 1e-6, 1e-3
MAX_EVENTS = 1000
# A guard whose sign is not known: before the first tick, and after its own event. Times 1 or -1: it
# is still on the side to which its own event brought it, so near that it may be on its way back.
UNKNOWN, FOLLOWED = 2.0, 3.0


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
    search[NOW] = t
    search[END] = next_end(edges, t, 0.0, dt)


def proposed(
    search: FloatArray, sides: FloatArray, edges: FloatArray, t: float, dt: float
) -> float:
    """The length of the next step (s), at most; 0 to look at the guards alone."""
    if search[PHASE] == LOOK:
        return 0.0
    if search[PHASE] >= NARROW:
        return float(search[TRIED])
    if search[DONE] >= search[END]:
        search[END] = next_end(edges, t, search[DONE], dt)
    h = search[END] - search[DONE]
    for j in range(sides.shape[1]):
        # To which side the guard leaves is seen at once, before it could come back.
        if sides[SIDE, j] == 0.0:
            h = min(h, AWAY * dt)
    return float(h)


def beyond(sides: FloatArray, directions: FloatArray, guards: FloatArray, j: int) -> float:
    """How far a guard is on the other side than it was, if that meets it; below zero: not yet."""
    side = sides[SIDE, j]
    if side == 0.0:
        # Its own event left it at exactly zero: it acts again if it goes on as before.
        return float(directions[j] * guards[j]) if directions[j] != 0.0 else -math.inf
    if side == UNKNOWN or side * directions[j] > 0.0:
        return -math.inf
    return float(guards[j]) if side < 0.0 else float(-guards[j])


def nearness(sides: FloatArray, directions: FloatArray, guards: FloatArray) -> float:
    """How near the guards are to being met, the nearest of them: above zero, or 0, if one is."""
    near = -math.inf
    for j in range(sides.shape[1]):
        near = max(near, beyond(sides, directions, guards, j))
    return near


def met(sides: FloatArray, directions: FloatArray, guards: FloatArray, fired: FloatArray) -> bool:
    """Whether a guard is on the other side than it was, in its direction; ``fired`` has which."""
    found = False
    for j in range(sides.shape[1]):
        fired[j] = 0.0
        far = beyond(sides, directions, guards, j)
        # Zero itself belongs to the lower side.
        if far > 0.0 or (far == 0.0 and sides[SIDE, j] > 0.0):
            fired[j] = 1.0
            found = True
    return found


def accept(
    search: FloatArray, sides: FloatArray, guards: FloatArray, fired: FloatArray, h: float
) -> None:
    """Keep the sides on which the guards are; one that its own event left at zero has none yet."""
    t = search[NOW] + search[DONE] + h
    for j in range(sides.shape[1]):
        side, now = sides[SIDE, j], 1.0 if guards[j] > 0.0 else -1.0
        if fired[j] > 0.0:
            row = ROSE if guards[j] > 0.0 else FELL
            sides[APART, j] = t - sides[row, j]
            sides[row, j] = t
            sides[MET_AT, j] = guards[j]
            sides[SIDE, j] = UNKNOWN
        elif guards[j] == 0.0 and h == 0.0 and (side == UNKNOWN or side == 0.0):
            sides[SIDE, j] = 0.0
        elif h == 0.0 and side * now > 2.5:
            sides[SIDE, j] = side  # another block's event acts at the same time
        elif side == UNKNOWN and abs(guards[j]) <= abs(sides[MET_AT, j]):
            sides[LEFT, j] = guards[j]
            sides[SIDE, j] = FOLLOWED * now
        else:
            sides[SIDE, j] = now


def following(sides: FloatArray, guards: FloatArray) -> bool:
    """Whether a guard is still on the side, and near zero, where its own event left it."""
    for j in range(sides.shape[1]):
        if abs(sides[SIDE, j]) > 2.5 and (guards[j] > 0.0) == (sides[SIDE, j] > 0.0):
            return True
    return False


def came_back(sides: FloatArray, guards: FloatArray) -> bool:
    """Whether a guard has left the side on which its own event left it."""
    for j in range(sides.shape[1]):
        if abs(sides[SIDE, j]) > 2.5 and (guards[j] > 0.0) != (sides[SIDE, j] > 0.0):
            return True
    return False


def settled(
    sides: FloatArray, guards: FloatArray, fired: FloatArray, is_last: bool, least: float
) -> float:
    """What following the guards has shown, after a step after which none is on the other side.

    Returns GO_ON if each goes on the way on which it was, AGAIN if some are still as near zero as
    before, RESTLESS if one comes to rest: events without end before it would go on.
    """
    result = float(GO_ON)
    for j in range(sides.shape[1]):
        if abs(sides[SIDE, j]) > 2.5:
            if not is_last and abs(guards[j]) <= 2.0 * abs(sides[LEFT, j]):
                result = float(AGAIN)
            elif sides[APART, j] < least:
                fired[j] = 1.0
                return float(RESTLESS)
            else:
                sides[SIDE, j] = 1.0 if sides[SIDE, j] > 0.0 else -1.0
    return result


def followed(
    search: FloatArray,
    sides: FloatArray,
    guards: FloatArray,
    fired: FloatArray,
    h: float,
    dt: float,
) -> float:
    """Begin or go on to follow guards that their own events left near zero, if none is met yet.

    Returns AGAIN for a step of another length, RESTLESS, or GO_ON if there is nothing to follow.
    """
    close = CLOSE * dt
    if search[PHASE] == TAKE and h > 4.0 * close and following(sides, guards):
        # It may have left its side and come back within this step.
        search[PHASE], search[HIGH], search[TRIED] = FOLLOW, h, 4.0 * close
        return float(AGAIN)
    if search[PHASE] != FOLLOW or came_back(sides, guards):
        return float(GO_ON)
    found = settled(sides, guards, fired, 4.0 * h >= search[HIGH], APART_LEAST * dt)
    if found == RESTLESS:
        return found
    search[TRIED] = 4.0 * h
    if found == GO_ON:
        search[PHASE], search[TRIED] = RETAKE, search[HIGH]
    return float(AGAIN)


def narrowed(search: FloatArray, near: float, is_met: bool, h: float, close: float) -> bool:
    """Begin or go on to narrow a bracket; whether a step of another length is to be tried."""
    if search[PHASE] != NARROW:
        if not is_met or h <= close:
            return False
        search[LOW], search[HIGH], search[WIDTH] = 0.0, h, h
        search[BELOW], search[ABOVE] = search[NEAR], near
        search[PHASE] = NARROW
        search[TRIED] = guess(search, close)
        return True
    if is_met:
        search[HIGH], search[ABOVE] = h, near
    else:
        search[LOW], search[BELOW] = h, near
    if search[HIGH] - search[LOW] > close:
        search[TRIED] = guess(search, close)
        return True
    search[TRIED] = search[HIGH]
    return not is_met


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
    if search[PHASE] == TAKE or not is_met:
        found = followed(search, sides, guards, fired, h, dt)
        if found != GO_ON:
            return found
    if narrowed(search, near, is_met, h, close):
        return float(AGAIN)
    accept(search, sides, guards, fired, h)
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
