"""The optimiser that asks for configurations: optuna's samplers, by ask and tell.

In: factors and what configurations cost. Out: the configurations to try next::

    ask(2)  ->  (0.31,), (0.77,);  tell(first, costs=[2.0], violations=[-0.1])
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from blocks.core import MissingPackageError, require
from runtime.errors import MissingExtraError
from runtime.experiments.design import Factor, Range, TuningSettings

DIGITS = 4  # of values that are tried, so that a winner can be written by hand
PENALTY = 1e12  # a cost that is worse than any; samplers compare costs, they do not add them
STARTUP = 10  # random configurations before TPE fits its model; optuna's own default
EXTRA = "tune"


@dataclass(frozen=True)
class Suggestion:
    """A configuration that the optimiser asks for: a value for each factor."""

    values: tuple[Any, ...]
    handle: Any


class Optimizer:
    """Asks for configurations, a batch at a time, and learns from their costs.

    Equal settings and equal results give equal configurations.

    Raises
    ------
    MissingExtraError : optuna is not installed.
    """

    def __init__(self, factors: Sequence[Factor], tuning: TuningSettings) -> None:
        self.factors = factors
        self._optuna = _optuna()
        self._optuna.logging.set_verbosity(self._optuna.logging.ERROR)
        self._space = {factor.path: self._distribution(factor) for factor in factors}
        self._violations: dict[int, Sequence[float]] = {}
        with warnings.catch_warnings():
            # Of experimental samplers, and of a way to give constraints that optuna 7 removes.
            warnings.simplefilter("ignore")
            self._study = self._optuna.create_study(
                directions=["minimize"] * len(tuning.objectives), sampler=self._sampler(tuning)
            )

    def _sampler(self, tuning: TuningSettings) -> Any:
        samplers = self._optuna.samplers
        constraints = {"constraints_func": self._violations_of} if tuning.constraints else {}
        # Without the constant liar, the members of a batch, which are asked for before any of them
        # is known, would be nearly equal. Multivariate: gains of one controller depend on each
        # other.
        if tuning.sampler == "tpe":
            return samplers.TPESampler(
                seed=tuning.seed,
                multivariate=True,
                constant_liar=True,
                n_startup_trials=STARTUP,
                **constraints,
            )
        if tuning.sampler == "nsga2":
            # As many generations as members: optuna's population of 50 would leave two generations
            # of a hundred trials.
            size = max(4, min(50, round(math.sqrt(2.0 * tuning.trials))))
            return samplers.NSGAIISampler(seed=tuning.seed, population_size=size, **constraints)
        if tuning.sampler == "sobol":
            return samplers.QMCSampler(seed=tuning.seed, scramble=True)
        return samplers.RandomSampler(seed=tuning.seed)

    def _violations_of(self, trial: Any) -> Sequence[float]:
        return self._violations.get(trial.number, (0.0,))

    def _distribution(self, factor: Factor) -> Any:
        kinds = self._optuna.distributions
        if not isinstance(factor, Range):
            return kinds.CategoricalDistribution(list(range(len(factor.values))))
        if factor.steps:
            return kinds.IntDistribution(0, factor.steps - 1)
        if factor.scale == "int":
            return kinds.IntDistribution(int(factor.low), int(factor.high))
        low, high = float(factor.low), float(factor.high)
        return kinds.FloatDistribution(low, high, log=factor.scale == "log")

    def begin_with(self, values: Sequence[Any]) -> Suggestion | None:
        """Ask for these values first; None if the optimiser cannot try them itself.

        That is so where one is outside of its factor's values.
        """
        parameters = [
            _parameter(factor, value) for factor, value in zip(self.factors, values, strict=True)
        ]
        if None in parameters:
            return None
        paths = [factor.path for factor in self.factors]
        self._study.enqueue_trial(dict(zip(paths, parameters, strict=True)))
        return self.ask(1)[0]

    def ask(self, count: int) -> list[Suggestion]:
        """The next configurations, before any of them is known."""
        suggestions = []
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for _ in range(count):
                trial = self._study.ask(self._space)
                values = tuple(_value(factor, trial.params[factor.path]) for factor in self.factors)
                suggestions.append(Suggestion(values, trial))
        return suggestions

    def tell(
        self, suggestion: Suggestion, costs: Sequence[float], violations: Sequence[float]
    ) -> None:
        """What a configuration costs, each the smaller the better; infinity if it has no value."""
        self._violations[suggestion.handle.number] = [_finite(value) for value in violations]
        self._study.tell(suggestion.handle, [_finite(cost) for cost in costs])


def _finite(value: float) -> float:
    return min(max(value, -PENALTY), PENALTY)


def _value(factor: Factor, parameter: Any) -> Any:
    """The factor's value that a drawn parameter stands for."""
    if not isinstance(factor, Range):
        return factor.values[parameter]
    if factor.steps:
        return factor.value(parameter)
    if factor.scale == "int":
        return int(parameter)
    rounded = float(f"{parameter:.{DIGITS}g}")
    return min(max(rounded, float(factor.low)), float(factor.high))


def _parameter(factor: Factor, value: Any) -> Any:
    """The parameter that stands for a factor's value; None if there is none."""
    if not isinstance(factor, Range):
        return factor.values.index(value) if value in factor.values else None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    if factor.steps:
        steps = range(factor.steps)
        return next((i for i in steps if math.isclose(float(factor.value(i)), value)), None)
    if factor.scale == "int" and value != int(value):
        return None
    inside = float(factor.low) <= value <= float(factor.high)
    return (int(value) if factor.scale == "int" else float(value)) if inside else None


def optimizer_version() -> str:
    """The optimiser and its version, which decides what it asks for.

    Raises
    ------
    MissingExtraError : optuna is not installed.
    """
    return f"optuna {_optuna().__version__}"


def _optuna() -> Any:
    try:
        return require("optuna", "runtime tune", EXTRA)
    except MissingPackageError as error:
        raise MissingExtraError(error.feature, error.extra) from None
