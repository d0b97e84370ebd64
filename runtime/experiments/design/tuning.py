"""What a tuning run is about: objectives, constraints, and the runs that decide."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

from blocks.core import hint
from runtime.document import Node, check_keys
from runtime.errors import Problems, UsageError, Where
from runtime.experiments.design.objective import Objective
from runtime.experiments.design.seeds import Seeds, parse_seeds
from runtime.experiments.design.variants import Variant
from runtime.graph import Graph

Sampler = Literal["tpe", "nsga2", "sobol", "random"]
Over = Literal["mean", "worst"]
SAMPLERS: tuple[Sampler, ...] = get_args(Sampler)
OVER: tuple[Over, ...] = get_args(Over)
KEYS = ("constraints", "trials", "sampler", "batch", "over", "stop_early", "training", "held_out")
RUN_KEYS = ("seeds", "conditions")
NOMINAL = "nominal"
TRIALS, BATCH = 100, 4
MOST_TRIALS, MOST_BATCH = 10**6, 4096
HELD_OUT = Seeds(((1000, 1019),))
_CONSTRAINT = re.compile(r"\s*(?P<metric>\S+)\s+(?P<side>below|above)\s+(?P<bound>\S+)\s*")


@dataclass(frozen=True)
class Constraint:
    """A metric that must be below or above a bound."""

    metric: str
    side: Literal["below", "above"]
    bound: float

    def violation(self, value: float) -> float:
        """By how much a value violates it; at most 0 if it does not."""
        return value - self.bound if self.side == "below" else self.bound - value

    def __str__(self) -> str:
        return f"{self.metric} {self.side} {self.bound:g}"


@dataclass(frozen=True)
class RunSet:
    """Every condition with every seed."""

    seeds: Seeds
    conditions: tuple[Variant, ...]

    def __len__(self) -> int:
        return len(self.seeds) * len(self.conditions)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(condition.name for condition in self.conditions)


@dataclass(frozen=True)
class Tuning:
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

    @property
    def metrics(self) -> tuple[str, ...]:
        """The metrics that matter, the objectives first."""
        required = [constraint.metric for constraint in self.constraints]
        return tuple(dict.fromkeys([*(o.metric for o in self.objectives), *required]))


@dataclass(frozen=True)
class TuningEntries:
    """The entries of an experiment file that are about tuning; None or empty where not written."""

    objectives: tuple[Objective, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    trials: int | None = None
    sampler: Sampler | None = None
    batch: int | None = None
    over: Over | None = None
    stop_early: bool = True
    training: tuple[Seeds | None, tuple[Variant, ...]] = (None, ())
    held_out: tuple[Seeds | None, tuple[Variant, ...]] = (None, ())


def complete(entries: TuningEntries, graph: Graph, seed: int, own: Seeds) -> Tuning:
    """The entries with their defaults.

    Parameters
    ----------
    own : the training seeds if none are written.

    Raises
    ------
    UsageError : the graph has no metric, or a run would both train and judge.
    """
    objectives = entries.objectives
    if not objectives:
        if not graph.observation.metrics:
            raise UsageError("the graph has no metrics to tune for; add 'metrics:'")
        objectives = (Objective(graph.observation.metrics[0].name),)
    nominal = (Variant(NOMINAL, graph),)
    seeds, conditions = entries.training
    training = RunSet(seeds or own, conditions or nominal)
    seeds, conditions = entries.held_out
    held_out = RunSet(seeds or HELD_OUT, conditions or training.conditions)
    _check_apart(training, held_out)
    return Tuning(
        objectives,
        entries.constraints,
        entries.trials or TRIALS,
        entries.sampler or "tpe",
        entries.batch or BATCH,
        seed,
        entries.over or "mean",
        entries.stop_early,
        training,
        held_out,
    )


def _check_apart(training: RunSet, held_out: RunSet) -> None:
    shared = set(training.names) & set(held_out.names)
    seeds = set(training.seeds) & set(held_out.seeds)
    if shared and seeds:
        raise UsageError(
            f"condition '{min(shared)}' with seed {min(seeds)} is both in training and held out; "
            "give the held-out runs other seeds"
        )


def parse_constraint(
    text: str, graph: Graph, where: Where, problems: Problems
) -> Constraint | None:
    """The constraint that a text such as ``effort below 0.3`` describes."""
    match = _CONSTRAINT.fullmatch(text)
    try:
        bound = float(match["bound"]) if match else float("nan")
    except ValueError:
        bound = float("nan")
    if match is None or bound != bound:
        problems.add(where, "", f"expected a constraint as 'effort below 0.3', got '{text[:60]}'")
        return None
    side: Literal["below", "above"] = "below" if match["side"] == "below" else "above"
    return _known(Constraint(match["metric"], side, bound), graph, where, "", problems)


def _known(
    constraint: Constraint, graph: Graph, where: Where, address: str, problems: Problems
) -> Constraint:
    known = [metric.name for metric in graph.observation.metrics]
    if constraint.metric not in known:
        suggestion = hint(constraint.metric, known) or f"; it has {', '.join(known) or 'none'}"
        message = f"the graph has no metric '{constraint.metric}'{suggestion}"
        problems.add(where, address, message)
    return constraint


def read_tuning(
    document: Node,
    graph: Graph,
    objectives: tuple[Objective, ...],
    variants: Callable[[Node, str], list[Variant]],
    problems: Problems,
) -> TuningEntries:
    """The entries of an experiment file; ``variants`` reads a section of named changes."""
    reader = _Entries(document, problems)
    return TuningEntries(
        objectives,
        tuple(reader.constraints(graph)),
        reader.whole("trials", MOST_TRIALS),
        reader.choice("sampler", SAMPLERS),  # type: ignore[arg-type]
        reader.whole("batch", MOST_BATCH),
        reader.choice("over", OVER),  # type: ignore[arg-type]
        reader.choice("stop_early", (True, False)) is not False,
        reader.runs("training", variants),
        reader.runs("held_out", variants),
    )


@dataclass
class _Entries:
    document: Node
    problems: Problems

    def whole(self, key: str, most: int) -> int | None:
        node = self.document.get(key)
        if node is None:
            return None
        value = node.value
        if type(value) is int and 1 <= value <= most:
            return value
        message = f"expected an integer from 1 to {most}, got {node.describe()}"
        self.problems.add(node.where, key, message)
        return None

    def choice(self, key: str, choices: tuple[object, ...]) -> object:
        node = self.document.get(key)
        if node is None:
            return None
        if node.value in choices and type(node.value) is type(choices[0]):
            return node.value
        expected = ", ".join(str(choice).lower() for choice in choices)
        self.problems.add(node.where, key, f"expected one of {expected}, got {node.describe()}")
        return None

    def constraints(self, graph: Graph) -> list[Constraint]:
        section = self.document.get("constraints")
        if section is None:
            return []
        example = "as in {effort: {below: 0.3}}"
        if not section.is_map:
            message = f"expected metrics with bounds, {example}, got {section.describe()}"
            self.problems.add(section.where, "constraints", message)
            return []
        found = []
        for metric, node in section.items():
            address = f"constraints.{metric}"
            if not node.is_map:
                message = f"expected below or above, {example}, got {node.describe()}"
                self.problems.add(node.where, address, message)
                continue
            check_keys(node, ("below", "above"), address, self.problems, "key")
            for side, bound in node.items():
                number = bound.value
                if isinstance(number, bool) or not isinstance(number, (int, float)):
                    message = f"expected a number, got {bound.describe()}"
                    self.problems.add(bound.where, f"{address}.{side}", message)
                elif side in ("below", "above"):
                    way: Literal["below", "above"] = "below" if side == "below" else "above"
                    constraint = Constraint(metric, way, float(number))
                    found.append(_known(constraint, graph, node.where, address, self.problems))
        return found

    def runs(
        self, key: str, variants: Callable[[Node, str], list[Variant]]
    ) -> tuple[Seeds | None, tuple[Variant, ...]]:
        node = self.document.get(key)
        if node is None:
            return None, ()
        if not node.is_map:
            message = f"expected seeds and conditions, got {node.describe()}"
            self.problems.add(node.where, key, message)
            return None, ()
        check_keys(node, RUN_KEYS, key, self.problems, "key")
        seeds, section = node.get("seeds"), node.get("conditions")
        return (
            None if seeds is None else parse_seeds(seeds, f"{key}.seeds", self.problems),
            () if section is None else tuple(variants(section, f"{key}.conditions")),
        )
