"""The values of the factors in a sweep, generated one by one, never all in memory.

In: factors, and how to choose from them. Out: one tuple of values per configuration::

    Design((a in [1, 2], b in [5, 6]))  ->  (1, 5), (1, 6), (2, 5), (2, 6)
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from runtime.experiments.design.factors import Factor

Method = Literal["grid", "random", "sobol"]
BLOCK = 64  # samples drawn at a time; a power of two keeps a Sobol sequence balanced


@dataclass(frozen=True)
class Design:
    """A choice of values for the factors.

    Parameters
    ----------
    factors : what is varied.
    method : all combinations, independent uniform samples, or a scrambled Sobol sequence.
    samples : number of samples; not used by a grid.
    seed : of the samples; equal seeds give equal samples.
    """

    factors: tuple[Factor, ...]
    method: Method = "grid"
    samples: int = 0
    seed: int = 0

    def __len__(self) -> int:
        if self.method != "grid":
            return self.samples
        return math.prod(factor.count for factor in self.factors)

    def __iter__(self) -> Iterator[tuple[Any, ...]]:
        """One value for each factor; the last factor of a grid varies fastest."""
        if self.method == "grid":
            yield from map(self._combination, range(len(self)))
            return
        for row in itertools.islice(self._quantiles(), self.samples):
            yield tuple(factor.at(u) for factor, u in zip(self.factors, row, strict=True))

    def _combination(self, number: int) -> tuple[Any, ...]:
        values = []
        for factor in reversed(self.factors):
            number, i = divmod(number, factor.count)
            values.append(factor.value(i))
        return tuple(reversed(values))

    def _quantiles(self) -> Iterator[Sequence[float]]:
        import numpy as np

        generator = np.random.default_rng(self.seed)
        if self.method == "random":
            while True:
                yield from generator.random((BLOCK, len(self.factors)))
        from scipy.stats import qmc

        sobol = qmc.Sobol(len(self.factors), seed=generator)
        while True:
            yield from sobol.random(BLOCK)
