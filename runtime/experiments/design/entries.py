"""The entries of an experiment, read and checked once for files, commands and calls.

In: a mapping of nodes, such as ``{vary: {lqr.q.0: 0.1..1:5}, seeds: 0..9, minimize: error}``. The
position of each node says where it was written: a line of a file, or ``--seeds 0..9``. Out:
:class:`Entries`. What a command adds is laid over what the file says::

    Entries(seeds=0..9, trials=50).overlay(Entries(trials=100))  ->  seeds 0..9, 100 trials
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

from runtime.document import Node, check_keys, strings
from runtime.errors import Problems, Where
from runtime.experiments.design.checks import check_factor, check_metric
from runtime.experiments.design.factors import Factor, parse_factor
from runtime.experiments.design.figures import FigureSpec, read_figure
from runtime.experiments.design.objective import Constraint, Objective
from runtime.experiments.design.sampling import Method
from runtime.experiments.design.seeds import Seeds, parse_seeds
from runtime.experiments.design.variants import GraphVariant
from runtime.graph import Graph

Sampler = Literal["tpe", "nsga2", "sobol", "random"]
Over = Literal["mean", "worst"]
RUN_KEYS = ("seeds", "conditions")
MOST_SAMPLES, MOST_TRIALS, MOST_BATCH, MOST_REPEATS = 10**9, 10**6, 4096, 1000
_CONSTRAINT = re.compile(r"\s*(?P<metric>\S+)\s+(?P<side>below|above)\s+(?P<bound>\S+)\s*")
# The seeds and the conditions of training or of held-out runs.
RunEntries = tuple[Seeds | None, tuple[GraphVariant, ...]]
# Which experiments use an entry; the others refuse it, since it would change nothing.
COMPARING = ("sweep", "ablation")
SEARCHING = ("tuning", "contest")


@dataclass
class _PlainReader:
    """Reads entries that need no graph; continues after a problem."""

    document: Node
    problems: Problems

    def refuse(self, node: Node, address: str, message: str) -> None:
        """Report a problem; what no file contains is named by its option, not by its address."""
        self.problems.add(node.where, address if node.where.line else "", message)

    def seeds(self, document: Node | None = None, prefix: str = "") -> Seeds | None:
        node = (document or self.document).get("seeds")
        if node is None:
            return None
        return parse_seeds(node, f"{prefix}seeds" if node.where.line else "", self.problems)

    def sampling(self) -> tuple[Method, int] | None:
        methods: tuple[Method, ...] = ("sobol", "random")
        methods_used = [
            (m, n) for m in methods if (n := self.whole(m, 1, MOST_SAMPLES)) is not None
        ]
        if len(methods_used) > 1:
            node = self.document.get("random") or self.document
            self.refuse(node, "random", "there is 'sobol' as well as 'random'; keep one")
        return methods_used[-1] if methods_used else None

    def whole(self, key: str, least: int, most: int) -> int | None:
        """An integer; None if there is none, or a wrong one."""
        node = self.document.get(key)
        if node is None:
            return None
        value = node.value
        # Not isinstance: true is an int to Python, but no number of trials.
        if type(value) is int and least <= value <= most:
            return value
        message = f"expected an integer from {least} to {most}, got {node.describe()}"
        self.refuse(node, key, message)
        return None

    def choice(self, key: str, choices: tuple[Any, ...]) -> Any:
        """One of some values of one type; None if there is none, or another."""
        node = self.document.get(key)
        if node is None:
            return None
        if node.value in choices and type(node.value) is type(choices[0]):
            return node.value
        expected = ", ".join(str(choice).lower() for choice in choices)
        self.refuse(node, key, f"expected one of {expected}, got {node.describe()}")
        return None

    def quantiles(self) -> Iterator[float]:
        """Those of ``0.9``, or of ``[0.1, 0.9]``, each once."""
        section, found = self.document.get("quantile"), set[float]()
        for node in [] if section is None else section.value if section.is_list else [section]:
            value = node.value
            if not isinstance(value, float) or not 0.0 < value < 1.0:
                message = f"expected a number between 0 and 1, as 0.9, got {node.describe()}"
                self.refuse(node, "quantile", message)
            elif value not in found:
                found.add(value)
                yield value


@dataclass
class _EntryReader(_PlainReader):
    """Reads those that are checked on a graph, too."""

    graph: Graph
    variants: Callable[[Node, str], list[GraphVariant]]

    def factors(self) -> Iterator[Factor]:
        vary = self.document.get("vary")
        if vary is not None and not vary.is_map:
            self.refuse(vary, "vary", f"expected {{path: values}}, got {vary.describe()}")
        for path, node in () if vary is None else vary.items():
            is_in_file = node.key.line > 0
            address = f"vary.{path}" if is_in_file else path
            factor = parse_factor(path, node, address, self.problems)
            if factor is not None:
                where = node.key if is_in_file else Where(node.where.file)
                check_factor(self.graph, factor, where, self.problems)
                yield factor

    def objectives(self) -> Iterator[Objective]:
        goals: tuple[Literal["minimize", "maximize"], ...] = ("minimize", "maximize")
        for goal in goals:
            node = self.document.get(goal)
            for item in [] if node is None else node.value if node.is_list else [node]:
                objective = Objective(str(item.value), goal)
                check_metric(self.graph, objective.metric, item.where, goal, self.problems)
                yield objective

    def constraints(self) -> Iterator[Constraint]:
        """Those of ``{effort: {below: 0.3}}``, or of ``[effort below 0.3]``."""
        section = self.document.get("constraints")
        if section is None:
            return
        example = "as in {effort: {below: 0.3}}"
        if section.is_list:
            yield from filter(None, map(self.constraint, section.value))
            return
        if not section.is_map:
            message = f"expected metrics with bounds, {example}, got {section.describe()}"
            self.refuse(section, "constraints", message)
            return
        for metric, node in section.items():
            address = f"constraints.{metric}"
            if not node.is_map:
                message = f"expected below or above, {example}, got {node.describe()}"
                self.refuse(node, address, message)
                continue
            check_keys(node, ("below", "above"), address, self.problems, "key")
            for side, bound in node.items():
                number = bound.value
                if isinstance(number, bool) or not isinstance(number, (int, float)):
                    message = f"expected a number, got {bound.describe()}"
                    self.refuse(bound, f"{address}.{side}", message)
                elif side in ("below", "above"):
                    check_metric(self.graph, metric, node.where, address, self.problems)
                    yield Constraint(metric, "below" if side == "below" else "above", float(number))

    def constraint(self, node: Node) -> Constraint | None:
        """The constraint that a string such as ``effort below 0.3`` describes."""
        match = _CONSTRAINT.fullmatch(node.value) if isinstance(node.value, str) else None
        try:
            bound = float(match["bound"]) if match else float("nan")
        except ValueError:
            bound = float("nan")
        if match is None or bound != bound:
            message = f"expected a constraint as 'effort below 0.3', got {node.describe()}"
            self.refuse(node, "constraints", message)
            return None
        address = "constraints" if node.where.line else ""
        check_metric(self.graph, match["metric"], node.where, address, self.problems)
        return Constraint(match["metric"], "below" if match["side"] == "below" else "above", bound)

    def primary(self) -> Iterator[str]:
        node = self.document.get("primary")
        for item in [] if node is None else node.value if node.is_list else [node]:
            check_metric(self.graph, str(item.value), item.where, "primary", self.problems)
            yield str(item.value)

    def metrics(self) -> Iterator[str]:
        """The metrics that are wanted."""
        for item, _ in strings(self.document.get("metrics"), "metrics", "a metric", self.problems):
            check_metric(self.graph, item.value, item.where, "metrics", self.problems)
            yield item.value

    def contrasts(self) -> Iterator[tuple[str, str]]:
        node = self.document.get("contrasts")
        for item in [] if node is None else node.value if node.is_list else [node]:
            pair = item.plain()
            if isinstance(pair, list) and len(pair) == 2 and all(isinstance(x, str) for x in pair):
                yield pair[0], pair[1]
            else:
                message = f"expected two variants, as in [[PID, LQR]], got {item.describe()}"
                self.refuse(item, "contrasts", message)

    def margins(self) -> Iterator[tuple[str, float | str]]:
        """Those of ``0.001``, ``5%``, ``{error: 0.001}``, or a list of ``error=0.001``."""
        section = self.document.get("margin")
        items = [] if section is None else section.value if section.is_list else [section]
        for node in items:
            for metric, item in node.items() if node.is_map else [("", node)]:
                value = item.value
                if isinstance(value, str) and "=" in value:
                    metric, _, value = (text.strip() for text in value.partition("="))
                try:
                    number = float(str(value).removesuffix("%"))
                except ValueError:
                    number = -1.0
                if isinstance(value, bool) or not 0.0 <= number < float("inf"):
                    message = f"expected a difference as 0.001 or 5%, got {item.describe()}"
                    self.refuse(item, "margin", message)
                    continue
                if metric:
                    check_metric(self.graph, metric, item.where, "margin", self.problems)
                yield metric, f"{number:g}%" if str(value).endswith("%") else number

    def figures(self) -> Iterator[FigureSpec]:
        section = self.document.get("figures")
        if section is not None and not section.is_map:
            self.refuse(section, "figures", f"expected figures by name, got {section.describe()}")
            return
        # Read again for their paths alone: what is wrong with them is reported once.
        vary, ignored = self.document.get("vary"), Problems()
        items = vary.items() if vary is not None and vary.is_map else ()
        factors = [f for path, node in items if (f := parse_factor(path, node, path, ignored))]
        for name, node in () if section is None else section.items():
            figure = read_figure(name, node, self.graph, factors, self.problems)
            if figure is not None:
                yield figure

    def runs(self, key: str) -> RunEntries:
        node = self.document.get(key)
        if node is None:
            return None, ()
        if not node.is_map:
            self.refuse(node, key, f"expected seeds and conditions, got {node.describe()}")
            return None, ()
        check_keys(node, RUN_KEYS, key, self.problems, "key")
        section = node.get("conditions")
        conditions = () if section is None else self.variants(section, f"{key}.conditions")
        return self.seeds(node, f"{key}."), tuple(conditions)


@dataclass(frozen=True)
class Entries:
    """What is written about an experiment besides its graph; None or empty where nothing is.

    Parameters
    ----------
    seeds : of all runs; of a tuning, of the training runs.
    factors, sampling, sampling_seed : what is varied; by which method how many samples of it.
    objectives : what is minimised or maximised, the first one for a sweep.
    constraints : what must hold for the winner of a tuning.
    trials, sampler, batch, over, stop_early : how a tuning searches; see :class:`Tuning`.
    training, held_out : the runs of a tuning.
    primary : metrics whose differences are tested, all if empty.
    contrasts : variants that are compared with each other, besides with the baseline.
    margins : the smallest differences that count, by metric; '' for all others.
    quantiles, worst : what the table shows of each metric besides its mean.
    figures : what is drawn besides the usual figures.
    budget : the most training runs of a tuning, those that were stopped early included.
    patience : trials per factor without a better one, after which a tuning ends.
    repeats : tunings with other seeds of the sampler.
    metrics : those that are wanted, besides what other entries name; all if empty.
    """

    seeds: Seeds | None = None
    factors: tuple[Factor, ...] = ()
    sampling: tuple[Method, int] | None = None
    sampling_seed: int | None = None
    objectives: tuple[Objective, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    trials: int | None = None
    sampler: Sampler | None = None
    batch: int | None = None
    over: Over | None = None
    stop_early: bool | None = None
    training: RunEntries = (None, ())
    held_out: RunEntries = (None, ())
    primary: tuple[str, ...] = ()
    contrasts: tuple[tuple[str, str], ...] = ()
    margins: tuple[tuple[str, float | str], ...] = ()
    quantiles: tuple[float, ...] = ()
    worst: bool | None = None
    figures: tuple[FigureSpec, ...] = ()
    budget: int | None = None
    patience: int | None = None
    repeats: int | None = None
    metrics: tuple[str, ...] = ()

    def overlay(self, other: Entries) -> Entries:
        """These entries with others over them: an entry of ``other`` replaces one of the same name.

        A factor replaces that of the same path, constraints are added.
        """
        replaced = {factor.path for factor in other.factors}
        merged: dict[str, Any] = {
            "factors": (*(f for f in self.factors if f.path not in replaced), *other.factors),
            "constraints": tuple(dict.fromkeys(self.constraints + other.constraints)),
            # The seeds of a command are those of training, whatever the file says of either.
            "training": (
                other.training[0] or other.seeds or self.training[0],
                other.training[1] or self.training[1],
            ),
            "held_out": (
                other.held_out[0] or self.held_out[0],
                other.held_out[1] or self.held_out[1],
            ),
        }
        for each in fields(self):
            value = getattr(other, each.name)
            is_absent = value is None or value == ()
            merged.setdefault(each.name, getattr(self, each.name) if is_absent else value)
        return Entries(**merged)


@dataclass(frozen=True)
class _Key:
    """How a field of :class:`Entries` is read.

    Parameters
    ----------
    read : the field's value from a reader; of an iterator, a tuple of its values.
    used_by : the kinds of experiments that use it; all if empty.
    keys : its names in a file, if it has another one there.
    """

    read: Callable[[Any], Any]
    used_by: tuple[str, ...] = SEARCHING
    keys: tuple[str, ...] = ()
    is_plain: bool = False

    def value(self, reader: _PlainReader) -> Any:
        value = self.read(reader)
        return tuple(value) if isinstance(value, Iterator) else value


def _whole(key: str, most: int, used_by: tuple[str, ...] = SEARCHING, least: int = 1) -> _Key:
    return _Key(lambda reader: reader.whole(key, least, most), used_by, is_plain=True)


def _choice(key: str, choices: tuple[Any, ...], used_by: tuple[str, ...] = SEARCHING) -> _Key:
    return _Key(lambda reader: reader.choice(key, choices), used_by, is_plain=True)


_FIELDS = {
    "seeds": _Key(_EntryReader.seeds, (), is_plain=True),
    "factors": _Key(_EntryReader.factors, (*COMPARING, "tuning", "fit"), ("vary",)),
    "sampling": _Key(_EntryReader.sampling, COMPARING, ("random", "sobol"), is_plain=True),
    "sampling_seed": _whole("sampling_seed", MOST_SAMPLES, (*COMPARING, "tuning"), least=0),
    "objectives": _Key(_EntryReader.objectives, COMPARING + SEARCHING, ("minimize", "maximize")),
    "constraints": _Key(_EntryReader.constraints),
    "trials": _whole("trials", MOST_TRIALS),
    "sampler": _choice("sampler", get_args(Sampler)),
    "batch": _whole("batch", MOST_BATCH),
    "over": _choice("over", get_args(Over)),
    "stop_early": _choice("stop_early", (True, False)),
    "training": _Key(lambda reader: reader.runs("training")),
    "held_out": _Key(lambda reader: reader.runs("held_out")),
    "primary": _Key(_EntryReader.primary, COMPARING),
    "contrasts": _Key(_EntryReader.contrasts, COMPARING),
    "margins": _Key(_EntryReader.margins, (*COMPARING, "contest"), ("margin",)),
    "quantiles": _Key(_EntryReader.quantiles, COMPARING, ("quantile",), is_plain=True),
    "worst": _choice("worst", (True, False), COMPARING),
    "figures": _Key(_EntryReader.figures, COMPARING),
    "budget": _whole("budget", MOST_TRIALS),
    "patience": _whole("patience", MOST_TRIALS),
    "repeats": _whole("repeats", MOST_REPEATS),
    "metrics": _Key(_EntryReader.metrics, COMPARING),
}
# The keys of an experiment file that are entries, and the kinds of experiments that use each.
ENTRY_KEYS = {key: each.used_by for name, each in _FIELDS.items() for key in each.keys or (name,)}


def read_entries(
    document: Node,
    graph: Graph,
    problems: Problems,
    variants: Callable[[Node, str], list[GraphVariant]] = lambda node, address: [],
) -> Entries:
    """The entries of a mapping, checked on a graph that is valid itself.

    Parameters
    ----------
    variants : reads a section of named changes, given with its address.
    """
    reader = _EntryReader(document, problems, graph, variants)
    return Entries(**{name: each.value(reader) for name, each in _FIELDS.items()})


def read_plain_entries(document: Node, problems: Problems) -> None:
    """Report what is wrong with the entries that can be checked without a graph."""
    reader = _PlainReader(document, problems)
    for each in _FIELDS.values():
        if each.is_plain:
            each.value(reader)
