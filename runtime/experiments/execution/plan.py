"""The plan of a sweep or an ablation: what fixes its numbers, and its folder."""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

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
    points_of,
    varied,
)
from runtime.graph import Graph
from runtime.runs import DIAGRAM

SCHEMA_VERSION = 1
PLAN, GRAPH, INDEX = "plan.yaml", "graph.resolved.yaml", "index.csv"
VARIANTS = "variants"
TABLE, DIAGRAMS, RUNS = "ablation.json", "diagrams", "runs"
SUMMARY = "summary.json"
Kind = Literal["sweep", "ablation"]
Note = Callable[[str], None]
_WAYS_ON: dict[Kind, str] = {
    "sweep": "--name NAME begins another sweep beside it; to go on with that one, repeat its own "
    "command with --resume",
    "ablation": "without --resume, another folder is begun",
}


@dataclass(frozen=True)
class Case:
    """A variant as it travels. ``slug`` is its name as a file's."""

    name: str
    slug: str
    bundle: GraphBundle
    changes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Plan:
    """All that fixes the numbers of a sweep (``design``) or an ablation (``cases``)."""

    kind: Kind
    name: str
    graph: Graph
    bundle: GraphBundle
    seeds: Seeds
    metrics: tuple[str, ...]
    design: Design
    cases: tuple[Case, ...] = ()
    objective: Objective | None = None

    @property
    def columns(self) -> Columns:
        factors = tuple(factor.path for factor in self.design.factors)
        return Columns(factors if self.kind == "sweep" else ("variant",), self.metrics)

    @property
    def total(self) -> int:
        """How many points there are."""
        configurations = len(self.design) if self.kind == "sweep" else len(self.cases)
        return configurations * len(self.seeds)

    def configurations(self) -> Iterator[Configuration]:
        """What is compared, one after the other."""
        if self.kind == "sweep":
            return varied(
                self.bundle, tuple(k.path for k in self.design.factors), iter(self.design)
            )
        return (Configuration(i, (case.name,), case.bundle) for i, case in enumerate(self.cases))

    def points(self) -> Iterator[Trial]:
        """All points, in the order in which they are sent out."""
        return points_of(self.configurations(), self.seeds)

    @property
    def asked(self) -> dict[str, Any]:
        """The plan in the words of an experiment file, but for its graph."""
        asked: dict[str, Any] = {"seeds": str(self.seeds)}
        if self.kind == "sweep":
            asked["vary"] = {factor.path: factor.written for factor in self.design.factors}
            if self.design.method != "grid":
                asked[self.design.method] = self.design.samples
                asked["sampling_seed"] = self.design.seed
        else:
            asked["variants"] = {
                case.name: {"graph": f"{VARIANTS}/{case.slug}/{GRAPH}", "changes": [*case.changes]}
                for case in self.cases
                if case.name != BASELINE
            }
        return asked

    @property
    def digest(self) -> str:
        """A hash of all that fixes the numbers."""
        recipes = [self.bundle.digest, *(case.bundle.digest for case in self.cases)]
        content = json.dumps([self.kind, recipes, self.asked, self.metrics])
        return hashlib.sha256(content.encode()).hexdigest()

    def to_dict(self) -> dict[str, Any]:
        """plan.yaml."""
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
            **self.asked,
            **goal,
            "metrics": list(self.metrics),
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


def sweep_plan(experiment: Experiment, seeds: Seeds, note: Note = silent) -> Plan:
    """The plan of a sweep; ``note`` is told what would make it faster."""
    graph, design = experiment.graph, experiment.design
    metrics = metrics_of(graph)
    objective = experiment.objective
    if objective is None and metrics:
        objective = Objective(metrics[0])
    engine = _engine(graph, len(design) * len(seeds), note)
    plan = Plan(
        *("sweep", experiment.name, graph, _recipe(graph, engine), seeds, metrics, design),
        objective=objective,
    )
    return _checked(plan)


def ablation_plan(
    experiment: Experiment, variants: list[Variant], seeds: Seeds, note: Note = silent
) -> Plan:
    """The plan of an ablation; the baseline is its first case."""
    graph = experiment.graph
    engine = _engine(graph, (1 + len(variants)) * len(seeds), note)
    bundle, metrics = _recipe(graph, engine), metrics_of(graph)
    names = slugs([BASELINE, *(variant.name for variant in variants)])
    cases = [Case(BASELINE, names[BASELINE], bundle)]
    for variant in variants:
        travelling = _recipe(variant.graph, engine)
        cases.append(Case(variant.name, names[variant.name], travelling, variant.changes))
    design = Design(())
    return _checked(
        Plan("ablation", experiment.name, graph, bundle, seeds, metrics, design, tuple(cases))
    )


