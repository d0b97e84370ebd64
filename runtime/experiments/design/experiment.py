"""``experiment.yaml``: a graph, what to change in it, and with which seeds.

In: the name of a file, or of a graph. Out: :class:`Experiment`, checked; all problems of the file
are reported together, with line and column::

    {graph: case_a, set: {lqr.q.0: 2}, vary: {params.v_r: [1, 2]}, variants: {none: {without: snn}}}
    ->  Experiment(graph with q, entries with one factor, one variant)
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from runtime.document import (
    SHIPPED,
    Node,
    check_keys,
    decode,
    find_file,
    parse_yaml,
    read_file,
    strings,
)
from runtime.errors import (
    NOWHERE,
    GraphError,
    Location,
    MissingExtraError,
    Problems,
    UsageError,
    Where,
)
from runtime.experiments.design.checks import check_change
from runtime.experiments.design.entries import (
    QUESTION_KEYS,
    SWEEP_KEYS,
    TUNING_KEYS,
    Entries,
    read_entries,
)
from runtime.experiments.design.factors import plain_value
from runtime.experiments.design.measurements import KEYS as DATA_KEYS
from runtime.experiments.design.measurements import Measurement, read_measurements
from runtime.experiments.design.objective import Objective
from runtime.experiments.design.recognition import is_experiment
from runtime.experiments.design.sampling import Design
from runtime.experiments.design.seeds import Seeds
from runtime.experiments.design.variants import GraphVariant
from runtime.files import slug
from runtime.graph import Graph, load

TUNED = "tuning:"  # before the name of a tuning, in ``with``
CHANGES = ("with", "set", "wire", "without", "bypass", "replace")
# Further keys of plan.yaml, which is an experiment file as well.
PLAN_KEYS = (
    *("schema_version", "kind", "metrics", "units", "ends", "never", "total", "digest", "checks"),
    *("provenance", "optimizer"),
    *("points", "made"),  # total and provenance, in plans of schema 1
)
KEYS = (
    *("experiment", "graph", "until", *CHANGES, "seeds", *SWEEP_KEYS, "variants", "data"),
    "contestants",
    *QUESTION_KEYS,
    *(*TUNING_KEYS, *PLAN_KEYS),
)
VARIANT_KEYS = ("graph", "until", *CHANGES, "changes")
# What uses each section that not all do; elsewhere it would change nothing without a word.
_COMPARING = ("sweep", "ablation")
USED_BY = {
    "vary": ("sweep", "ablation", "tuning", "fit"),
    **dict.fromkeys(("random", "sobol", "variants", *QUESTION_KEYS), _COMPARING),
    **dict.fromkeys(("sampling_seed", "minimize", "maximize"), (*_COMPARING, "tuning")),
    **dict.fromkeys(TUNING_KEYS, ("tuning", "contest")),
    "contestants": ("contest",),
    "data": ("fit",),
}
USED_BY |= {key: (*USED_BY[key], "contest") for key in ("minimize", "maximize", "margin")}
VERBS = {
    **{"sweep": "sweep", "ablation": "ablate", "tuning": "tune"},
    **{"contest": "contest", "fit": "fit"},
}
Change = Callable[[Graph], Graph]


@dataclass(frozen=True)
class Experiment:
    """What to run: a graph, what is varied in it, and ``variants`` of it; ``path`` is its file.

    ``data`` is what was measured, which a fit compares the graph with; ``contestants`` are tunings
    of other graphs with the same runs; ``sections`` are the keys
    that the file has, with their positions.
    """

    name: str
    graph: Graph
    entries: Entries = field(default_factory=Entries)
    variants: tuple[GraphVariant, ...] = ()
    path: Path | None = None
    data: tuple[Measurement, ...] = ()
    contestants: tuple[Experiment, ...] = ()
    sections: Mapping[str, Where] = field(default_factory=dict)

    def check_used(self, kind: str) -> None:
        """Check that a sweep, an ablation, a tuning or a fit uses every section of the file.

        Raises
        ------
        GraphError : it does not use one.
        """
        problems = Problems()
        for key, where in self.sections.items():
            users = USED_BY.get(key, (kind,))
            if kind not in users:
                others = " and ".join(f"'runtime {VERBS[user]}'" for user in users)
                message = f"'runtime {VERBS[kind]}' does not use it, but {others}; "
                problems.add(where, key, f"{message}move it to a file of its own")
        problems.raise_any()

    @property
    def seeds(self) -> Seeds | None:
        return self.entries.seeds

    @property
    def objective(self) -> Objective | None:
        """The objective of a sweep: the first one."""
        return next(iter(self.entries.objectives), None)

    @property
    def design(self) -> Design:
        """All combinations of the factors' values, or samples of them."""
        method, samples = self.entries.sampling or ("grid", 0)
        return Design(self.entries.factors, method, samples, self.entries.sampling_seed or 0)


