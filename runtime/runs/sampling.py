"""The loop that sampled blocks close around continuous states, in discrete time.

In: a :class:`runtime.engine.Point` and the steps of its sampled blocks. Out: the exact linear map
from one period to the next. For x' = a x + w and w = k x at every tick of T:
x(t + T) = (e^(aT) + k (e^(aT) - 1) / a) x(t).

A period is a sequence of ticks and of times between them. A tick is a linear map of all columns
(x, z, w), by differences; between two ticks x follows the matrix exponential, with w and u held
(Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998, section 4.3).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from blocks.core import FloatArray, jacobian
from runtime.engine import Point
from runtime.errors import UsageError
from runtime.network import Network, enables_of
from runtime.plan import Port

Step = tuple[int, int]  # of a block, and its offset, in base ticks
MOST_TICKS = 20_000  # of sampled blocks in one period
MOST_NUMBERS = 2_000  # states and held signals


@dataclass(frozen=True)
class Structure:
    """Which blocks a linearization takes part of, found from the wires.

    sampled : the sampled blocks between the states and inputs, and the states and outputs.
    held : other blocks that act on these and vary with time, or switch: they are held constant.
    steps : the steps of the sampled blocks, with their offsets, in base ticks.
    period : base ticks after which they act as before; 0 if there are none.
    """

    sampled: tuple[str, ...]
    held: tuple[str, ...]
    steps: frozenset[Step]
    period: int


def structure_of(network: Network, driven: Collection[Port], watched: Collection[str]) -> Structure:
    """What takes part; ``driven`` are inputs, and outputs that drive; ``watched`` are blocks.

    Raises
    ------
    UsageError : the least common period of the sampled blocks is too long.
    """
    entries = network.entries
    wires = [((w.source.block, w.source.port), w.block) for w in network.driving]
    fed = {block for _, block in wires}
    continuous = {name for name, entry in entries.items() if entry.cls.spec.continuous}
    memories = {n for n in fed if entries[n].cls.spec.update and _memory(network, n)}
    begin = continuous | memories
    for block, port in driven:
        if port in entries[block].cls.spec.inputs:
            begin.add(block)
        else:
            begin |= {reader for source, reader in wires if source == (block, port)}
    wanted = continuous | set(watched) or memories
    reached = _closure(begin, ((source[0], reader) for source, reader in wires))
    # A switch acts on the blocks of its part without a wire; it has no slope to either side.
    switching = [(name, each) for name, above in enables_of(network).items() for each in above]
    back = [*((reader, source[0]) for source, reader in wires), *switching]
    before = _closure(wanted, back)
    switches = {switch for _, switch in switching} | {n for n in reached if network.holds(n)}
    holding = {n for n, e in entries.items() if not (n in continuous or e.is_memoryless)}
    sampled = (reached & before & holding) - switches
    drives = {block for block, _ in driven}
    held = {n for n in before - reached - drives if _varies(network, n)} | (switches & before)
    steps = frozenset((entries[name].every, entries[name].offset) for name in sampled)
    period = math.lcm(*(every for every, _ in steps)) if steps else 0
    if period and _count(steps, period) > MOST_TICKS:
        text = ", ".join(f"{network.dt * every:g}" for every, _ in sorted(steps))
        raise UsageError(
            f"the sampled blocks act together every {network.dt * period:g} {network.time_unit} "
            f"only ({text} {network.time_unit}), with more than {MOST_TICKS} ticks in between; "
            "give them steps that are multiples of each other"
        )
    return Structure(tuple(sorted(sampled)), tuple(sorted(held)), steps, period)


def _memory(network: Network, name: str) -> bool:
    states = network.entries[name].cls.spec.states.values()
    return any(not (each.cached or each.event or each.continuous) for each in states)


def _varies(network: Network, name: str) -> bool:
    """Whether a block's outputs change by themselves, from tick to tick or with time."""
    entry = network.entries[name]
    calls = [each for each in entry.evaluations if not entry.cls.spec.is_constant(each)]
    return bool(calls) and (entry.cls.spec.update is not None or any(c.timed for c in calls))


