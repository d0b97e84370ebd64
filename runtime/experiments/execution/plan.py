"""The plan of a sweep or an ablation: everything that its numbers depend on.

In: an experiment with all that a command adds. Out: :class:`ExperimentPlan`, whose ``trials`` can
be sent to any process, and whose ``digest`` is equal where all numbers are::

    {graph: G, vary: {a: [1, 2]}, seeds: 0..2}  ->  6 trials: a=1 with seeds 0, 1, 2, then a=2
    the same with variants: {soft: ...}         ->  12: those of the baseline, then those of soft
"""

from __future__ import annotations

import hashlib
import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from runtime.engine import silent, take_compiled
from runtime.errors import UsageError
from runtime.experiments.design import (
    BASELINE,
    Design,
    Experiment,
    FigureSpec,
    GraphVariant,
    Objective,
    Seeds,
    check_contrasts,
    check_design,
    check_variants,
    removals,
    slugs,
    with_signal,
)
from runtime.experiments.execution.index import RESERVED, Columns
from runtime.experiments.execution.trials import (
    Configuration,
    GraphBundle,
    Trial,
    configurations_of,
    trials_of,
)
from runtime.graph import Graph
from runtime.runs import Program, program_of

# 1: the number of trials was called points, and the origin of a plan made.
SCHEMA_VERSION = 2
GRAPH, INDEX, VARIANTS = "graph.resolved.yaml", "index.csv", "variants"
VARIANT = "variant"  # the column of their names
Kind = Literal["sweep", "ablation", "tuning"]
Note = Callable[[str], None]
# Six pairs are the fewest with which a sign test can be significant.
ABLATION_SEEDS = Seeds(((0, 9),))
# Kinds of metrics whose values are not negative, and of which neither less nor more is better.
AMOUNTS = frozenset({"path_length", "share_above", "firing_rate", "stop_time"})


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
    """All that the numbers of a sweep or an ablation depend on.

    Each of ``variants``, the baseline first, runs with all values of ``design``; without variants
    ``graph`` does. ``essential`` are the blocks that an ablation cannot remove alone, with the
    reasons. ``primary``, ``contrasts`` and ``margins`` are what is asked of the results, as in
    :class:`Questions`, ``quantiles`` and ``with_worst`` what is shown besides means; no number of
    a run depends on them.
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
    primary: tuple[str, ...] = ()
    contrasts: tuple[tuple[str, str], ...] = ()
    margins: Mapping[str, float | str] = field(default_factory=dict)
    quantiles: tuple[float, ...] = ()
    with_worst: bool = False
    figures: tuple[FigureSpec, ...] = ()

    def __post_init__(self) -> None:
        """Raise ``UsageError`` if a metric has the name of a column of the index."""
        header = self.columns.header
        for name in self.metrics:
            if header.count(name) > 1:
                reason = f"taken by a column of {INDEX}: {', '.join(RESERVED)}"
                raise UsageError(f"metric '{name}': the name is {reason}; rename the metric")

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that figures show over time."""
        return tuple(dict.fromkeys(figure.signal for figure in self.figures if figure.signal))

    @property
    def larger_is_better(self) -> set[str]:
        """The metrics of which a failed run counts as the smallest value, not as the largest."""
        metrics = self.graph.observation.metrics
        return {m.name for m in metrics if m.options.get("above") is not None} | {
            goal.metric
            for goal in (self.objective,)
            if goal is not None and goal.goal == "maximize"
        }

    def worst(self, metric: str) -> float | None:
        """The value of a run that failed: infinite, or None for a metric without a direction.

        A direction is given by an objective, ``below`` or ``above``; a time until something, and an
        error, which has 0 as its least value, are better if they are smaller.
        """
        if metric in self.larger_is_better:
            return -math.inf
        [own] = [m for m in self.graph.observation.metrics if m.name == metric]
        is_error = own.definition.ends[0] == 0.0 and own.kind not in AMOUNTS
        is_said = own.options.get("below") is not None or metric in self.smaller_is_better
        return math.inf if is_error or is_said or own.never else None

    @property
    def smaller_is_better(self) -> set[str]:
        """The metrics that an objective minimises."""
        goal = self.objective
        return {goal.metric} if goal is not None and goal.goal == "minimize" else set()

    @property
    def columns(self) -> Columns:
        paths = tuple(factor.path for factor in self.design.factors)
        return Columns((VARIANT, *paths) if self.variants else paths, self.metrics)

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
        return max(1, len(self.variants)) * len(self.design) * len(self.seeds)

    def configurations(self) -> Iterator[Configuration]:
        """The configurations that are compared, one by one: each variant with each value."""
        paths = tuple(factor.path for factor in self.design.factors)
        if not self.variants:
            yield from configurations_of(self.bundle, paths, self.design)
        for i, each in enumerate(self.variants):
            first = i * len(self.design)
            yield from configurations_of(each.bundle, paths, self.design, first, (each.name,))

    def trials(self) -> Iterator[Trial]:
        """All trials, in the order in which they are sent to workers."""
        return trials_of(self.configurations(), self.seeds)

    @property
    def specification(self) -> dict[str, Any]:
        """The plan as entries of an experiment file, without its graph."""
        entries: dict[str, Any] = {"seeds": str(self.seeds)}
        if self.design.factors or not self.variants:
            entries["vary"] = {factor.path: factor.written for factor in self.design.factors}
        if self.design.method != "grid":
            entries[self.design.method] = self.design.samples
            entries["sampling_seed"] = self.design.seed
        if self.variants:
            entries["variants"] = {
                v.name: {"graph": f"{VARIANTS}/{v.slug}/{GRAPH}", "changes": [*v.changes]}
                for v in self.variants
                if v.name != BASELINE
            }
        return entries

    @property
    def program(self) -> Program:
        """What computes the trials."""
        return program_of(self.graph.network, *(each.graph.network for each in self.variants))

    @property
    def digest(self) -> str:
        """A hash of everything that the numbers depend on, but for the program."""
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
            **{
                key: value
                for key, value in (
                    ("primary", list(self.primary)),
                    ("contrasts", [list(pair) for pair in self.contrasts]),
                    ("margin", dict(self.margins)),
                    ("quantile", list(self.quantiles)),
                    ("worst", self.with_worst),
                    ("figures", {figure.name: figure.to_dict() for figure in self.figures}),
                )
                if value
            },
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
                "program": str(self.program),
                "git": git_commit(),
            },
        }


