"""Blocks that count their ticks in memory of every kind, for tests of what copies it."""

from __future__ import annotations

import functools
import io
import logging
from collections import deque
from typing import Any

import numpy as np

from blocks import Block, Input, Output, Scalar, State, param

TOTAL, LOG = 0.0, [0.0]
LOGGER = logging.getLogger(__name__)


class Helper:
    """Adds to an array that it was given."""

    __slots__ = ("array", "times")

    def __init__(self, array: Any) -> None:
        self.array, self.times = array, 0

    def add(self, q: float) -> float:
        self.array[0] += q
        self.times += 1
        return float(self.times)


def counter() -> Any:
    total = [0.0]
    times = 0.0

    def add(q: float) -> float:
        nonlocal times
        times += q
        total[0] += q
        return max(total[0], times)

    return add


def positions() -> Any:
    k = 0.0
    while True:
        k += 1.0
        yield k


def add_default(q: float, total: Any = [0.0]) -> float:  # noqa: B006 -- memory that is tested
    total[0] += q
    return float(total[0])


def add_global(q: float) -> float:
    global TOTAL
    TOTAL += q
    return TOTAL


class Counts(Block):
    """The number of its ticks, in memory of one kind."""

    x = Input(Scalar)
    out = Output(Scalar)

    kind: str = param("declared", doc="of memory")

    y = State()
    h = State(4)

    total = [0.0]  # noqa: RUF012 -- memory that is tested
    number = 0.0

    def start(self, state: Any) -> None:
        global TOTAL
        if self.kind in ("generator", "file"):
            state.kept = positions() if self.kind == "generator" else io.StringIO("a line\n" * 99)
        TOTAL = self.total[0] = LOG[0] = type(self).number = 0.0
        add_default.__defaults__[0][0] = 0.0  # type: ignore[index]
        vars(self)["own"] = [0.0]
        state.logger = LOGGER  # which cannot be copied, and needs not be
        apart = np.zeros(4)
        made = {
            "list": lambda: [state.h[:2], state.h[2:]],
            "dict": lambda: {"a": {"b": state.h[::-2]}},
            "tuple": lambda: (state.h[1:2], [state.h[:1]]),
            "helper": lambda: Helper(state.h[:2]),
            "bound": lambda: Helper(state.h[:2]).add,
            "partial": lambda: functools.partial(Helper(state.h[2:]).add, 1.0),
            "closure": counter,
            "append": lambda: [].append,
            "two views": lambda: [apart[:2], apart[::-1], Helper(apart)],
            "of state": lambda: {"state": state},
            "rng": lambda: {"draws": state.rng},
            "nested rng": lambda: [np.random.default_rng(3)],
            "deque": lambda: deque([0.0], maxlen=3),
        }
        if self.kind in made:
            state.kept = made[self.kind]()

    def output(self, state: Any, t: float) -> float:
        return float(state.y)

    def update(self, state: Any, t: float, x: float) -> None:
        assert state.logger is LOGGER
        LOGGER.debug("a tick")
        state.y = float(getattr(self, "_" + self.kind.replace(" ", "_"))(state))

    def _declared(self, state: Any) -> Any:
        return state.y + 1.0

    def _list(self, state: Any) -> Any:
        for part in state.kept:
            part += 1.0
        return state.h[3]

    def _dict(self, state: Any) -> Any:
        state.kept["a"]["b"][0] += 1.0
        return state.h[3]

    def _tuple(self, state: Any) -> Any:
        state.kept[0][0] += 1.0
        state.kept[1][0][0] += 1.0
        return max(state.h[0], state.h[1])

    def _helper(self, state: Any) -> Any:
        return max(state.kept.add(1.0), state.h[0])

    def _bound(self, state: Any) -> Any:
        return max(state.kept(1.0), state.h[0])

    def _partial(self, state: Any) -> Any:
        return max(state.kept(), state.h[2])

    def _closure(self, state: Any) -> Any:
        return state.kept(1.0)

    def _append(self, state: Any) -> Any:
        state.kept(1.0)
        return len(state.kept.__self__)

    def _two_views(self, state: Any) -> Any:
        first, reverse, helper = state.kept
        first[0] += 0.5
        reverse[-1] += 0.25
        helper.add(0.25)
        return first[0]

    def _of_state(self, state: Any) -> Any:
        state.kept["state"].h[0] += 1.0
        return state.h[0]

    def _rng(self, state: Any) -> Any:
        return state.y + 1.0 + 1e-9 * state.kept["draws"].random()

    def _nested_rng(self, state: Any) -> Any:
        return state.y + 1.0 + 1e-9 * state.kept[0].random()

    def _deque(self, state: Any) -> Any:
        state.kept.append(state.kept[-1] + 1.0)
        return state.kept[-1]

    def _class_list(self, state: Any) -> Any:
        self.total[0] += 1.0
        return self.total[0]

    def _class_number(self, state: Any) -> Any:
        type(self).number += 1.0
        return self.number

    def _global(self, state: Any) -> Any:
        return add_global(1.0)

    def _global_list(self, state: Any) -> Any:
        LOG[0] += 1.0
        return LOG[0]

    def _default(self, state: Any) -> Any:
        return add_default(1.0)

    def _self(self, state: Any) -> Any:
        vars(self)["own"][0] += 1.0
        return vars(self)["own"][0]

    def _generator(self, state: Any) -> Any:
        return next(state.kept)

    def _file(self, state: Any) -> Any:
        state.kept.readline()
        return state.y + 1.0


COPIED = ("list", "dict", "tuple", "helper", "bound", "partial", "closure", "append", "two views")
COPIED += ("of state", "rng", "nested rng", "deque")
SHARED = ("class list", "class number", "global", "global list", "default", "self")
NOT_COPIED = ("generator", "file")


class Fails(Block):
    """Compiled, and an integer outgrows 64 bits late in the run: Python goes on."""

    x = Input(Scalar)
    out = Output(Scalar)
    n = State()

    def output(self, state: Any, t: float) -> float:
        return float(state.n) * 0.0

    def update(self, state: Any, t: float, x: float) -> None:
        state.n += 1
        k = int(state.n)
        if k > 40:
            state.n = float((k * 10**18) // 10**18)


class Compiled(Block):
    """Compiled, and compared with its Python form."""

    x = Input(Scalar)
    out = Output(Scalar)
    n = State()

    def output(self, state: Any, t: float) -> float:
        return float(state.n)

    def update(self, state: Any, t: float, x: float) -> None:
        state.n += x
