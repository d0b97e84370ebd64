"""The plan of a sweep or an ablation: everything its numbers depend on, and its folder."""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, TypeVar

from runtime.diagrams import stored_picture
from runtime.document import dump_yaml, parse_yaml
from runtime.engine import silent, take_compiled
from runtime.errors import GraphError, UsageError
from runtime.experiments.design import (
    BASELINE,
    Design,
    Experiment,
    Objective,
    Seeds,
    Variant,
    slugs,
)
from runtime.experiments.execution.index import RESERVED, Columns, Index
from runtime.experiments.execution.trials import (
    Configuration,
    GraphBundle,
    Trial,
    swept_configurations,
    trials_of,
)
from runtime.files import check_form, system_errors
from runtime.graph import Graph
from runtime.runs import DIAGRAM

SCHEMA_VERSION = 1
PLAN, GRAPH, INDEX = "plan.yaml", "graph.resolved.yaml", "index.csv"
VARIANTS = "variants"
TABLE, DIAGRAMS, RUNS = "ablation.json", "diagrams", "runs"
SUMMARY = "summary.json"
Kind = Literal["sweep", "ablation", "tuning"]
Note = Callable[[str], None]
PlanT = TypeVar("PlanT", bound="ExperimentPlan")
_ALTERNATIVES: dict[Kind, str] = {
    "sweep": "--name NAME begins another sweep beside it; to continue that one, repeat its own "
    "command with --resume",
    "ablation": "without --resume, the ablation gets a new folder",
    "tuning": "--name NAME begins another tuning beside it; to continue that one, repeat its own "
    "command with --resume",
}


@dataclass(frozen=True)
class VariantBundle:
    """A variant that can be sent to another process. ``slug`` is its name in file names."""

    name: str
    slug: str
    bundle: GraphBundle
    changes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ExperimentPlan:
    """All that the numbers of a sweep (``design``) or an ablation (``variants``) depend on."""

    kind: Kind
    name: str
    graph: Graph
    bundle: GraphBundle
    seeds: Seeds
    metrics: tuple[str, ...]
    design: Design
    variants: tuple[VariantBundle, ...] = ()
    objective: Objective | None = None

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
            return swept_configurations(self.bundle, paths, self.design)
        return (Configuration(i, (v.name,), v.bundle) for i, v in enumerate(self.variants))

    def trials(self) -> Iterator[Trial]:
        """All trials, in the order in which they are sent to workers."""
        return trials_of(self.configurations(), self.seeds)

    @property
    def specification(self) -> dict[str, Any]:
        """The plan as entries of an experiment file, without its graph."""
        found: dict[str, Any] = {"seeds": str(self.seeds)}
        if self.kind == "sweep":
            found["vary"] = {factor.path: factor.written for factor in self.design.factors}
            if self.design.method != "grid":
                found[self.design.method] = self.design.samples
                found["sampling_seed"] = self.design.seed
        else:
            found["variants"] = {
                v.name: {"graph": f"{VARIANTS}/{v.slug}/{GRAPH}", "changes": [*v.changes]}
                for v in self.variants
                if v.name != BASELINE
            }
        return found

    @property
    def digest(self) -> str:
        """A hash of everything that the numbers depend on."""
        digests = [self.bundle.digest, *(variant.bundle.digest for variant in self.variants)]
        content = json.dumps([self.kind, digests, self.specification, self.metrics])
        return hashlib.sha256(content.encode()).hexdigest()

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
            "points": self.total,
            "digest": self.digest,
            "made": {
                "started": datetime.now().astimezone().isoformat(timespec="seconds"),
                "argv": list(sys.argv),
                "source": str(source) if source else None,
                "changes": [str(change) for change in self.graph.overrides],
                "versions": versions(),
                "git": git_commit(),
            },
        }


def sweep_plan(experiment: Experiment, seeds: Seeds, note: Note = silent) -> ExperimentPlan:
    """The plan of a sweep; ``note`` receives hints that would make it faster."""
    graph, design = experiment.graph, experiment.design
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


