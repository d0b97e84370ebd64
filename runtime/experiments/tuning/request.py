"""What a command or a call adds to the tuning entries of an experiment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from runtime.document import Node
from runtime.engine import silent
from runtime.errors import NOWHERE, Problems, UsageError, Where
from runtime.experiments.design import (
    Constraint,
    Experiment,
    Objective,
    Over,
    Sampler,
    Seeds,
    TuningEntries,
    Variant,
    check_factor,
    check_objective,
    check_variants,
    complete,
    parse_constraint,
    parse_factor,
)
from runtime.experiments.tuning.plan import TuningPlan, tuning_plan
from runtime.files import slug


@dataclass(frozen=True)
class TuningRequest:
    """What is added to a tuning; each entry replaces what the experiment says itself.

    Parameters
    ----------
    vary : a path into the graph and its values for each factor.
    objectives : what is minimised or maximised; several give a front.
    constraints : as texts, with where they were written.
    trials, sampler, batch, sampling_seed, over, stop_early : as in :class:`Tuning`.
    seeds, conditions : of the training runs.
    held_out, held_out_conditions : of the runs that judge.
    name : of the tuning.
    options : the word for an option in messages, ``--{}`` on a command line.
    """

    vary: Sequence[tuple[str, Node]] = ()
    objectives: Sequence[Objective] = ()
    constraints: Sequence[tuple[str, Where]] = ()
    trials: int | None = None
    sampler: Sampler | None = None
    batch: int | None = None
    sampling_seed: int | None = None
    over: Over | None = None
    stop_early: bool | None = None
    seeds: Seeds | None = None
    conditions: Sequence[Variant] = ()
    held_out: Seeds | None = None
    held_out_conditions: Sequence[Variant] = ()
    name: str | None = None
    options: str = "{}"


def tuning_request(
    experiment: Experiment, request: TuningRequest, note: Callable[[str], None] = silent
) -> TuningPlan:
    """The plan of an experiment with a request, checked.

    Raises
    ------
    GraphError, UsageError : a factor, an objective, a constraint, the runs or the name is invalid.
    MissingExtraError : optuna is not installed.
    """
    problems = Problems()
    graph = experiment.graph.check()
    factors = []
    for path, node in request.vary:
        factor = parse_factor(path, node, path, problems)
        if factor is not None:
            check_factor(graph, factor, Where(node.where.file), problems)
            factors.append(factor)
    own = {factor.path for factor in factors}
    kept = (factor for factor in experiment.design.factors if factor.path not in own)
    for objective in request.objectives:
        check_objective(graph, objective, NOWHERE, problems)
    constraints: list[Constraint] = []
    for text, where in request.constraints:
        found = parse_constraint(text, graph, where, problems)
        if found is not None:
            constraints.append(found)
    problems.raise_any()
    design = replace(experiment.design, factors=(*kept, *factors))
    seed = request.sampling_seed
    entries = _merged(experiment, request, constraints)
    only = graph.network.seed
    tuning = complete(entries, graph, design.seed if seed is None else seed, Seeds(((only, only),)))
    for runs in (tuning.training, tuning.held_out):
        check_variants(runs.conditions)
    name = request.name or experiment.name
    if slug(name) != name:
        option = request.options.format("name")
        raise UsageError(f"{option} {name}: expected letters, digits, '_', '-' and '.'")
    return tuning_plan(name, graph, design, tuning, note)


def _merged(
    experiment: Experiment, request: TuningRequest, constraints: Sequence[Constraint]
) -> TuningEntries:
    """The entries of the experiment, replaced by what is requested."""
    entries = experiment.tuning
    return replace(
        entries,
        objectives=tuple(request.objectives) or entries.objectives,
        constraints=(*entries.constraints, *constraints),
        trials=request.trials or entries.trials,
        sampler=request.sampler or entries.sampler,
        batch=request.batch or entries.batch,
        over=request.over or entries.over,
        stop_early=entries.stop_early if request.stop_early is None else request.stop_early,
        training=(
            request.seeds or entries.training[0] or experiment.seeds,
            tuple(request.conditions) or entries.training[1],
        ),
        held_out=(
            request.held_out or entries.held_out[0],
            tuple(request.held_out_conditions) or entries.held_out[1],
        ),
    )