def sweep_plan(experiment: Experiment, note: Note = silent) -> ExperimentPlan:
    """The plan of a sweep: all values with every variant, the graph itself as the baseline.

    Raises
    ------
    UsageError : there is nothing to vary, or a factor or a column's name is there twice.
    """
    own = experiment.graph.network.seed
    seeds = experiment.seeds or Seeds(((own, own),))
    if not (experiment.variants or experiment.design.factors) and len(seeds) < 2:
        raise UsageError("there is nothing to vary; add --vary PATH=VALUES, or more --seeds")
    return _plan("sweep", experiment, seeds, list(experiment.variants), note)


def ablation_plan(experiment: Experiment, note: Note = silent) -> ExperimentPlan:
    """The plan of an ablation; the baseline is its first variant.

    Without variants, each block is removed in turn. With factors, variants are compared at each
    of their values.

    Raises
    ------
    UsageError : a variant cannot run, there is none, or there is no metric.
    """
    variants, essential = list(experiment.variants), dict[str, str]()
    if not variants:
        variants, essential = removals(experiment.graph.check())
    if not variants:
        raise UsageError("no block of this graph can be removed alone; give variants")
    if not experiment.graph.observation.metrics:
        example = experiment.graph.observation.metric_example()
        raise UsageError(f"the graph has no metrics to compare variants by; {example}")
    plan = _plan("ablation", experiment, experiment.seeds or ABLATION_SEEDS, variants, note)
    return replace(plan, essential=essential)


def _plan(
    kind: Literal["sweep", "ablation"],
    experiment: Experiment,
    seeds: Seeds,
    variants: list[GraphVariant],
    note: Note,
) -> ExperimentPlan:
    """The plan of every variant with every value; ``note`` receives hints to make it faster."""
    experiment.check_used(kind)
    graph, design, entries = experiment.graph.check(), experiment.design, experiment.entries
    check_contrasts(entries.contrasts, variants)
    check_design(graph, design)
    check_variants(variants)
    for signal in dict.fromkeys(figure.signal for figure in entries.figures if figure.signal):
        graph = with_signal(graph, signal)
        variants = [replace(v, graph=with_signal(v.graph, signal)) for v in variants]
    everything = [GraphVariant(BASELINE, graph), *variants] if variants else []
    runs = max(1, len(everything)) * len(design) * len(seeds)
    engine = engine_for(graph, runs, note)
    bundles = bundles_of(everything, engine)
    bundle = bundles[0].bundle if bundles else bundle_for(graph, engine)
    metrics = _choose_metrics(metrics_of(graph), experiment)
    default = Objective(metrics[0]) if metrics and kind == "sweep" else None
    return ExperimentPlan(
        kind=kind,
        name=experiment.name,
        graph=graph,
        bundle=bundle,
        seeds=seeds,
        metrics=metrics,
        design=design,
        variants=bundles,
        objective=experiment.objective or default,
        primary=entries.primary,
        contrasts=entries.contrasts,
        margins=dict(entries.margins),
        quantiles=entries.quantiles,
        with_worst=bool(entries.worst),
        figures=entries.figures,
    )


def _choose_metrics(known: tuple[str, ...], experiment: Experiment) -> tuple[str, ...]:
    """The metrics of an experiment: those that it lists and those that its entries name, or all."""
    entries = experiment.entries
    if not entries.metrics:
        return known
    named = {*entries.metrics, *entries.primary, *dict(entries.margins)}
    named |= {each.metric for each in entries.objectives}
    named |= {each.metric for each in entries.figures}
    return tuple(name for name in known if name in named)


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
