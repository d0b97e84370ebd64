"""The plan of a sweep or an ablation: everything that its numbers depend on.

In: an experiment with all that a command adds. Out: :class:`ExperimentPlan`, whose ``trials`` can
be sent to any process, and whose ``digest`` is equal where all numbers are::

    {graph: G, vary: {a: [1, 2]}, seeds: 0..2}  ->  6 trials: a=1 with seeds 0, 1, 2, then a=2
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, TypeVar

from runtime.engine import silent, take_compiled
from runtime.errors import UsageError
from runtime.experiments.design import (
    BASELINE,
    Design,
    Experiment,
    GraphVariant,
    Objective,
    Seeds,
    check_design,
    check_variants,
    removals,
    slugs,
)
from runtime.experiments.execution.index import RESERVED, Columns
from runtime.experiments.execution.trials import (
    Configuration,
    GraphBundle,
    Trial,
    sweep_configurations,
    trials_of,
)
from runtime.graph import Graph

# 1: the number of trials was called points, and the origin of a plan made.
SCHEMA_VERSION = 2
GRAPH, INDEX, VARIANTS = "graph.resolved.yaml", "index.csv", "variants"
Kind = Literal["sweep", "ablation", "tuning"]
Note = Callable[[str], None]
# Six pairs are the fewest with which a sign test can be significant.
ABLATION_SEEDS = Seeds(((0, 9),))
PlanT = TypeVar("PlanT", bound="ExperimentPlan")


@dataclass(frozen=True)
class VariantBundle:
    """A variant that can be sent to another process. ``slug`` is its name in file names."""

    name: str
    slug: str
    bundle: GraphBundle
    graph: Graph = field(repr=False, compare=False)
    changes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ExperimentPlan:
    """All that the numbers of a sweep (``design``) or an ablation (``variants``) depend on.

    ``essential`` are the blocks that an ablation cannot remove alone, with the reasons.
    """

    kind: Kind
    name: str
    graph: Graph
    bundle: GraphBundle
    seeds: Seeds
    metrics: tuple[str, ...]
    design: Design
    variants: tuple[VariantBundle, ...] = ()
    objective: Objective | None = None
    essential: Mapping[str, str] = field(default_factory=dict)

    @property
    def columns(self) -> Columns:
        factors = tuple(factor.path for factor in self.design.factors)
        return Columns(factors if self.kind == "sweep" else ("variant",), self.metrics)

    @property
    def units(self) -> dict[str, str]:
        """The units of the metrics that have one."""
        return self.graph.observation.metric_units

    @property
    def ends(self) -> dict[str, tuple[float, float]]:
        """The least and the largest possible value of the metrics that have one."""
        return self.graph.observation.metric_ends

    @property
    def never(self) -> dict[str, str]:
        """What an infinite value of a metric means, such as ``never settled``."""
        return self.graph.observation.metric_never

    @property
    def total(self) -> int:
        """The number of trials."""
        configurations = len(self.design) if self.kind == "sweep" else len(self.variants)
        return configurations * len(self.seeds)

    def configurations(self) -> Iterator[Configuration]:
        """The configurations that are compared, one by one."""
        if self.kind == "sweep":
            paths = tuple(factor.path for factor in self.design.factors)
            return sweep_configurations(self.bundle, paths, self.design)
        return (Configuration(i, (v.name,), v.bundle) for i, v in enumerate(self.variants))

    def trials(self) -> Iterator[Trial]:
        """All trials, in the order in which they are sent to workers."""
        return trials_of(self.configurations(), self.seeds)

    @property
    def specification(self) -> dict[str, Any]:
        """The plan as entries of an experiment file, without its graph."""
        entries: dict[str, Any] = {"seeds": str(self.seeds)}
        if self.kind == "sweep":
            entries["vary"] = {factor.path: factor.written for factor in self.design.factors}
            if self.design.method != "grid":
                entries[self.design.method] = self.design.samples
                entries["sampling_seed"] = self.design.seed
        else:
            entries["variants"] = {
                v.name: {"graph": f"{VARIANTS}/{v.slug}/{GRAPH}", "changes": [*v.changes]}
                for v in self.variants
                if v.name != BASELINE
            }
        return entries

    @property
    def digest(self) -> str:
        """A hash of everything that the numbers depend on."""
        # The objective is no part of it: it ranks trials and changes none, so that a sweep may be
        # continued with another one.
        digests = [self.bundle.digest, *(variant.bundle.digest for variant in self.variants)]
        content = json.dumps([self.kind, digests, self.specification, self.metrics])
        return hashlib.sha256(content.encode()).hexdigest()

    def header(self, folder: Path) -> dict[str, Any]:
        """What the results of every experiment begin with, in JSON."""
        return {
            "schema_version": SCHEMA_VERSION,
            "kind": self.kind,
            "experiment": self.name,
            "graph": self.graph.title,
            "folder": str(folder),
            "metrics": list(self.metrics),
            "units": self.units,
            "never": self.never,
        }

    def to_dict(self) -> dict[str, Any]:
        """The contents of plan.yaml."""
        from runtime.runs import git_commit, versions

        goal: dict[str, Any] = {}
        if self.objective is not None:
            goal[self.objective.goal] = self.objective.metric
        source = self.graph.source
        return {
            "schema_version": SCHEMA_VERSION,
            "kind": self.kind,
            "experiment": self.name,
            "graph": GRAPH,
            **self.specification,
            **goal,
            "metrics": list(self.metrics),
            "units": self.units,
            "ends": {name: list(ends) for name, ends in self.ends.items()},
            "never": self.never,
            "total": self.total,
            "digest": self.digest,
            "provenance": {
                "started": datetime.now().astimezone().isoformat(timespec="seconds"),
                "argv": list(sys.argv),
                "source": str(source) if source else None,
                "changes": [str(change) for change in self.graph.overrides],
                "versions": versions(),
                "git": git_commit(),
            },
        }


def sweep_plan(experiment: Experiment, note: Note = silent) -> ExperimentPlan:
    """The plan of a sweep; ``note`` receives hints that would make it faster.

    Raises
    ------
    UsageError : there is nothing to vary, or a factor or a column's name is there twice.
    """
    graph, design = experiment.graph, experiment.design
    own = graph.network.seed
    seeds = experiment.seeds or Seeds(((own, own),))
    check_design(graph, design, seeds)
    metrics = metrics_of(graph)
    objective = experiment.objective
    if objective is None and metrics:
        objective = Objective(metrics[0])
    engine = engine_for(graph, len(design) * len(seeds), note)
    plan = ExperimentPlan(
        *("sweep", experiment.name, graph, bundle_for(graph, engine), seeds, metrics, design),
        objective=objective,
    )
    return checked_plan(plan)


def ablation_plan(experiment: Experiment, note: Note = silent) -> ExperimentPlan:
    """The plan of an ablation; the baseline is its first variant.

    Without variants, each block is removed in turn.

    Raises
    ------
    UsageError : a variant cannot run, there is none, or there is no metric.
    """
    graph, seeds = experiment.graph.check(), experiment.seeds or ABLATION_SEEDS
    variants, essential = list(experiment.variants), dict[str, str]()
    if variants:
        check_variants(variants)
    else:
        variants, essential = removals(graph)
    if not variants:
        raise UsageError("no block of this graph can be removed alone; give variants")
    metrics = metrics_of(graph)
    if not metrics:
        raise UsageError("the graph has no metrics to compare variants by; add 'metrics:'")
    engine = engine_for(graph, (1 + len(variants)) * len(seeds), note)
    bundles = bundles_of([GraphVariant(BASELINE, graph), *variants], engine)
    plan = ExperimentPlan(
        *("ablation", experiment.name, graph, bundles[0].bundle, seeds, metrics, Design(())),
        variants=bundles,
        essential=essential,
    )
    return checked_plan(plan)


def bundles_of(variants: Sequence[GraphVariant], engine: str) -> tuple[VariantBundle, ...]:
    """Variants as they are sent to workers."""
    names = slugs([variant.name for variant in variants])
    return tuple(
        VariantBundle(v.name, names[v.name], bundle_for(v.graph, engine), v.graph, v.changes)
        for v in variants
    )


def engine_for(graph: Graph, runs: int, note: Note) -> str:
    """The engine of all trials, chosen once: results of different engines are not comparable."""
    if not take_compiled(graph.network, runs, note):
        return "python"
    return "checked" if graph.network.engine == "checked" else "compiled"


def bundle_for(graph: Graph, engine: str) -> GraphBundle:
    """A graph for workers, with the engine unless it names one itself."""
    is_open = graph.network.engine == "auto"
    return GraphBundle.of(graph.set("run.engine", engine) if is_open else graph)


def metrics_of(graph: Graph) -> tuple[str, ...]:
    """The names of a graph's metrics."""
    return tuple(metric.name for metric in graph.observation.metrics)


def checked_plan(plan: PlanT) -> PlanT:
    """The plan, if no metric has the name of a column of the index.

    Raises
    ------
    UsageError : one has.
    """
    header = plan.columns.header
    for name in plan.metrics:
        if header.count(name) > 1:
            reason = f"taken by a column of {INDEX}: {', '.join(RESERVED)}"
            raise UsageError(f"metric '{name}': the name is {reason}; rename the metric")
    return plan
