"""``experiment.yaml``: a graph, what to change in it, and with which seeds.

In: the name of a file, or of a graph. Out: :class:`Experiment`, checked; all problems of the file
are reported together, with line and column::

    {graph: case_a, set: {lqr.q.0: 2}, vary: {params.v_r: [1, 2]}, variants: {none: {without: snn}}}
    ->  Experiment(graph with q, entries with one factor, one variant)
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from blocks.messages import Message
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
    Problem,
    Problems,
    UsageError,
    Where,
)
from runtime.experiments.design.checks import check_change
from runtime.experiments.design.entries import (
    COMPARING,
    ENTRY_KEYS,
    Entries,
    read_entries,
    read_plain_entries,
)
from runtime.experiments.design.factors import plain_value
from runtime.experiments.design.measurements import KEYS as DATA_KEYS
from runtime.experiments.design.measurements import Measurement, read_measurements
from runtime.experiments.design.objective import Objective
from runtime.experiments.design.recognition import is_experiment
from runtime.experiments.design.sampling import Design
from runtime.experiments.design.seeds import Seeds
from runtime.experiments.design.variants import GraphVariant
from runtime.files import read_json, slug
from runtime.graph import Graph, load

TUNED = "tuning:"  # before the name of a tuning, in ``with``
CHANGES = ("with", "set", "wire", "without", "bypass", "replace")
# Further keys of plan.yaml, which is an experiment file as well; points and made are of schema 1.
PLAN_KEYS = (
    "schema_version",
    "kind",
    "metrics",
    "units",
    "ends",
    "never",
    "total",
    "digest",
    "checks",
    "provenance",
    "optimizer",
    "points",
    "made",
)
# The kinds of experiments that use each section; all where there is none.
USED_BY = {**ENTRY_KEYS, "variants": COMPARING, "data": ("fit",), "contestants": ("contest",)}
KEYS = tuple(dict.fromkeys(["experiment", "graph", "until", *CHANGES, *USED_BY, *PLAN_KEYS]))
VARIANT_KEYS = ("graph", "until", *CHANGES, "changes")
VERBS = {"ablation": "ablate", "tuning": "tune"}  # where they are not called as the kind
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
            users = USED_BY.get(key, ())
            if users and kind not in users:
                others = " and ".join(f"'runtime {VERBS.get(user, user)}'" for user in users)
                message = f"'runtime {VERBS.get(kind, kind)}' does not use it, but {others}; "
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
    _ExperimentReader(document, path.parent, change, load_graph, unsaved).read(path.stem)


def _names(node: Node) -> list[str]:
    """The names in an entry that is a string or a list of strings."""
    items = node.value if node.is_list else [node]
    return [str(item.value) for item in items]


def _position(where: Where, otherwise: Where) -> Where:
    """The position of a change, which a graph knows as a string; or that of its variant."""
    _, _, rest = where.file.partition(f"{Path(otherwise.file).name}:")
    line, _, column = rest.partition(":")
    if where.line or not (line.isdecimal() and column.isdecimal()):
        return where if where.line or where.file.startswith("--") else otherwise
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
        self.blamed = set[str]()  # what a change that was reported concerns

    def read(self, otherwise: str) -> Experiment:
        document, problems = self.document, self.problems
        check_keys(document, KEYS, "", problems, "key")
        name = document.get("experiment")
        if name is not None and (not isinstance(name.value, str) or slug(name.value) != name.value):
            message = f"expected a name of letters, digits, '_', '-' and '.', got {name.describe()}"
            problems.add(name.where, "experiment", message)
        graph = self.baseline()
        if graph is None:
            # Most entries can only be checked on a graph that is valid.
            read_plain_entries(document, problems)
            problems.raise_any()
            raise UsageError("no graph is given")
        experiment = Experiment(
            name=str(name.value) if name is not None else slug(otherwise),
            graph=graph,
            entries=read_entries(
                document,
                graph,
                problems,
                lambda node, address: self.read_variants(node, address, graph),
            ),
            variants=tuple(self.variants(graph)),
            data=tuple(self.measurements(graph)),
            contestants=tuple(self.contestants(graph)),
            sections={
                key: node.key
                for key, node in document.items()
                if key != "metrics" or document.get("schema_version") is None
            },
        )
        problems.raise_any()
        return experiment

    def baseline(self) -> Graph | None:
        """The graph of the whole experiment; None if there is none that is valid.

        Where only the changes of the experiment are wrong, this is the graph without them, so that
        what else is wrong is reported, too.
        """
        named = self.graph(self.document, "", required=True)
        if named is None:
            return None
        try:
            return self.change(self.apply_changes(named, self.document, "")).check()
        except GraphError as error:
            self.report(error, "", self.document.where)
        self.blamed = {
            key.partition(".")[0]
            for kind in CHANGES
            if (item := self.document.get(kind)) is not None
            for key in ([key for key, _ in item.items()] if item.is_map else _names(item))
        }
        try:
            return named.check()
        except GraphError:
            return None

    def report(
        self, error: GraphError, place: str, otherwise: Where, blamed: Container[str] = ()
    ) -> None:
        """Report what is wrong with a changed graph, in the name of the entry that changes it.

        What concerns ``blamed`` blocks follows from changes that were reported already.
        """
        for problem in error.problems:
            if problem.address.removeprefix("blocks.").partition(".")[0] in blamed:
                continue
            address, text = problem.address, problem.text
            if place and not address.startswith(place):
                address, text = place, f"{address}: {text}".removeprefix(": ")
            message = Message(text, problem.kind, problem.fixes)
            self.problems.add(_position(problem.where, otherwise), address, message)

    def graph(self, node: Node, address: str, required: bool = False) -> Graph | None:
        """The graph that an entry names, without the changes that the entry makes."""
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
            return self.load(str(file))
        except GraphError as error:
            self.report(error, address, named.where)
            return None

    def apply_changes(self, graph: Graph, node: Node, place: str) -> Graph:
        """A graph with an entry's changes, in the order in which they are written.

        What cannot be made is reported, and left out.
        """
        prefix = f"{place}." if place else ""
        for kind, item in node.items():
            for name, one in self.single_changes(kind, item, f"{prefix}{kind}"):
                try:
                    graph = self.apply_change(graph, kind, name, one, f"{prefix}{kind}")
                except GraphError as error:
                    self.report(error, place, one.where)
                    self.blamed.add(name.partition(".")[0])
                except UsageError as error:
                    self.problems.add(one.where, f"{prefix}{kind}", str(error))
        return graph

    def single_changes(self, kind: str, node: Node, address: str) -> Iterable[tuple[str, Node]]:
        """Each change of a kind by itself, with the path or the name that it changes."""
        if kind == "until":
            return [("run.until", node)]
        if kind in ("set", "wire", "replace"):
            if not node.is_map:
                message = f"expected a mapping, as in {kind}: {{lqr.q: ...}}, got {node.describe()}"
                self.problems.add(node.where, address, message)
            return node.items()
        if kind not in CHANGES:
            return ()
        return [(item.value, item) for item, _ in strings(node, address, "a name", self.problems)]

    def apply_change(self, graph: Graph, kind: str, name: str, node: Node, address: str) -> Graph:
        """A graph with one change."""
        changed: Graph
        origin = str(node.where)
        if kind in ("without", "bypass"):
            changed = getattr(graph, kind)(name, origin=origin)
            return changed
        if kind == "with":
            if name.startswith(TUNED):
                return self.apply_tuning(graph, node, address)
            path = find_file(name, (node.where, address), self.folder)
            return graph.overlay(path, self.unsaved)
        value = plain_value(node, f"{address}.{name}")
        if kind == "replace":
            value = self.type_name(node, f"{address}.{name}")
        elif name == "world" and isinstance(value, str):
            value = self.world(value, (node.where, f"{address}.world"))
        changed = getattr(graph, "set" if kind == "until" else kind)(name, value, origin=origin)
        return changed

    def apply_tuning(self, graph: Graph, node: Node, address: str) -> Graph:
        """A graph with the values that won a tuning: ``tuning:NAME``, or its folder."""
        name = node.value.removeprefix(TUNED)
        places = [self.folder / name, self.folder / "tunings" / name, Path("tunings") / name]
        for path in (place / "tuning.json" for place in places):
            if path.is_file():
                try:
                    stored = read_json(path)
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
            text = f"expected a type, got {node.describe()}"
            raise GraphError([Problem(node.where, address, text)])
        module, colon, kind = str(node.value).rpartition(":")
        return f"{self.folder / module}:{kind}" if colon else kind

    def variants(self, graph: Graph) -> list[GraphVariant]:
        section = self.document.get("variants")
        return [] if section is None else self.read_variants(section, "variants", graph)

    def contestants(self, graph: Graph) -> Iterable[Experiment]:
        """Each contestant as a tuning of its own: its graph, its factors, and all other entries."""
        section = self.document.get("contestants")
        if section is None:
            return
        for each in self.read_variants(section, "contestants", graph, (*VARIANT_KEYS, "vary")):
            document = self.document.with_item("vary", section.value[each.name].get("vary"))
            own = partial(self.read_variants, graph=each.graph)
            entries = read_entries(document, each.graph, self.problems, own)
            yield Experiment(each.name, each.graph, entries)

    def measurements(self, graph: Graph) -> Iterable[Measurement]:
        section = self.document.get("data")
        if section is None:
            return ()
        variants = self.read_variants(section, "data", graph, (*VARIANT_KEYS, *DATA_KEYS))
        return read_measurements(section, variants, self.folder, self.problems)

    def read_variants(
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
            outside, known = self.blamed, len(self.problems.items)
            self.blamed = set(outside)
            base = graph if node.get("graph") is None else self.graph(node, place)
            changed = self.apply_changes(base or graph, node, place)
            try:
                check_change(graph, f"variant {place}", changed)
            except GraphError as error:
                self.report(error, place, node.key, self.blamed)
            except MissingExtraError:
                pass  # a package that only a run needs
            self.blamed = outside
            if len(self.problems.items) == known:
                variants.append(self.variant(name, node, changed, graph))
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
