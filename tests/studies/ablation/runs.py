"""The committed experiments, run as ``runtime ablate`` runs them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from runtime.document.loader import SHIPPED
from runtime.errors import UsageError
from runtime.experiments import run_ablation
from runtime.experiments.analysis import failed_value
from runtime.experiments.design.experiment import Experiment, read_experiment
from runtime.experiments.design.seeds import Seeds
from runtime.experiments.design.variants import check_variants
from runtime.experiments.execution import RunOptions
from runtime.experiments.execution.plan import ablation_plan
from runtime.graph import Graph
from runtime.terminal import Progress
from tests.studies.following import ENGINE, WORKERS

EXPERIMENTS = SHIPPED / "experiments"
PRINTED, ROBUST = "as printed", "robust rule"
RULES = (PRINTED, ROBUST)
WORST = {"distance": -math.inf}  # of a run that failed: progress along a path; others are errors


@dataclass(frozen=True)
class Configuration:
    """Where controllers are compared: a case, under a fault or none."""

    case: str
    label: str
    experiment: str
    condition: str = ""

    def file(self, rule: str) -> str:
        """The experiment's name, for one of the two rules."""
        return self.experiment + ("_robust" if rule == ROBUST else "")


CONFIGURATIONS = (
    Configuration("A", "A", "line"),
    Configuration("B", "B", "sine"),
    Configuration("C", "C ideal", "walls"),
    Configuration("C", "C turn loss", "walls", "turn_loss_50"),
    Configuration("C", "C turn bias", "walls", "turn_bias"),
    Configuration("C", "C mixed", "walls", "mixed"),
)


@dataclass(frozen=True)
class Measured:
    """One ablation: for each variant and metric a value for each seed.

    It is infinite where something is never reached or a run failed, which is worse than any other
    value, and None where there is none.
    """

    values: dict[str, dict[str, list[float | None]]]
    seeds: tuple[int, ...]
    broken: tuple[str, ...] = ()

    def __call__(self, variant: str, metric: str) -> Sequence[float | None]:
        return self.values[variant][metric]


def read(configuration: Configuration, rule: str, engine: str = ENGINE) -> Experiment:
    """An experiment under a configuration's condition: what ``--with`` and ``--set`` make of it."""

    def change(graph: Graph) -> Graph:
        if configuration.condition:
            graph = graph.overlay(SHIPPED / "conditions" / f"{configuration.condition}.yaml")
        return graph.set("run.engine", engine)

    experiment = read_experiment(str(EXPERIMENTS / f"{configuration.file(rule)}.yaml"), change)
    check_variants(experiment.variants)
    name = f"{configuration.file(rule)}_{configuration.condition}".rstrip("_")
    return replace(experiment, name=name)


def measure(
    configuration: Configuration,
    rule: str,
    folder: Path,
    seeds: Seeds | None = None,
    engine: str = ENGINE,
    jobs: int = WORKERS,
) -> Measured:
    """Run an experiment, or what of it the folder does not hold yet.

    Parameters
    ----------
    seeds : in place of the experiment's own.
    jobs : the number of processes.
    """
    experiment = read(configuration, rule, engine)
    chosen = seeds or experiment.seeds
    if chosen is None:
        raise UsageError(f"{experiment.name}: there are no seeds")
    plan = ablation_plan(replace(experiment, entries=replace(experiment.entries, seeds=chosen)))
    options = RunOptions(folder / plan.name, resume=True, jobs=jobs)
    done = run_ablation(plan, options, Progress(plan.name))
    if done.is_interrupted:
        raise KeyboardInterrupt
    rows = done.rows
    values = {
        name: {
            metric: [failed_value(row, i, WORST.get(metric, math.inf)) for row in own]
            for i, metric in enumerate(plan.metrics)
        }
        for name, own in rows.items()
    }
    broken = tuple(
        f"{plan.name}: {name}, seed {row.seed}: {row.reason}"
        for name, own in rows.items()
        for row in own
        if row.status != "ok"
    )
    return Measured(values, tuple(chosen), broken)
