"""The committed experiments, run as ``runtime ablate`` runs them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from runtime.errors import UsageError
from runtime.experiments.ablation import ablate
from runtime.experiments.crew import Crew, local_crew
from runtime.experiments.experiment import Experiment, read_experiment
from runtime.experiments.plan import ablation_plan
from runtime.experiments.seeds import Seeds
from runtime.experiments.variants import check_variants
from runtime.graph import Graph
from runtime.loader import SHIPPED
from runtime.progress import Progress
from tests.studies.following import ENGINE, WORKERS

EXPERIMENTS = SHIPPED / "experiments"
PRINTED, ROBUST = "as printed", "our rule"
RULES = (PRINTED, ROBUST)


@dataclass(frozen=True)
class Setting:
    """Where controllers are compared: a case, under a fault or none."""

    case: str
    label: str
    experiment: str
    condition: str = ""

    def file(self, rule: str) -> str:
        """The experiment's name, for one of the two rules."""
        return self.experiment + ("_robust" if rule == ROBUST else "")


SETTINGS = (
    Setting("A", "A", "line"),
    Setting("B", "B", "sine"),
    Setting("C", "C ideal", "walls"),
    Setting("C", "C turn loss", "walls", "turn_loss_50"),
    Setting("C", "C turn bias", "walls", "turn_bias"),
    Setting("C", "C mixed", "walls", "mixed"),
)


@dataclass(frozen=True)
class Measured:
    """One ablation: for each variant and metric a value for each seed, None where there is none."""

    values: dict[str, dict[str, list[float | None]]]
    seeds: tuple[int, ...]
    broken: tuple[str, ...] = ()

    def __call__(self, variant: str, metric: str) -> Sequence[float | None]:
        return self.values[variant][metric]


def read(setting: Setting, rule: str, engine: str = ENGINE) -> Experiment:
    """An experiment under the setting's condition: what ``--with`` and ``--set`` make of it."""

    def change(graph: Graph) -> Graph:
        if setting.condition:
            graph = graph.overlay(SHIPPED / "conditions" / f"{setting.condition}.yaml")
        return graph.set("run.engine", engine)

    experiment = read_experiment(str(EXPERIMENTS / f"{setting.file(rule)}.yaml"), change)
    check_variants(experiment.variants)
    name = f"{setting.file(rule)}_{setting.condition}".rstrip("_")
    return replace(experiment, name=name)


def measure(
    setting: Setting, rule: str, folder: Path, seeds: Seeds | None = None, engine: str = ENGINE
) -> Measured:
    """Run an experiment, or what of it the folder does not hold yet.

    Parameters
    ----------
    seeds : in place of the experiment's own.
    """
    experiment = read(setting, rule, engine)
    chosen = seeds or experiment.seeds
    if chosen is None:
        raise UsageError(f"{experiment.name}: there are no seeds")
    variants = list(experiment.variants)
    plan = ablation_plan(experiment, variants, chosen)
    done = ablate(plan, variants, {}, folder / plan.name, _crew, progress=Progress(plan.name))
    if done.is_interrupted:
        raise KeyboardInterrupt
    rows = done.rows
    values = {
        name: {metric: [row.metrics[i] for row in own] for i, metric in enumerate(plan.metrics)}
        for name, own in rows.items()
    }
    broken = tuple(
        f"{plan.name}: {name}, seed {row.seed}: {row.reason}"
        for name, own in rows.items()
        for row in own
        if row.status != "ok"
    )
    return Measured(values, tuple(chosen), broken)


def _crew() -> Crew:
    return local_crew(WORKERS, None)
