"""Run a tuning: batches of configurations on the training runs, then winners on the held-out.

In: a plan, and where it is run. Out: :class:`TuningTable`. A batch runs stage by stage, a stage
being one seed under all conditions; after each, hopeless configurations are stopped::

    batch 5, 6, 7, 8   seed 0: all four   seed 1: 5 and 8   seed 2: 8, which is complete
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from runtime.experiments.design import own_value
from runtime.experiments.execution import (
    PLAN,
    Index,
    RunOptions,
    Study,
    Trial,
    read_plan,
    write_checked,
    write_plan,
)
from runtime.experiments.tuning.optimizer import Optimizer, Suggestion
from runtime.experiments.tuning.plan import BASELINE, HELD_OUT, TUNING, TuningPlan
from runtime.experiments.tuning.result import TuningTable
from runtime.experiments.tuning.scores import Candidate, Scorer, front
from runtime.files import system_errors
from runtime.terminal import Progress

WINNERS = 5  # of a front; each costs as many held-out runs as the baseline


def run_tuning(
    plan: TuningPlan, options: RunOptions, progress: Progress, always_judge: bool = False
) -> TuningTable:
    """Run what has no row in the indices yet.

    Parameters
    ----------
    always_judge : make the held-out runs of the graph's own values even if nothing is better.

    The optimiser is asked again from the start and gets what the index holds, so that a tuning that
    was interrupted continues as if it had not been.

    Raises
    ------
    UsageError : as for :class:`Study`.
    MissingExtraError : optuna is not installed.
    """
    folder = options.folder
    if options.resume and (folder / PLAN).exists():
        _extend(plan, folder)
    result = TuningTable(plan, folder, [])
    # What the optimiser asks for next depends on every row: none is run again.
    with Study(plan, replace(options, again=()), progress) as study:
        held_out = study.open_index(folder / HELD_OUT, plan.held_out_columns)
        _Training(plan, study, result).run()
        best = [one for one in front(result.configurations) if one.number != BASELINE]
        result.winners = _spread(best, WINNERS)
        if result.winners or always_judge:
            _judge(plan, study, held_out, result)
    result.wall_s, result.is_interrupted = study.wall_s, study.is_interrupted
    write_checked(folder / TUNING, result.to_dict())
    return result


def _extend(plan: TuningPlan, folder: Path) -> None:
    """Give a folder the plan of more trials if that is all that differs.

    Which configurations are tried first does not depend on how many follow, so that its training
    runs stay. Its winners are judged anew. The population of NSGA-II depends on the trials.
    """
    fewer = read_plan(folder).get("trials")
    tuning = plan.tuning
    if not isinstance(fewer, int) or fewer >= tuning.trials or tuning.sampler == "nsga2":
        return
    shorter = replace(plan, tuning=replace(tuning, trials=fewer))
    if read_plan(folder).get("digest") != shorter.digest:
        return
    with system_errors(f"write '{folder}'"):
        for name in (HELD_OUT, TUNING):
            (folder / name).unlink(missing_ok=True)
        write_plan(plan, folder)


class _Training:
    """The training runs: batches of configurations, each batch seed by seed."""

    def __init__(self, plan: TuningPlan, study: Study, result: TuningTable) -> None:
        self.plan, self.study, self.result = plan, study, result
        self.scorer = Scorer(plan.tuning, plan.metrics)
        self.seeds = list(plan.tuning.training.seeds)

    def run(self) -> None:
        """Try the baseline, then as many configurations as planned."""
        tuning, factors = self.plan.tuning, self.plan.design.factors
        # The graph's own values first: a winner must beat them, not only the other candidates.
        own = Candidate(BASELINE, None)
        self._run_batch([own])
        optimizer = Optimizer(factors, tuning)
        # The optimiser learns from the graph's own values as from any others.
        first = optimizer.begin_with([own_value(self.plan.graph, f.path) for f in factors])
        if first is not None:
            self._tell(optimizer, [first], [own])
        count = 0
        while (number := min(tuning.batch, tuning.trials - count, self._affordable())) > 0:
            if self._is_converged(count):
                break
            batch = optimizer.ask(number)
            candidates = [Candidate(count + i, s.values) for i, s in enumerate(batch, start=1)]
            self._run_batch(candidates)
            self._tell(optimizer, batch, candidates)
            count += len(batch)

    def _affordable(self) -> int:
        """How many configurations the budget pays for, if none of them is stopped."""
        budget = self.plan.tuning.budget
        if budget is None:
            return self.plan.tuning.trials
        return (budget - self.result.runs) // len(self.plan.tuning.training)

    def _is_converged(self, count: int) -> bool:
        """Whether so many configurations were tried since the last better one.

        More factors take more trials to a better one, so that the patience is of each factor.
        """
        patience, factors = self.plan.tuning.patience, self.plan.design.factors
        if patience is None:
            return False
        last = max((one.number for one in front(self.result.configurations)), default=count)
        return count - last >= patience * len(factors)

    def _run_batch(self, batch: Sequence[Candidate]) -> None:
        running = list(batch)
        for stage in range(len(self.seeds)):
            trials = [
                t
                for candidate in running
                for t in self.plan.stage(candidate.number, candidate.values, stage)
            ]
            owners = {
                t.number: candidate for candidate in running for t in self._of(candidate, trials)
            }
            for row in self.study.rows_of(trials, self.study.index):
                owners[row.trial].rows[row.cells[-1], row.seed] = row
            self._show(running)
            past_seeds = self.seeds[: stage + 1]
            if stage + 1 < len(self.seeds):
                running = [
                    candidate for candidate in running if not self._stops(candidate, past_seeds)
                ]
            if not running:
                break
        for candidate in batch:
            had = {seed for _, seed in candidate.rows}  # all, unless it was stopped
            seeds = [seed for seed in self.seeds if seed in had]
            candidate.score = self.scorer.score(candidate.rows, self.plan.tuning.training, seeds)
            if not candidate.score.has_values:
                candidate.status = "no value"
        self.result.configurations.extend(batch)

    def _of(self, one: Candidate, trials: Iterable[Trial]) -> Iterator[Trial]:
        return (trial for trial in trials if trial.configuration.number == one.number)

    def _stops(self, one: Candidate, seeds: Sequence[int]) -> bool:
        if self.scorer.should_stop(one, self.result.configurations, seeds):
            one.status = "stopped"
        return one.status == "stopped"

    def _tell(
        self, optimizer: Optimizer, batch: Sequence[Suggestion], candidates: Sequence[Candidate]
    ) -> None:
        for suggestion, candidate in zip(batch, candidates, strict=True):
            if candidate.score is not None:
                optimizer.tell(suggestion, candidate.score.costs, candidate.score.violations)

    def _show(self, running: Sequence[Candidate]) -> None:
        best = front(self.result.configurations)
        note = ""
        if best and best[0].score is not None:
            goals = zip(self.plan.tuning.objectives, best[0].score.costs, strict=True)
            note = "best: " + ", ".join(f"{o.metric} {o.of(cost):.4g}" for o, cost in goals)
            note += " (own values)" if best[0].number == BASELINE else ""
        total = (1 + self.plan.tuning.trials) * len(self.plan.tuning.training)
        done = max(one.number for one in running) * len(self.plan.tuning.training)
        self.study.progress(min(done, total), total, note)


def _judge(plan: TuningPlan, study: Study, index: Index, result: TuningTable) -> None:
    chosen: dict[int, Sequence[Any] | None] = {BASELINE: None}
    chosen |= {one.number: one.values for one in result.winners}
    held_out = {number: Candidate(number, values) for number, values in chosen.items()}
    for row in study.rows_of(plan.held_out(chosen), index):
        held_out[int(row.cells[0])].rows[row.cells[1], row.seed] = row
    scorer = Scorer(plan.tuning, plan.metrics)
    runs = plan.tuning.held_out
    for one in held_out.values():
        one.score = scorer.score(one.rows, runs, runs.seeds)
        one.status = "complete" if one.score.has_values else "no value"
    result.held_out = held_out


def _spread(candidates: list[Candidate], most: int) -> list[Candidate]:
    """At most so many of a front, its ends included."""
    if len(candidates) <= most:
        return candidates
    return [candidates[round(i * (len(candidates) - 1) / (most - 1))] for i in range(most)]