def ablation_plan(
    experiment: Experiment, variants: list[Variant], seeds: Seeds, note: Note = silent
) -> ExperimentPlan:
    """The plan of an ablation; the baseline is its first variant."""
    graph = experiment.graph
    engine = engine_for(graph, (1 + len(variants)) * len(seeds), note)
    bundle, metrics = bundle_for(graph, engine), metrics_of(graph)
    names = slugs([BASELINE, *(variant.name for variant in variants)])
    bundles = [VariantBundle(BASELINE, names[BASELINE], bundle)]
    for variant in variants:
        own = bundle_for(variant.graph, engine)
        bundles.append(VariantBundle(variant.name, names[variant.name], own, variant.changes))
    plan = ExperimentPlan(
        *("ablation", experiment.name, graph, bundle, seeds, metrics, Design(())),
        variants=tuple(bundles),
    )
    return checked_plan(plan)


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
            taken = f"taken by a column of {INDEX}: {', '.join(RESERVED)}"
            raise UsageError(f"metric '{name}': the name is {taken}; rename the metric")
    return plan


def create(plan: ExperimentPlan, folder: Path) -> None:
    """Make a plan's folder, which gets its name only when it is complete.

    Raises
    ------
    UsageError : it cannot be written.
    """
    partial = folder.with_name(f".{folder.name}.partial")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
        _write_bundle(plan.bundle, partial)
        drawn = stored_picture(plan.graph.network)
        if drawn is not None:
            (partial / DIAGRAM).write_text(drawn, encoding="utf-8")
        for variant in plan.variants:
            if variant.name != BASELINE:
                _write_bundle(variant.bundle, partial / VARIANTS / variant.slug)
        (partial / PLAN).write_text(dump_yaml(plan.to_dict()), encoding="utf-8")
        Index.create(partial / INDEX, plan.columns)
        partial.rename(folder)
    except OSError as error:
        shutil.rmtree(partial, ignore_errors=True)
        raise UsageError(f"cannot write '{folder}': {error.strerror or error}") from None


def _write_bundle(bundle: GraphBundle, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / GRAPH).write_text(bundle.text, encoding="utf-8")
    for name, content in bundle.beside:
        (folder / name).write_bytes(content)


def read_plan(folder: Path) -> dict[str, Any]:
    """The plan of a sweep or an ablation, as plain values.

    Raises
    ------
    UsageError : there is no plan, or it cannot be read.
    """
    path = folder / PLAN
    try:
        stored = parse_yaml(path.read_text(encoding="utf-8"), str(path)).plain()
    except (OSError, UnicodeDecodeError, GraphError) as error:
        raise UsageError(f"cannot read the plan of '{folder}': {error}") from None
    if not isinstance(stored, dict) or stored.get("schema_version") != SCHEMA_VERSION:
        raise UsageError(f"'{path}' is not a plan of this version of the program")
    try:
        found = {"ends": {}, "never": {}, **stored}  # plans of earlier versions have neither
        check_form(found, {"ends": dict, "never": dict})
        for name, ends in found["ends"].items():
            low, high = map(float, ends)
            found["ends"][name] = (low, high)
    except (TypeError, ValueError) as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    return found


def check_same(plan: ExperimentPlan, folder: Path) -> None:
    """Check that a folder belongs to the same plan, and contains no links.

    Raises
    ------
    UsageError : it does not; the message lists the differences.
    """
    _refuse_links(folder)
    stored = read_plan(folder)
    try:
        text = (folder / GRAPH).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read '{folder / GRAPH}': {error}") from None
    if stored.get("digest") == plan.digest:
        return
    mine = {"kind": plan.kind, **plan.specification, "metrics": list(plan.metrics)}
    keys = dict.fromkeys([*mine, *("vary", "random", "sobol", "sampling_seed", "variants")])
    differing = [
        f"{key}: {_short(stored.get(key))} there, {_short(mine.get(key))} here"
        for key in keys
        if stored.get(key) != mine.get(key)
    ]
    if text != plan.bundle.text or not differing:
        differing.append("the graph")
    raise UsageError(
        f"'{folder}' belongs to a different plan, which differs in {'; '.join(differing)}; "
        f"{_ALTERNATIVES[plan.kind]}"
    )


def _refuse_links(folder: Path) -> None:
    """Refuse to write into a folder with links: their targets could be written or deleted."""
    with system_errors(f"read '{folder}'"):
        for path in [*folder.iterdir(), *folder.glob("*/*")]:
            if path.is_symlink():
                raise UsageError(
                    f"'{path}' is a link, which is not followed when a folder is continued; "
                    "replace it by what it points to"
                )


def _short(value: Any) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
