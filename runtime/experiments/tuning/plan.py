"""The plan of a tuning: everything that its numbers depend on.

In: an experiment. Out: :class:`TuningPlan`, which numbers the trials of each configuration; with
two seeds and the conditions a and b, configuration 3 has these::

    stage 0: 12 (a, first seed), 13 (b, first seed)     stage 1: 14 (a, second), 15 (b, second)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from runtime.document import flow_yaml
from runtime.engine import silent
from runtime.errors import UsageError
from runtime.experiments.design import (
    Design,
    Experiment,
    GraphVariant,
    RunSet,
    Seeds,
    TuningSettings,
    check_paths,
    tuning_of,
)
from runtime.experiments.execution import (
    GRAPH,
    VARIANTS,
    Columns,
    Configuration,
    ExperimentPlan,
    Note,
    Trial,
    VariantBundle,
    bundle_for,
    bundles_of,
    engine_for,
    metrics_of,
)
from runtime.experiments.tuning.optimizer import optimizer_version

HELD_OUT, TUNING = "held_out.csv", "tuning.json"
CONDITION, CONFIGURATION = "condition", "configuration"
BASELINE = 0  # the number of the graph's own values among the configurations


@dataclass(frozen=True)
class TuningPlan(ExperimentPlan):
    """All that the numbers of a tuning run depend on.

    ``variants`` are the conditions, those of training first.
    """

    tuning: TuningSettings = field(kw_only=True)

    @property
    def paths(self) -> tuple[str, ...]:
        """The paths of the factors."""
        return tuple(factor.path for factor in self.design.factors)

    @property
    def larger_is_better(self) -> set[str]:
        aims = {o.metric for o in self.tuning.objectives if o.goal == "maximize"}
        aims |= {c.metric for c in self.tuning.constraints if c.side == "above"}
        return (super().larger_is_better | aims) - self.smaller_is_better

    @property
    def smaller_is_better(self) -> set[str]:
        aims = {o.metric for o in self.tuning.objectives if o.goal == "minimize"}
        chosen = {o.metric for o in self.tuning.objectives}
        below = {c.metric for c in self.tuning.constraints if c.side == "below"}
        return aims | (below - chosen)

    @property
    def columns(self) -> Columns:
        return Columns((*self.paths, CONDITION), self.metrics)

    @property
    def held_out_columns(self) -> Columns:
        """The columns of the index of the held-out runs."""
        return Columns((CONFIGURATION, CONDITION), self.metrics)

    @property
    def total(self) -> int:
        """The most runs that training can take."""
        return (1 + self.tuning.trials) * len(self.tuning.training)

    def cells(self, values: Sequence[Any] | None) -> tuple[str, ...]:
        """The strings of a configuration's values in the index; empty for the graph's own."""
        return tuple(map(flow_yaml, values)) if values is not None else ("",) * len(self.paths)

    def _edits(self, values: Sequence[Any] | None) -> tuple[tuple[str, str], ...]:
        if values is None:
            return ()
        return tuple(zip(self.paths, self.cells(values), strict=True))

    def stage(self, number: int, values: Sequence[Any] | None, stage: int) -> list[Trial]:
        """A configuration's training runs with one seed, one for each condition."""
        runs, cells = self.tuning.training, self.cells(values)
        edits = self._edits(values)
        seed = list(runs.seeds)[stage]
        return [
            Trial(
                number * len(runs) + stage * len(runs.conditions) + i,
                Configuration(number, (*cells, condition.name), condition.bundle, edits),
                seed,
            )
            for i, condition in enumerate(self._conditions(runs, 0))
        ]

    def held_out(self, configurations: dict[int, Sequence[Any] | None]) -> list[Trial]:
        """The held-out runs of some configurations, given by number."""
        runs, trials = self.tuning.held_out, list[Trial]()
        for i, (number, values) in enumerate(configurations.items()):
            edits = self._edits(values)
            for j, condition in enumerate(self._conditions(runs, len(self.tuning.training.names))):
                for k, seed in enumerate(runs.seeds):
                    place = (i * len(runs.conditions) + j) * len(runs.seeds) + k
                    cells = (str(number), condition.name)
                    configuration = Configuration(i, cells, condition.bundle, edits)
                    trials.append(Trial(place, configuration, seed))
        return trials

    def _conditions(self, runs: RunSet, first: int) -> list[VariantBundle]:
        bundles = self.variants[first : first + len(runs.conditions)]
        return [
            replace(bundle, name=name) for name, bundle in zip(runs.names, bundles, strict=True)
        ]

    @property
    def specification(self) -> dict[str, Any]:
        """The plan as entries of an experiment file, without its graph."""
        tuning = self.tuning
        entries: dict[str, Any] = {
            "vary": {factor.path: factor.written for factor in self.design.factors}
        }
        for goal in ("minimize", "maximize"):
            metrics = [o.metric for o in tuning.objectives if o.goal == goal]
            if metrics:
                entries[goal] = metrics
        constraints: dict[str, dict[str, float]] = {}
        for constraint in tuning.constraints:
            constraints.setdefault(constraint.metric, {})[constraint.side] = constraint.bound
        if constraints:
            entries["constraints"] = constraints
        entries |= {"trials": tuning.trials, "sampler": tuning.sampler, "batch": tuning.batch}
        entries |= {"sampling_seed": tuning.seed, "over": tuning.over}
        entries["stop_early"] = tuning.stop_early
        if tuning.budget is not None:
            entries["budget"] = tuning.budget
        if tuning.patience is not None:
            entries["patience"] = tuning.patience
        first = 0
        for name, runs in (("training", tuning.training), ("held_out", tuning.held_out)):
            slugs_of = self._conditions(runs, first)
            first += len(runs.conditions)
            entries[name] = {
                "seeds": str(runs.seeds),
                "conditions": {c.name: {"graph": f"{VARIANTS}/{c.slug}/{GRAPH}"} for c in slugs_of},
            }
        entries["optimizer"] = optimizer_version()
        return entries


def tuning_plan(experiment: Experiment, note: Note = silent) -> TuningPlan:
    """The plan of a tuning run; ``note`` receives hints that would make it faster.

    Raises
    ------
    UsageError : there is nothing to vary, or a factor or a column's name is there twice.
    MissingExtraError : optuna is not installed.
    """
    experiment.check_used("tuning")
    if not experiment.entries.factors:
        raise UsageError("there is nothing to tune; add --vary PATH=RANGE")
    return contestant_plan(experiment, note)


def contestant_plan(experiment: Experiment, note: Note = silent) -> TuningPlan:
    """The plan of one tuning of a contest, in which a contestant may have nothing to tune.

    Raises
    ------
    UsageError, MissingExtraError : as for :func:`tuning_plan`.
    """
    graph, factors = experiment.graph, experiment.entries.factors
    tuning = tuning_of(experiment)
    if not factors:
        tuning = replace(tuning, trials=0)
    check_paths(graph, factors)
    engine = engine_for(graph, (1 + tuning.trials) * len(tuning.training), note)
    conditions = [
        GraphVariant(f"{kind} {condition.name}", condition.graph.check())
        for kind, runs in (("training", tuning.training), ("held_out", tuning.held_out))
        for condition in runs.conditions
    ]
    return TuningPlan(
        kind="tuning",
        name=experiment.name,
        graph=graph,
        bundle=bundle_for(graph, engine),
        seeds=Seeds(()),
        metrics=metrics_of(graph),
        design=Design(factors, seed=tuning.seed),
        variants=bundles_of(conditions, engine),
        tuning=tuning,
    )