def read_experiment(
    source: str, change: Change = lambda graph: graph, *, modules: bool = True
) -> Experiment:
    """Read an experiment file, or a graph as an experiment without factors and variants.

    Parameters
    ----------
    source : a file, or the name of a shipped graph.
    change : applied to the baseline, before variants are made from it.
    modules : whether Python files named by the graphs may be imported.

    Raises
    ------
    GraphError : with every problem of the file.
    """
    path = find_file(source, (NOWHERE, ""), Path())
    document = parse_yaml(decode(read_file(path, (NOWHERE, "")), path), str(path))
    if not is_experiment(document):
        graph = change(load(source, modules=modules))
        return Experiment(slug(graph.title), graph, path=path)
    reader = _ExperimentReader(document, path.parent, change, partial(load, modules=modules))
    return replace(reader.read(path.stem), path=path)


def check_experiment(
    document: Node,
    path: Path,
    load_graph: Callable[[str], Graph],
    change: Change = lambda graph: graph,
    unsaved: Mapping[Path, str] | None = None,
) -> None:
    """Check an experiment whose text is in memory.

    Parameters
    ----------
    document : the parsed text; path : its file, which need not exist.
    load_graph : loads the graphs that it names.
    change : applied to the baseline, as for :func:`read_experiment`.
    unsaved : texts that replace the content of files laid over a graph, by resolved path.

    Raises
    ------
    GraphError, UsageError : what is wrong.
    """
    experiment = _ExperimentReader(document, path.parent, change, load_graph, unsaved).read(
        path.stem
    )
    problems = Problems()
    for variant in experiment.variants:
        written = (document.get("variants") or document).get(variant.name) or document
        try:
            check_change(experiment.graph, f"variant {variant.name}", variant.graph)
        except GraphError as error:
            for problem in error.problems:
                where = _position(problem.where, written.key)
                text = f"{problem.address}: {problem.text}".removeprefix(": ")
                problems.add(where, f"variants.{variant.name}", text, problem.is_name)
        except MissingExtraError:
            continue  # a package that only a run needs
    problems.raise_any()


def _position(where: Where, otherwise: Where) -> Where:
    """The position of a change, which a graph knows as a string; or that of its variant."""
    _, _, rest = where.file.partition(f"{Path(otherwise.file).name}:")
    line, _, column = rest.partition(":")
    if where.line or not (line.isdecimal() and column.isdecimal()):
        return where if where.line else otherwise
    return Where(otherwise.file, int(line), int(column))


