"""What is compared with what, and the verdict that the numbers give."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from runtime.experiments.analysis.estimates import (
    Estimate,
    PairedDifference,
    is_significant,
)
from runtime.experiments.analysis.statistics import (
    Test,
    benjamini_hochberg,
    difference,
    estimate,
)
from runtime.experiments.design.variants import BASELINE
from tests.studies.ablation.runs import CONFIGURATIONS, PRINTED, RULES, Configuration, Measured

ALONE, APART = "no adaptive part", ", not adaptive"
BARE, EXACT = f"no feedforward{APART}", f"exact feedforward{APART}"
TUNED, TRACKERS = "tuned LQR", ("PID", "PurePursuit", "Stanley")
PARTS = ("no adaptive speed", "no adaptive turn rate", "rate neurons", "integrator")
FAST, FAST_INTEGRATOR = "SNN, twice as fast", "integrator, twice as fast"
MARGIN = 0.1  # a stand-in does as well if it is within this part of the error
HELPS, HURTS, NOT_SIGNIFICANT, EQUAL = "helps", "hurts", "not significant", "equal"
MORE, LESS = "more", "less"
BETTER, WORSE, AS_WELL = "better", "worse", "as well"


@dataclass(frozen=True)
class Metric:
    """What is measured, and how it is written. ``is_error`` is False where more is not worse."""

    name: str
    title: str
    unit: str
    scale: float = 1.0
    digits: int = 3
    is_error: bool = True


METRICS = {
    "A": (
        Metric("position_mae", "mean lateral error", "m"),
        Metric("converged_at", "converged at", "s", digits=1),
    ),
    "B": (
        Metric("position_mae", "mean distance to the path after 10 s", "m"),
        Metric("distance", "progress along the path in 35 s", "m", 1.0, 2, False),
    ),
    "C": (
        Metric("distance_mae", "mean distance error over the whole run", "mm", 1e3, 1),
        Metric("distance_mae_cylinders", "mean distance error along the cylinders", "mm", 1e3, 1),
    ),
}


@dataclass(frozen=True)
class Asked:
    """A question: what becomes of a metric if ``against`` is changed into ``variant``?"""

    configuration: Configuration
    rule: str
    variant: str
    against: str
    metric: Metric


@dataclass(frozen=True)
class Effect:
    """Its answer.

    p : corrected for all questions together. larger : on how many seeds more the value is larger
    than on how many it is smaller.
    """

    asked: Asked
    own: Estimate
    base: Estimate
    apart: PairedDifference
    p: float
    larger: int

    @property
    def is_equal(self) -> bool:
        """Whether nothing differs but rounding."""
        return self.apart.is_equal

    @property
    def is_significant(self) -> bool:
        return not self.is_equal and is_significant(self.p)

    @property
    def is_within_margin(self) -> bool:
        """Whether the whole interval is small beside the error."""
        low, high = self.share[1:]
        return not self.apart.never and low >= -MARGIN and high <= MARGIN

    @property
    def is_more(self) -> bool:
        """The direction: of the typical difference, or of most where some are infinite."""
        return (self.larger if self.apart.never else self.apart.mean) > 0.0

    @property
    def share(self) -> tuple[float, float, float]:
        """The difference and its interval as parts of what it is held against."""
        # By ranks of logarithms it is one already.
        whole = 1.0 if self.apart.scale == "log ranks" else abs(self.base.mean)
        return self.apart.mean / whole, self.apart.low / whole, self.apart.high / whole

    @property
    def verdict(self) -> str:
        """What a change does."""
        if self.is_equal:
            return EQUAL
        if not self.is_significant:
            return NOT_SIGNIFICANT
        if not self.asked.metric.is_error:
            return MORE if self.is_more else LESS
        return HURTS if self.is_more else HELPS

    @property
    def stands_in(self) -> str:
        """How what takes a place does there."""
        if self.is_equal or self.is_within_margin:
            return AS_WELL
        if not self.is_significant:
            return NOT_SIGNIFICANT
        return WORSE if self.is_more else BETTER


Results = Mapping[tuple[Configuration, str], Measured]


def controllers(measured: Measured) -> dict[str, tuple[str, str]]:
    """For each controller the variants with and without the adaptive part; the graph's first."""
    pairs = {BASELINE: (BASELINE, ALONE)}
    for name in measured.values:
        if name.endswith(APART):
            controller = name.removesuffix(APART)
            pairs[controller] = (controller, name)
    return pairs


class Judged:
    """All questions with their answers."""

    def __init__(self, results: Results, test: Test = "auto") -> None:
        self.results = results
        effects = [self._effect(asked, test) for asked in self._asked()]
        corrected = benjamini_hochberg([e.p for e in effects])
        self.effects = {e.asked: replace(e, p=p) for e, p in zip(effects, corrected, strict=True)}

    def __call__(
        self, configuration: Configuration, rule: str, variant: str, against: str, metric: int = 0
    ) -> Effect:
        """An answer; ``metric`` 0 is the error."""
        return self.effects[
            Asked(configuration, rule, variant, against, METRICS[configuration.case][metric])
        ]

    def mean(
        self, configuration: Configuration, rule: str, variant: str, metric: Metric
    ) -> Estimate:
        """A variant's own mean."""
        values = self.results[configuration, rule](variant, metric.name)
        return estimate([value for value in values if value is not None])

    def _asked(self) -> Iterator[Asked]:
        for configuration in CONFIGURATIONS:
            for metric in METRICS[configuration.case]:
                for rule in RULES:
                    measured = self.results[configuration, rule]
                    pairs = controllers(measured)
                    asked = [
                        *pairs.values(),
                        *((part, BASELINE) for part in PARTS if part in measured.values),
                    ]
                    asked += [
                        (FAST, BASELINE),
                        (FAST_INTEGRATOR, BASELINE),
                        (FAST_INTEGRATOR, FAST),
                    ]
                    # Without the adaptive part both rules leave the same graph.
                    if rule == PRINTED:
                        asked += [(a, BARE) for a in (ALONE, EXACT) if a in measured.values]
                    else:
                        asked += [(a, BASELINE) for _, a in pairs.values() if a != ALONE]
                    for variant, against in asked:
                        yield Asked(configuration, rule, variant, against, metric)

    def _effect(self, asked: Asked, test: Test) -> Effect:
        measured, name = self.results[asked.configuration, asked.rule], asked.metric.name
        own, base = measured(asked.variant, name), measured(asked.against, name)
        apart = difference(own, base, test)
        pairs = [(a, b) for a, b in zip(own, base, strict=True) if a is not None and b is not None]
        return Effect(
            asked,
            estimate([v for v in own if v is not None]),
            estimate([v for v in base if v is not None]),
            apart,
            apart.p,
            sum(int(a > b) - int(a < b) for a, b in pairs),
        )