def _closure(begin: Iterable[str], edges: Iterable[tuple[str, str]]) -> set[str]:
    """What edges lead to."""
    following: dict[str, list[str]] = {}
    for a, b in edges:
        following.setdefault(a, []).append(b)
    found, waiting = set[str](), list(begin)
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += following.get(name, ())
    return found


def _count(steps: Collection[Step], period: int) -> int:
    """The ticks of a period on which something acts, at most."""
    return sum(period // every for every, _ in steps)


def _ticks(steps: Collection[Step], period: int) -> list[int]:
    """The first tick of a period, at which outputs are read, and all on which something acts."""
    return sorted({0, *(k for every, offset in steps for k in range(offset, period, every))})


def _acting(steps: Collection[Step], k: int) -> frozenset[Step]:
    return frozenset((every, offset) for every, offset in steps if (k - offset) % every == 0)


@dataclass(frozen=True)
class Loose:
    """An entry whose differences disagree: what of what, and the slopes from both sides."""

    of: str
    by: str
    below: float
    above: float


@dataclass(frozen=True)
class Matrices:
    """A linear system of all columns, or of the continuous states.

    ``drift`` is the change of each state by itself: its rate, or that in one period.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray
    drift: FloatArray
    y: FloatArray
    loose: tuple[Loose, ...]


class Linear:
    """The maps of a point: between ticks, and at ticks.

    Parameters
    ----------
    columns : the numbers (x, z, w) at the operating point. u : the inputs there.
    inputs, outputs : labels.
    """

    def __init__(
        self,
        point: Point,
        columns: FloatArray,
        u: FloatArray,
        inputs: Sequence[str],
        outputs: Sequence[str],
    ) -> None:
        if len(columns) > MOST_NUMBERS:
            raise UsageError(
                f"the states and held signals are {len(columns)} numbers, more than {MOST_NUMBERS}"
            )
        self.point, self.columns, self.u = point, columns, u
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        self.loose: dict[tuple[str, str], Loose] = {}

    def continuous(self) -> Matrices:
        """x' = A x + B u, y = C x + D u, with sampled blocks held."""
        n = self.point.sizes[0]
        by_x, by_u, rates, y = self._flow(n)
        loose = tuple(self.loose.values())
        return Matrices(by_x[:n], by_u[:n], by_x[n:], by_u[n:], rates, y, loose)

    def sampled(self, steps: Collection[Step], period: int) -> Matrices:
        """The map over one period of all columns, by the ticks of sampled blocks."""
        size, m = len(self.columns), len(self.u)
        a, b = np.eye(size), np.zeros((size, m + 1))
        at_tick: dict[frozenset[Step], tuple[FloatArray, FloatArray, FloatArray]] = {}
        between: dict[int, tuple[FloatArray, FloatArray]] = {}
        ticks = _ticks(steps, period)
        for k, following in zip(ticks, [*ticks[1:], period], strict=True):
            acting = _acting(steps, k)
            if acting not in at_tick:
                # Not tick 0, at which blocks that act later show their output of the start.
                at_tick[acting] = self._tick(k + period)
            if following - k not in between:
                between[following - k] = self._between(following - k)
            by_columns, by_u, _ = at_tick[acting]
            for map_a, map_b in ((by_columns[:size], by_u[:size]), between[following - k]):
                a, b = map_a @ a, map_a @ b + map_b
        by_columns, by_u, y = at_tick[_acting(steps, 0)]
        c, d = by_columns[size:], by_u[size:, :m]
        return Matrices(a, b[:, :m], c, d, b[:, m], y, tuple(self.loose.values()))

    def _flow(self, width: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Rates above outputs: by the first columns and by u, and their values."""

        def function(v: FloatArray) -> FloatArray:
            whole = self.columns.copy()
            whole[:width] = v[:width]
            return np.concatenate(self.point.flow(whole, v[width:]))

        n = self.point.sizes[0]
        rows = [f"{name}'" for name in self.point.columns[:n]]
        by, here = self._jacobian(function, width, [*rows, *self.outputs])
        return by[:, :width], by[:, width:], here[:n], here[n:]

    def _tick(self, k: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Columns after a tick above outputs: by columns, and by u and 1."""
        size = len(self.columns)

        def function(v: FloatArray) -> FloatArray:
            return np.concatenate(self.point.tick(k, v[:size], v[size:]))

        by, here = self._jacobian(function, size, [*self.point.columns, *self.outputs])
        moved = np.concatenate([here[:size] - self.columns, np.zeros(len(self.outputs))])
        return by[:, :size], np.column_stack([by[:, size:], moved]), here[size:]

    def _jacobian(
        self, function: object, width: int, rows: Sequence[str]
    ) -> tuple[FloatArray, FloatArray]:
        point = np.concatenate([self.columns[:width], self.u])
        matrix, unsettled = jacobian(function, point)  # type: ignore[arg-type]
        columns = [*self.point.columns[:width], *self.inputs]
        for each in unsettled:
            of, by = rows[each.row], columns[each.column]
            self.loose.setdefault((of, by), Loose(of, by, each.below, each.above))
        return matrix, function(point)  # type: ignore[operator]

    def _between(self, ticks: int) -> tuple[FloatArray, FloatArray]:
        """The map of all columns over some ticks without a sampled block, and of u and 1."""
        n, size, m = self.point.sizes[0], len(self.columns), len(self.u)
        a, b = np.eye(size), np.zeros((size, m + 1))
        if n:
            by_columns, by_u, rates, _ = self._flow_of_all
            whole = np.column_stack([by_columns[:n], by_u[:n], rates])
            # Columns without effect would only make the exponential larger.
            acting = np.flatnonzero(whole[:, n:].any(axis=0)) + n
            moved = exponential(
                whole[:, [*range(n), *acting]], ticks * self.point.engine.network.dt
            )
            full = np.zeros((n, size + m + 1))
            full[:, [*range(n), *acting]] = moved
            a[:n], b[:n] = full[:, :size], full[:, size:]
        return a, b

    @property
    def _flow_of_all(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        if not hasattr(self, "_all"):
            self._all = self._flow(len(self.columns))
        return self._all


def exponential(rows: FloatArray, time: float) -> FloatArray:
    """[e^(A t), integral of e^(A s) ds B] of rows [A, B] (n, n + m): what B multiplies is held."""
    from scipy.linalg import expm

    n, width = rows.shape
    square = np.zeros((width, width))
    square[:n] = rows * time
    return np.asarray(expm(square)[:n], dtype=np.float64)


def minimal(system: Matrices, fixed: int) -> tuple[list[int], list[int]]:
    """The columns that are states of a sampled system, and those left out since they change nothing
    that is kept. Columns that keep their value are left out as well.

    The first ``fixed`` columns, continuous states, are always states.
    """
    size = len(system.a)
    kept, without = np.ones(size, dtype=bool), np.zeros(size, dtype=bool)
    linked = system.a != 0.0
    np.fill_diagonal(linked, False)
    moved = system.b.any(axis=1) | (system.drift != 0.0)
    still = np.abs(np.diag(system.a) - 1.0) < 1e-12
    while True:
        inside = linked & kept[:, None] & kept
        has_effect = inside.any(axis=0) | system.c.any(axis=0)
        alone = still & ~moved & ~inside.any(axis=1)
        leaving = kept & (~has_effect | alone) & (np.arange(size) >= fixed)
        if not leaving.any():
            return np.flatnonzero(kept).tolist(), np.flatnonzero(without).tolist()
        without |= leaving & ~has_effect & ~alone
        kept &= ~leaving