def _engine(graph: Graph, runs: int, note: Note) -> str:
    """The engine of all points, decided once: rows of two engines are not to be compared."""
    return "compiled" if take_compiled(graph.network, runs, note) else "python"


def _recipe(graph: Graph, engine: str) -> GraphBundle:
    is_open = graph.network.engine == "auto"
    return GraphBundle.of(graph.set("run.engine", engine) if is_open else graph)


def metrics_of(graph: Graph) -> tuple[str, ...]:
    """Names of a graph's metrics."""
    return tuple(metric.name for metric in graph.observation.metrics)


def _checked(plan: Plan) -> Plan:
    header = plan.columns.header
    for name in plan.metrics:
        if header.count(name) > 1:
            taken = f"taken by a column of {INDEX}: {', '.join(RESERVED)}"
            raise UsageError(f"metric '{name}': the name is {taken}; rename the metric")
    return plan


def create(plan: Plan, folder: Path) -> None:
    """Make a plan's folder, which appears only when it is complete.

    Raises
    ------
    UsageError : it cannot be written.
    """
    partial = folder.with_name(f".{folder.name}.partial")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
        _write_recipe(plan.bundle, partial)
        drawn = stored_picture(plan.graph.network)
        if drawn is not None:
            (partial / DIAGRAM).write_text(drawn, encoding="utf-8")
        for case in plan.cases:
            if case.name != BASELINE:
                _write_recipe(case.bundle, partial / VARIANTS / case.slug)
        (partial / PLAN).write_text(dump_yaml(plan.to_dict()), encoding="utf-8")
        Index.create(partial / INDEX, plan.columns)
        partial.rename(folder)
    except OSError as error:
        shutil.rmtree(partial, ignore_errors=True)
        raise UsageError(f"cannot write '{folder}': {error.strerror or error}") from None


def _write_recipe(bundle: GraphBundle, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / GRAPH).write_text(bundle.text, encoding="utf-8")
    for name, text in bundle.modules:
        (folder / name).write_text(text, encoding="utf-8")


def read_plan(folder: Path) -> dict[str, Any]:
    """The plan of a sweep or an ablation, as plain values.

    Raises
    ------
    UsageError : there is none that can be read.
    """
    path = folder / PLAN
    try:
        stored = parse_yaml(path.read_text(encoding="utf-8"), str(path)).plain()
    except (OSError, UnicodeDecodeError, GraphError) as error:
        raise UsageError(f"'{folder}' holds no plan that can be read: {error}") from None
    if not isinstance(stored, dict) or stored.get("schema_version") != SCHEMA_VERSION:
        raise UsageError(f"'{path}' is no plan of this version of the program")
    return stored


def check_same(plan: Plan, folder: Path) -> None:
    """Check that a folder is of the same plan, and holds nothing that leads out of it.

    Raises
    ------
    UsageError : it is not; the message says in what they differ.
    """
    _refuse_links(folder)
    stored = read_plan(folder)
    try:
        text = (folder / GRAPH).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read '{folder / GRAPH}': {error}") from None
    if stored.get("digest") == plan.digest:
        return
    mine = {"kind": plan.kind, **plan.asked, "metrics": list(plan.metrics)}
    keys = dict.fromkeys([*mine, *("vary", "random", "sobol", "sampling_seed", "variants")])
    differing = [
        f"{key}: {_short(stored.get(key))} there, {_short(mine.get(key))} here"
        for key in keys
        if stored.get(key) != mine.get(key)
    ]
    if text != plan.bundle.text or not differing:
        differing.append("the graph")
    raise UsageError(
        f"'{folder}' is of another plan, which differs in {'; '.join(differing)}; "
        f"{_WAYS_ON[plan.kind]}"
    )


def _refuse_links(folder: Path) -> None:
    """Refuse to write into a folder with links: what they lead to would be written or deleted."""
    try:
        for path in [*folder.iterdir(), *folder.glob("*/*")]:
            if path.is_symlink():
                raise UsageError(
                    f"'{path}' is a link, which is not followed when a folder is gone on with; "
                    "put what it leads to in its place"
                )
    except OSError as error:
        raise UsageError(f"cannot read '{folder}': {error.strerror or error}") from None


def _short(value: Any) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
