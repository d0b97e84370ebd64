"""What a tuning run is about: objectives, constraints, and the runs that decide.

In: an experiment with its entries, most of which may be missing. Out: :class:`Tuning`, complete::

    Entries(trials=40)  ->  40 trials by tpe in batches of 4, trained on the graph's own seed,
                            judged on the seeds 1000..1019
"""

from __future__ import annotations

from dataclasses import dataclass

from runtime.errors import UsageError
from runtime.experiments.design.entries import Over, Sampler
from runtime.experiments.design.experiment import Experiment
from runtime.experiments.design.objective import Constraint, Objective
from runtime.experiments.design.seeds import Seeds
from runtime.experiments.design.variants import GraphVariant, check_variants

NOMINAL = "nominal"
# With a batch of one, parallel workers would wait; a larger one is asked for with less knowledge.
TRIALS, BATCH = 100, 4
# Far from the seeds that people train with. Half of the 95 % interval of twenty differences is
# 0.47 of their standard deviation.
HELD_OUT = Seeds(((1000, 1019),))


@dataclass(frozen=True)
class RunSet:
    """Every condition with every seed."""

    seeds: Seeds
    conditions: tuple[GraphVariant, ...]

    def __len__(self) -> int:
        return len(self.seeds) * len(self.conditions)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(condition.name for condition in self.conditions)


@dataclass(frozen=True)
class TuningSettings:
    """How the values of the factors are found, and what is required of them.

    Parameters
    ----------
    objectives : what is minimised or maximised; several give a front.
    constraints : what must hold.
    trials : configurations that are tried, besides the graph's own.
    sampler : optuna's TPE, NSGA-II, a Sobol sequence, or random samples.
    batch : trials that are asked for at a time, before their results are known.
    seed : of the sampler.
    over : a metric of a configuration is its mean over the seeds, and over the conditions its
        mean or its worst value.
    stop_early : whether a configuration that is worse than half of the others is stopped.
    training, held_out : the runs that decide, and those that judge the winners.
    budget : the most training runs, or None.
    patience : trials per factor without a better one, after which the search ends, or None.
    """

    objectives: tuple[Objective, ...]
    constraints: tuple[Constraint, ...]
    trials: int
    sampler: Sampler
    batch: int
    seed: int
    over: Over
    stop_early: bool
    training: RunSet
    held_out: RunSet
    budget: int | None = None
    patience: int | None = None

    @property
    def metrics(self) -> tuple[str, ...]:
        """The metrics that matter, the objectives first."""
        required = [constraint.metric for constraint in self.constraints]
        return tuple(dict.fromkeys([*(o.metric for o in self.objectives), *required]))


def tuning_of(experiment: Experiment) -> TuningSettings:
    """What an experiment says about its search, with the defaults.

    Raises
    ------
    UsageError : the graph has no metric, a condition cannot run, or a run would both train and
        judge.
    """
    graph, entries = experiment.graph, experiment.entries
    objectives = entries.objectives
    if not objectives:
        if not graph.observation.metrics:
            example = graph.observation.metric_example()
            raise UsageError(f"the graph has no metric to tune for; {example}")
        objectives = (Objective(graph.observation.metrics[0].name),)
    own = graph.network.seed
    seeds, conditions = entries.training
    seeds = seeds or entries.seeds or Seeds(((own, own),))
    training = RunSet(seeds, conditions or (GraphVariant(NOMINAL, graph),))
    seeds, conditions = entries.held_out
    held_out = RunSet(seeds or HELD_OUT, conditions or training.conditions)
    _check_apart(training, held_out)
    for runs in (training, held_out):
        check_variants(runs.conditions)
    return TuningSettings(
        objectives,
        entries.constraints,
        entries.trials or (TRIALS if entries.budget is None else entries.budget),
        entries.sampler or "tpe",
        entries.batch or BATCH,
        entries.sampling_seed or 0,
        entries.over or "mean",
        entries.stop_early is not False,
        training,
        held_out,
        entries.budget,
        entries.patience,
    )


def _check_apart(training: RunSet, held_out: RunSet) -> None:
    # A winner that is judged on a run that chose it looks better than it is: of many noisy
    # configurations, the best one owes part of its rank to the noise of these very runs.
    shared = set(training.names) & set(held_out.names)
    seeds = set(training.seeds) & set(held_out.seeds)
    if shared and seeds:
        raise UsageError(
            f"condition '{min(shared)}' with seed {min(seeds)} is both in training and held out; "
            "give the held-out runs other seeds"
        )
