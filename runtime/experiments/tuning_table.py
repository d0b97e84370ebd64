"""Tuning as a function: ``runtime.tune(graph, {...}, minimize=...)``, and the table it gives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from runtime.errors import Where
from runtime.experiments.design import Experiment, Objective, Over, Sampler, Variant
from runtime.experiments.execution import chosen_pool
from runtime.experiments.from_python import (
    SeedList,
    Source,
    experiment_of,
    folder_for,
    node_of,
    seeds_of,
)
from runtime.experiments.tuning import (
    Judgement,
    Tried,
    TuningOptions,
    TuningPlan,
    TuningRequest,
    TuningResult,
    judgements,
    run_tuning,
    save_json,
    summary,
    tuning_request,
)
from runtime.graph import Graph
from runtime.terminal import Progress


@dataclass(frozen=True)
class TuningTable:
    """What a tuning found.

    Parameters
    ----------
    configurations : all that were tried, the graph's own values first.
    winners : the best one, or the front, of the training runs; at most five. Empty if nothing is
        better than the graph's own values.
    better : those of them that are better on the held-out runs, too.
    judgements : the graph's own values and the winners on the training and the held-out runs.
    folder : the tuning's folder.
    """

    configurations: tuple[Tried, ...] = field(repr=False)
    winners: tuple[Tried, ...]
    better: tuple[Tried, ...]
    judgements: tuple[Judgement, ...] = field(repr=False)
    paths: tuple[str, ...]
    folder: Path = field(repr=False)
    text: str = field(repr=False)

    @classmethod
    def of(cls, result: TuningResult) -> TuningTable:
        """The table of a tuning that has ended."""
        return cls(
            tuple(result.tried),
            tuple(result.winners),
            tuple(result.better),
            tuple(judgements(result)),
            result.plan.paths,
            result.folder,
            summary(result),
        )

    @property
    def best(self) -> dict[str, object]:
        """The values of the first of ``better`` by path; empty if there is none."""
        if not self.better:
            return {}
        return dict(zip(self.paths, self.better[0].values or (), strict=True))

    def __str__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text)}</pre>"


def tune(
    graph: Source,
    vary: Mapping[str, str | Iterable[object]] | None = None,
    *,
    minimize: str | Sequence[str] = (),
    maximize: str | Sequence[str] = (),
    constraints: Sequence[str] | Mapping[str, Mapping[str, float]] = (),
    trials: int | None = None,
    sampler: Sampler | None = None,
    batch: int | None = None,
    sampling_seed: int | None = None,
    over: Over | None = None,
    stop_early: bool | None = None,
    seeds: SeedList | None = None,
    conditions: Mapping[str, Graph] | None = None,
    held_out: SeedList | None = None,
    held_out_conditions: Mapping[str, Graph] | None = None,
    folder: str | Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    timeout: float | None = None,
) -> TuningTable:
    """Find the values of some factors that minimise metrics, and judge them on held-out runs.

    Parameters
    ----------
    graph : a graph, or the file or name of one or of an experiment.
    vary : for each path into the graph its values: a list, or a range as on the command line.
    minimize, maximize : metrics; several give a front. The first metric is minimised by default.
    constraints : what must hold, as ``["effort below 0.3"]`` or ``{"effort": {"below": 0.3}}``.
    trials, sampler, batch, sampling_seed : how many configurations are tried (100), by which
        optimiser (``tpe``), how many are asked for at a time (4), and its seed.
    over : over the conditions, the ``mean`` of a metric or its ``worst`` value.
    stop_early : whether configurations that half of the others beat are stopped (yes).
    seeds, conditions : of the training runs; conditions are changed graphs by name.
    held_out, held_out_conditions : of the runs that judge; other seeds, 1000..1019 by default.
    folder : where it is written; a temporary folder by default. One that holds part of the same
        tuning is continued.
    jobs, scheduler, timeout : as for :func:`sweep`.

    Raises
    ------
    GraphError, UsageError : the graph, a factor or an option is invalid.
    MissingExtraError : optuna is not installed.
    KeyboardInterrupt : it was interrupted; with a ``folder``, the same call continues it.
    """
    experiment = experiment_of(graph)
    request = TuningRequest(
        vary=[(path, node_of(values)) for path, values in (vary or {}).items()],
        objectives=_objectives(minimize, maximize),
        constraints=[(text, Where("constraints")) for text in _told(constraints)],
        trials=trials,
        sampler=sampler,
        batch=batch,
        sampling_seed=sampling_seed,
        over=over,
        stop_early=stop_early,
        seeds=seeds_of(seeds),
        conditions=_variants(conditions, experiment),
        held_out=seeds_of(held_out),
        held_out_conditions=_variants(held_out_conditions, experiment),
    )
    plan = tuning_request(experiment, request)
    pool = chosen_pool(jobs, scheduler, timeout)
    with folder_for(folder, plan.name) as target:
        return _tuned(plan, TuningOptions(target, True, pool, timeout))


def _tuned(plan: TuningPlan, options: TuningOptions) -> TuningTable:
    done = run_tuning(plan, options, Progress(plan.name))
    save_json(done)
    if done.is_interrupted:
        raise KeyboardInterrupt
    return TuningTable.of(done)


def _told(constraints: Sequence[str] | Mapping[str, Mapping[str, float]]) -> Sequence[str]:
    """Constraints as texts; a mapping is as in an experiment file."""
    if not isinstance(constraints, Mapping):
        return constraints
    return [
        f"{metric} {side} {bound}"
        for metric, sides in constraints.items()
        for side, bound in sides.items()
    ]


def _objectives(minimize: str | Sequence[str], maximize: str | Sequence[str]) -> list[Objective]:
    small, large = ([m] if isinstance(m, str) else m for m in (minimize, maximize))
    return [*map(Objective, small), *(Objective(metric, "maximize") for metric in large)]


def _variants(graphs: Mapping[str, Graph] | None, experiment: Experiment) -> list[Variant]:
    baseline = experiment.graph.check()
    return [Variant.of(name, graph, baseline) for name, graph in (graphs or {}).items()]