@dataclass
class _ExperimentReader:
    """Reads one file; continues after a problem as long as the rest can be checked."""

    document: Node
    folder: Path
    change: Change
    load: Callable[[str], Graph]
    unsaved: Mapping[Path, str] | None = None

    def __post_init__(self) -> None:
        self.problems = Problems()

    def read(self, otherwise: str) -> Experiment:
        document, problems = self.document, self.problems
        check_keys(document, KEYS, "", problems, "key")
        name = document.get("experiment")
        if name is not None and (not isinstance(name.value, str) or slug(name.value) != name.value):
            message = f"expected a name of letters, digits, '_', '-' and '.', got {name.describe()}"
            problems.add(name.where, "experiment", message)
        graph = self.graph(document, "", required=True)
        if graph is None:
            problems.raise_any()
            raise UsageError("no graph is given")
        # Before the entries are read: most of them can only be checked on a graph that is valid.
        try:
            graph = self.change(graph).check()
        except GraphError as error:
            problems.items += error.problems
            problems.raise_any()
        experiment = Experiment(
            name=str(name.value) if name is not None else slug(otherwise),
            graph=graph,
            entries=read_entries(
                *(document, graph, problems),
                lambda node, address: self.named_variants(node, address, graph),
            ),
            variants=tuple(self.variants(graph)),
            data=tuple(self.measurements(graph)),
            contestants=tuple(self.contestants(graph)),
            sections={key: node.key for key, node in document.items()},
        )
        problems.raise_any()
        return experiment

    def graph(self, node: Node, address: str, required: bool = False) -> Graph | None:
        """The graph that an entry names, with the changes that the entry makes."""
        named = node.get("graph")
        prefix = f"{address}." if address else ""
        if named is None and required:
            message = "missing; expected a graph's file or name, as in graph: line_actuator_failure"
            self.problems.add(node.where, f"{prefix}graph", message)
        if named is None or not isinstance(named.value, str):
            if named is not None:
                message = f"expected a graph's file or name, got {named.describe()}"
                self.problems.add(named.where, f"{prefix}graph", message)
            return None
        try:
            file = find_file(named.value, (named.where, f"{prefix}graph"), self.folder)
            return self.apply_changes(self.load(str(file)), node, prefix)
        except GraphError as error:
            self.problems.items += error.problems
            return None

    def apply_changes(self, graph: Graph, node: Node, prefix: str) -> Graph:
        """A graph with an entry's changes, in the order in which they are written."""
        for kind, item in node.items():
            if kind == "until":
                graph = graph.set("run.until", item.plain(), origin=str(item.where))
            elif kind in CHANGES:
                try:
                    graph = self.apply_change(graph, kind, item, f"{prefix}{kind}")
                except UsageError as error:
                    self.problems.add(item.where, f"{prefix}{kind}", str(error))
        return graph

    def apply_change(self, graph: Graph, kind: str, node: Node, address: str) -> Graph:
        if kind in ("set", "wire", "replace"):
            if not node.is_map:
                message = f"expected a mapping, as in {kind}: {{lqr.q: ...}}, got {node.describe()}"
                self.problems.add(node.where, address, message)
            for key, item in node.items():
                value, origin = plain_value(item, f"{address}.{key}"), str(item.where)
                if kind == "replace":
                    value = self.type_name(item, f"{address}.{key}")
                elif key == "world" and isinstance(value, str):
                    value = self.world(value, (item.where, f"{address}.world"))
                graph = getattr(graph, kind)(key, value, origin=origin)
            return graph
        names = strings(node, address, "a name", self.problems)
        if kind != "with":
            changed: Graph = getattr(graph, kind)(
                *(n.value for n, _ in names), origin=str(node.where)
            )
            return changed
        for item, place in names:
            if item.value.startswith(TUNED):
                graph = self.with_tuned(graph, item, place)
                continue
            path = find_file(item.value, (item.where, place), self.folder)
            graph = graph.overlay(path, self.unsaved)
        return graph

    def with_tuned(self, graph: Graph, node: Node, address: str) -> Graph:
        """A graph with the values that won a tuning: ``tuning:NAME``, or its folder."""
        name = node.value.removeprefix(TUNED)
        places = [self.folder / name, self.folder / "tunings" / name, Path("tunings") / name]
        for path in (place / "tuning.json" for place in places):
            if path.is_file():
                try:
                    stored = json.loads(path.read_text(encoding="utf-8"))
                    winner = (*stored["front"], 0)[0]
                    values = stored["configurations"][winner]["values"] or {}
                except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
                    raise UsageError(f"'{path}' is not a tuning: {error}") from None
                for key, value in values.items():
                    graph = graph.set(key, value, origin=str(node.where))
                return graph
        message = f"there is no tuning '{name}': expected {places[0]} or {places[1]}"
        self.problems.add(node.where, address, message)
        return graph

    def world(self, name: str, at: Location) -> str:
        """The world of that name: shipped, or a file relative to this one."""
        path = find_file(name, at, self.folder, "world")
        return name if path.is_relative_to(SHIPPED) else str(path.resolve())

    def type_name(self, node: Node, address: str) -> str:
        if not isinstance(node.value, str):
            self.problems.add(node.where, address, f"expected a type, got {node.describe()}")
            self.problems.raise_any()
        module, colon, kind = str(node.value).rpartition(":")
        return f"{self.folder / module}:{kind}" if colon else kind

    def variants(self, graph: Graph) -> list[GraphVariant]:
        section = self.document.get("variants")
        return [] if section is None else self.named_variants(section, "variants", graph)

    def contestants(self, graph: Graph) -> Iterable[Experiment]:
        """Each contestant as a tuning of its own: its graph, its factors, and all other entries."""
        section = self.document.get("contestants")
        if section is None:
            return
        for each in self.named_variants(section, "contestants", graph, (*VARIANT_KEYS, "vary")):
            document = self.document.with_item("vary", section.value[each.name].get("vary"))
            try:
                changed = each.graph.check()
            except GraphError as error:
                self.problems.items += error.problems
                continue
            entries = read_entries(
                *(document, changed, self.problems),
                partial(self._conditions, graph=changed),
            )
            yield Experiment(each.name, changed, entries)

    def _conditions(self, node: Node, address: str, graph: Graph) -> list[GraphVariant]:
        return self.named_variants(node, address, graph)

    def measurements(self, graph: Graph) -> Iterable[Measurement]:
        section = self.document.get("data")
        if section is None:
            return ()
        variants = self.named_variants(section, "data", graph, (*VARIANT_KEYS, *DATA_KEYS))
        return read_measurements(section, variants, self.folder, self.problems)

    def named_variants(
        self, section: Node, address: str, graph: Graph, keys: Sequence[str] = VARIANT_KEYS
    ) -> list[GraphVariant]:
        """The graphs of a section that maps names to changes of a graph, and other ``keys``."""
        if not section.is_map:
            message = f"expected {{name: changes}}, got {section.describe()}"
            self.problems.add(section.where, address, message)
            return []
        variants = []
        for name, node in section.items():
            place = f"{address}.{name}"
            if not node.is_map:
                message = f"expected changes, as in {{without: adaptive}}, got {node.describe()}"
                self.problems.add(node.where, place, message)
                continue
            check_keys(node, keys, place, self.problems, "key")
            base = graph
            if node.get("graph") is not None:
                base = self.graph(node, place) or graph
            else:
                try:
                    base = self.apply_changes(graph, node, f"{place}.")
                except GraphError as error:
                    self.problems.items += error.problems
            variants.append(self.variant(name, node, base, graph))
        return variants

    def variant(self, name: str, node: Node, changed: Graph, baseline: Graph) -> GraphVariant:
        message = node.get("changes")
        if message is not None:
            return GraphVariant(name, changed, tuple(map(str, message.plain())))
        other = node.get("graph")
        if other is not None:
            return GraphVariant(
                name, changed, (f"graph {other.value}", *map(str, changed.overrides))
            )
        return GraphVariant.of(name, changed, baseline)
