"""Experiments in trials: when which item is shown, and the random vectors that items stand for.

In: how long each phase of a trial lasts, and how many items there are. Out: the item and the phase
at each time, and a vector for each item::

    trials: {type: Trials, phases: {show: 0.5, wait: 1.0, recall: 0.5}, items: $n}
    words: {type: Vocabulary, items: $n, dimensions: 16}           # item: trials.out.item
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import final

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Scalar,
    SignalType,
    State,
    Vector,
    param,
)
from blocks.sources.time_tables import Table

MOST_TRIALS = 100_000
MOST_TRIES = 1000
# The components of out that are there with any phases, and their units.
FIXED = {"item": "", "trial": "", "phase": "", "elapsed": "s"}
ELAPSED = list(FIXED).index("elapsed")


@final
class Trials(Table):
    """A schedule of trials: each item in each phase, in order or shuffled.

        [ Trials ] ─▶ out

    out has the components ``item``, ``trial`` and ``phase``, each counted from 0, ``elapsed``, the
    time since the phase began, and one by the name of each phase, which is 1 during it and 0
    otherwise: ``trials.out.train`` is wired to an input ``learn``. By item, each goes through all
    phases before the next one does:

        show 0, wait 0, recall 0, show 1, wait 1, recall 1, ...

    and by phase, all items go through one phase before the next phase begins:

        train 0, train 1, ..., train 0, train 1, ..., wait, test 0, test 1, ...

    A phase of 0 rounds is there once and without an item, as is the time after the last trial:
    ``item`` is then -1. A shuffled order is drawn anew for each round, and by item for all phases
    of a trial together.
    """

    phases: Mapping[str, float] = param(doc="length of each phase of a trial, s: {show: 0.5}")
    number: int = param(name="items", at_least=1, doc="number of items")
    rounds: FloatArray = param(
        1.0, shape=[(), (None,)], at_least=0.0, doc="times that all items are gone through"
    )
    by: str = param("item", choices=("item", "phase"), doc="what is gone through first")
    order: str = param("fixed", choices=("fixed", "shuffled"), doc="of the items in a round")

    def validate(self) -> None:
        problems = []
        for name, seconds in self.phases.items():
            if not (math.isfinite(seconds) and seconds > 0.0):
                problems.append((f"phases.{name}", f"expected a time above 0 s, got {seconds:g}"))
            if name in FIXED or not name.isidentifier():
                message = f"'{name}' cannot name a phase; use letters, digits and _, and not "
                problems.append((f"phases.{name}", f"{message}{', '.join(FIXED)}"))
        if not self.phases:
            problems.append(("phases", "expected at least one, as in {show: 0.5}"))
        rounds = self.rounds
        if rounds.ndim and self.by == "item":
            problems.append(("rounds", "by item, all phases have the same rounds; give one number"))
        elif rounds.ndim and len(rounds) != len(self.phases):
            message = f"expected one number, or {len(self.phases)}, one per phase"
            problems.append(("rounds", f"{message}, got {len(rounds)}"))
        elif (rounds % 1.0).any() or (self.by == "item" and not rounds):
            problems.append(("rounds", f"expected whole numbers, got {rounds.tolist()}"))
        elif float(rounds.sum()) * self.number * len(self.phases) > MOST_TRIALS:
            problems.append(("rounds", f"expected at most {MOST_TRIALS} phases of trials in all"))
        if problems:
            raise ParameterError(problems)

    @cached_property
    def _shown(self) -> list[tuple[int, int, int, int]]:
        """Round, place in the round, trial and phase of each part of the schedule; round -1 of a
        phase without items."""
        count, names = self.number, range(len(self.phases))
        rounds = np.broadcast_to(self.rounds, len(names)).astype(int).tolist()
        if self.by == "item":
            trials = ((r, i) for r in range(rounds[0]) for i in range(count))
            return [(r, i, trial, p) for trial, (r, i) in enumerate(trials) for p in names]
        shown, trial, before = [], 0, 0
        for phase, times in enumerate(rounds):
            if not times:
                shown.append((-1, 0, trial, phase))
                trial += 1
            for r in range(before, before + times):
                shown += [(r, i, trial + i, phase) for i in range(count)]
                trial += count
            before += times
        return shown

    @cached_property
    def rows(self) -> tuple[FloatArray, FloatArray]:
        lengths = list(self.phases.values())
        # Summed without rounding: the time of the last trial must not depend on how many there are.
        times = [0.0]
        total = 0.0
        for _, _, _, phase in self._shown:
            total = math.fsum((total, lengths[phase]))
            times.append(total)
        return np.array(times), self._values(None)

    def _values(self, rng: np.random.Generator | None) -> FloatArray:
        """The rows of out, with the items in their order, or in one that is drawn."""
        values = np.zeros((len(self._shown) + 1, len(FIXED) + len(self.phases)))
        values[-1, :3] = -1.0, self._shown[-1][2] + 1.0, -1.0
        last = max(r for r, *_ in self._shown)
        orders = [np.arange(self.number) for _ in range(last + 1)]
        if rng is not None:
            orders = [rng.permutation(self.number) for _ in orders]
        for row, (r, place, trial, phase) in zip(values, self._shown, strict=False):
            row[:3] = -1.0 if r < 0 else orders[r][place], trial, phase
            row[len(FIXED) + phase] = 1.0
        return values

    @property
    def how(self) -> str:
        return "hold"

    @property
    def stated(self) -> SignalType:
        names = FIXED | dict.fromkeys(self.phases, "")
        return replace(Vector(len(names)), rows=tuple(names.items()))

    @property
    def stepwise(self) -> bool:
        return False  # the time that has elapsed moves between two ticks

    def start(self, state: BlockState) -> None:
        super().start(state)
        if self.order == "shuffled":
            values = self._values(state.rng)
            state.table[:, 0], state.last[:] = values[:-1], values[-1]
        state.table[:, 1, ELAPSED] = 1.0


@final
class Vocabulary(Block):
    """Random vectors of length 1, one for each item: what symbols are in a network.

        item, input ─▶ [ Vocabulary ] ─▶ vector, similarity, nearest

    vector      that of the item, an integer from 0 on; 0 for a negative one, which is no item
    similarity  the scalar products of ``input`` with the vectors of all items
    nearest     the item whose vector has the largest scalar product with ``input``

    Directions are drawn evenly from the sphere. With ``separation``, those whose scalar product
    with an earlier one is larger in size are drawn again. What is drawn depends on the seed and
    the block's name: with a ``seed`` of its own, the same vectors meet many draws of neurons.
    """

    item = Input(Scalar, default=-1.0, doc="number of the item, from 0; negative for none")
    compared = Input(Vector("d"), name="input", default=0.0, doc="what is compared")
    vector = Output(Vector("d"), doc="vector of the item")
    similarity = Output(Vector("n"), doc="scalar products with all items")
    nearest = Output(Scalar, doc="the item with the largest scalar product")

    number: int = param(name="items", at_least=1, doc="number of items n")
    dimensions: int = param(at_least=1, doc="length d of the vectors")
    separation: float = param(
        1.0, above=0.0, at_most=1.0, doc="largest size of a scalar product of two items"
    )

    vectors = State("n", "d", doc="a vector per row")

    def sizes(self) -> dict[str, int]:
        held = self.__dict__
        sizes = {"n": self.number} if "number" in held else {}
        return {**sizes, "d": self.dimensions} if "dimensions" in held else sizes

    def validate_in(self, context: BlockContext) -> None:
        self._drawn(np.random.default_rng(0))

    def _drawn(self, rng: np.random.Generator) -> FloatArray:
        vectors = np.zeros((self.number, self.dimensions))
        for i in range(self.number):
            for _ in range(MOST_TRIES):
                vector = rng.standard_normal(self.dimensions)
                vector /= math.sqrt(float(np.add.reduce(vector * vector)))
                others = np.add.reduce(vectors[:i] * vector, 1)
                if not i or float(np.abs(others).max()) <= self.separation:
                    break
            else:
                message = f"after {i} items none of {MOST_TRIES} further directions is that far "
                message += "from all of them; expected a larger one, or more dimensions"
                raise ParameterError([("separation", message)], type(self).__name__)
            vectors[i] = vector
        return vectors

    def start(self, state: BlockState) -> None:
        state.vectors[...] = self._drawn(state.rng)

    def output_vector(self, state: BlockState, t: float, item: float) -> FloatArray:
        out = np.zeros(state.vectors.shape[1])
        i = math.floor(item + 0.5)
        if i >= len(state.vectors):
            raise ValueError("item is beyond the last one of the vocabulary")
        if i >= 0:
            for j in range(len(out)):
                out[j] = state.vectors[i, j]
        return out

    def output_similarity(self, state: BlockState, t: float, input: FloatArray) -> FloatArray:
        out = np.zeros(len(state.vectors))
        for i in range(len(out)):
            for j in range(len(input)):
                out[i] += state.vectors[i, j] * input[j]
        return out

    def output_nearest(self, state: BlockState, t: float, input: FloatArray) -> float:
        best, at = -math.inf, 0
        for i in range(len(state.vectors)):
            total = 0.0
            for j in range(len(input)):
                total += state.vectors[i, j] * input[j]
            if total > best:
                best, at = total, i
        return float(at)
