"""``runtime sweep``: vary parameters and seeds, in parallel; resumable."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.arguments import show_folder
from runtime.cli.commands.workers import (
    add_experiment,
    add_factors,
    experiment_of,
    note_of,
    progress_of,
    run_options,
    start_early,
)
from runtime.terminal import short, show, show_json, tell, with_unit

if TYPE_CHECKING:
    from runtime.experiments import SweepResult

HELP = "vary parameters (grids or samples) and seeds; parallel and resumable"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph, or an experiment.yaml")
    add_factors(parser)
    sampled = parser.add_mutually_exclusive_group()
    sampled.add_argument("--random", type=int, metavar="N", help="N random samples of the ranges")
    sampled.add_argument("--sobol", type=int, metavar="N", help="N samples of a Sobol sequence")
    goal = parser.add_mutually_exclusive_group()
    goal.add_argument("--minimize", metavar="METRIC", help="the objective (the first metric)")
    goal.add_argument("--maximize", metavar="METRIC", help="likewise, if larger is better")
    parser.add_argument(
        "--keep",
        default="none",
        metavar="WHICH",
        help="trials that keep a run folder: all, failed, best:N or none (none)",
    )
    add_experiment(parser, "sweep", "sweeps", "the graph's own seed")


def run(options: Namespace) -> int:
    """Run the trials that have no row yet; print and draw the results."""
    start_early(options)
    from runtime.experiments import run_sweep
    from runtime.experiments.execution import sweep_plan

    plan = sweep_plan(experiment_of(options), note_of(options))
    result = run_sweep(plan, run_options(options, plan.name), progress_of(options, plan.name))
    pictures: list[Path] = []
    if not (options.no_plots or result.is_interrupted):
        from runtime.experiments.analysis.sweep_plots import save_sweep_figures

        pictures = save_sweep_figures(result.folder)
    if options.json:
        show_json({**result.summary(), "plots": [str(path) for path in pictures]})
    else:
        _print(result, pictures)
    if result.is_interrupted:
        message = f"interrupted after {result.tally.done} of {plan.total} trials"
        tell(f"{message}; --resume continues {result.folder}")
        return 130
    return 3 if result.tally.counts["ok"] == 0 else 0


def _print(result: SweepResult, pictures: list[Path]) -> None:
    from runtime.experiments.analysis import SAME, SAME_RUNS, interval, mean_of

    plan, tally = result.plan, result.tally
    counts = ", ".join(f"{count} {status}" for status, count in sorted(tally.counts.items()))
    configurations = plan.total // len(plan.seeds)
    show(
        f"{plan.name}: {tally.done} of {plan.total} trials ({configurations} configurations, "
        f"seeds {plan.seeds}): {counts}; {result.wall_s:.1f} s"
    )
    if plan.objective is not None and not tally.best:
        show(f"no configuration has a value of {plan.objective.metric} for every seed")
    elif plan.objective is not None:
        goal = "smallest" if plan.objective.goal == "minimize" else "largest"
        metric = with_unit(plan.objective.metric, plan.units)
        is_same = all(ranked.objective.is_same for ranked in tally.best)
        show(f"{goal} {metric}{'' if is_same else ', mean and 95 % interval over seeds'}:")
        for ranked in tally.best:
            estimate = ranked.objective
            mean = mean_of(estimate, len(plan.seeds), tally.never)
            ends = f"  {interval(estimate)}" if estimate.n > 1 else ""
            values = zip(plan.columns.factors, ranked.cells, strict=True)
            configuration = ", ".join(f"{factor}={short(value)}" for factor, value in values)
            show(f"  {mean:<10}{ends}  {configuration}".rstrip())
        if any(ranked.objective.is_same for ranked in tally.best):
            show(f"{SAME}: {SAME_RUNS}")
    for reason in tally.top_reasons():
        tell(f"  {reason['count']} x {reason['reason']}")
    show_folder("sweep", result.folder, pictures)
