"""Step 6 of the layered layout, in one channel: the vertical tracks of its wires, without overlaps.

In: tracks, with the heights at which they are joined from the left and from the right. Out: a slot
for each, counted from the left. Wires that never meet share a slot::

    a: height 10 ─▶ 50      a begins at the height at which b ends, so a's track must be left of
    b: height 70 ─▶ 10      b's: else their horizontal lines at 10 would lie on each other
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

CLEAR = 6.0
STRAIGHT = 0.05


@dataclass
class Track:
    """A vertical segment of one wire, between horizontal segments on its left and right.

    ``slot`` counts the tracks of a channel from the left. A wire that would overlap another one
    takes two tracks: ``then`` is its second one.
    """

    lefts: list[float]
    rights: list[float]
    slot: int = 0
    then: Track | None = field(default=None, repr=False)

    @property
    def top(self) -> float:
        return min(*self.lefts, *self.rights, float("inf"))

    @property
    def bottom(self) -> float:
        return max(*self.lefts, *self.rights, float("-inf"))

    @property
    def is_straight(self) -> bool:
        return self.bottom - self.top < STRAIGHT


def assign_slots(tracks: Sequence[Track]) -> int:
    """Assign a slot to every track of a channel; returns the number of slots."""
    bent = [track for track in tracks if not track.is_straight]
    bent, rules = _without_cycles(bent, [y for t in tracks for y in (*t.lefts, *t.rights)])
    earlier: list[int] = []
    for i in _in_order(bent, rules):
        track = bent[i]
        slots = [
            bent[k].slot
            for k in earlier
            if (k, i) in rules
            or (bent[k].top < track.bottom + CLEAR and track.top < bent[k].bottom + CLEAR)
        ]
        track.slot = max(slots, default=-1) + 1
        earlier.append(i)
    return max((track.slot for track in bent), default=-1) + 1


def _rules(tracks: Sequence[Track]) -> set[tuple[int, int]]:
    """Pairs (i, k) where i must be left of k, or their horizontal segments would overlap."""

    def is_before(one: Track, other: Track) -> bool:
        if one.then is other or other.then is one:
            return one.then is other
        return any(abs(a - b) < CLEAR for a in one.lefts for b in other.rights)

    return {
        (i, k)
        for i, one in enumerate(tracks)
        for k, other in enumerate(tracks)
        if i != k and is_before(one, other)
    }


def _without_cycles(
    tracks: list[Track], heights: list[float]
) -> tuple[list[Track], set[tuple[int, int]]]:
    """Split wires over two tracks until the rules have no cycle."""
    import networkx as nx

    tracks, whole = list(tracks), set(range(len(tracks)))
    rules = _rules(tracks)
    # "a left of b" and "b left of a" can both be required, where two wires swap their heights. One
    # of them then takes two tracks with a free height between: a detour, but readable.
    while not nx.is_directed_acyclic_graph(nx.DiGraph(sorted(rules))):
        cycle = nx.find_cycle(nx.DiGraph(sorted(rules)))
        splittable = [i for i, _ in cycle if i in whole and tracks[i].lefts and tracks[i].rights]
        if not splittable:
            # There is no room for a detour: two lines may touch.
            rules -= set(cycle)
            continue
        # The longest has the most heights to choose from.
        i = max(splittable, key=lambda i: (tracks[i].bottom - tracks[i].top, i))
        whole.discard(i)
        first = tracks[i]
        middle = _free_height(first, heights)
        heights = [*heights, middle]
        first.then = Track([middle], first.rights)
        first.rights = [middle]
        tracks.append(first.then)
        rules = _rules(tracks)
    return tracks, rules


def _free_height(track: Track, heights: Sequence[float]) -> float:
    """A height within a track's range, near its middle, that is clear of all others."""
    middle, reach = (track.top + track.bottom) / 2, (track.bottom - track.top) / 2
    candidates = [middle]
    for step in range(1, int(reach) + 1):
        candidates += [middle + step, middle - step]
    # Clear is clear: of all heights with enough room, the one nearest to the middle (the first) is
    # taken.
    room = {y: min(CLEAR, min(abs(y - other) for other in heights)) for y in candidates}
    return max(candidates, key=room.__getitem__)


def _crossings(left: Track, right: Track) -> int:
    """The number of crossings of two wires if ``left`` is left of ``right``."""
    return sum(left.top < y < left.bottom for y in right.lefts) + sum(
        right.top < y < right.bottom for y in left.rights
    )


# A topological order by the rules, in which the wire that crosses the others least as the leftmost
# is taken first; neighbours are swapped afterwards, since a greedy choice can be wrong by one
# place.
def _in_order(tracks: Sequence[Track], rules: set[tuple[int, int]]) -> list[int]:
    """Indices of tracks from left to right, by the rules and so that few wires cross."""
    count = range(len(tracks))
    gain = [
        [_crossings(tracks[k], tracks[i]) - _crossings(tracks[i], tracks[k]) for k in count]
        for i in count
    ]
    before = {k: {i for i, other in rules if other == k} for k in count}
    order: list[int] = []
    rest = list(count)
    while rest:
        ready = [i for i in rest if not before[i] & set(rest)]
        leftmost = max(ready, key=lambda i: (sum(gain[i][k] for k in rest), tracks[i].top, -i))
        order.append(leftmost)
        rest.remove(leftmost)
    _improve(order, gain, rules)
    return order


def _improve(order: list[int], gain: list[list[int]], rules: set[tuple[int, int]]) -> None:
    """Swap neighbours while that reduces the crossings and violates no rule."""
    for _ in order:
        has_swapped = False
        for at, (i, k) in enumerate(pairwise(list(order))):
            if order[at] == i and gain[i][k] < 0 and (i, k) not in rules:
                order[at], order[at + 1] = k, i
                has_swapped = True
        if not has_swapped:
            return
