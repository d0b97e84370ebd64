"""Which settings of the knobs a sweep tries, one after the other, never all at once in memory."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from runtime.experiments.knobs import Knob

Method = Literal["grid", "random", "sobol"]
BLOCK = 64  # samples drawn at a time; a power of two keeps Sobol's points balanced


@dataclass(frozen=True)
class Design:
    """A way through the space of the knobs.

    Parameters
    ----------
    knobs : the axes.
    method : all combinations, independent uniform samples, or a scrambled Sobol sequence.
    samples : how many, unless all combinations.
    seed : of the samples; the same one gives the same settings.
    """

    knobs: tuple[Knob, ...]
    method: Method = "grid"
    samples: int = 0
    seed: int = 0

    def __len__(self) -> int:
        if self.method != "grid":
            return self.samples
        return math.prod(knob.count for knob in self.knobs)

    def __iter__(self) -> Iterator[tuple[Any, ...]]:
        """One value for each knob; the last knob of a grid turns fastest."""
        if self.method == "grid":
            yield from map(self._combination, range(len(self)))
            return
        for row in itertools.islice(self._quantiles(), self.samples):
            yield tuple(knob.at(u) for knob, u in zip(self.knobs, row, strict=True))

    def _combination(self, number: int) -> tuple[Any, ...]:
        values = []
        for knob in reversed(self.knobs):
            number, i = divmod(number, knob.count)
            values.append(knob.value(i))
        return tuple(reversed(values))

    def _quantiles(self) -> Iterator[Sequence[float]]:
        import numpy as np

        generator = np.random.default_rng(self.seed)
        if self.method == "random":
            while True:
                yield from generator.random((BLOCK, len(self.knobs)))
        from scipy.stats import qmc

        sobol = qmc.Sobol(len(self.knobs), seed=generator)
        while True:
            yield from sobol.random(BLOCK)
