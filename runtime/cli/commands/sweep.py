"""``runtime sweep``: vary parameters and seeds, in parallel; resumable."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from runtime.cli.commands.workers import (
    add_again,
    add_experiment,
    add_factors,
    conclude,
    experiment_of,
    note_of,
    progress_of,
    run_options,
    show_results,
    start_early,
)
from runtime.terminal import tell

HELP = "vary parameters (grids or samples) and seeds, in parallel"
EXAMPLES = """
runtime sweep my.yaml --vary params.v_r=0.5..1.5:5 --seeds 0..9
runtime sweep experiment.yaml -j 4 --resume
"""


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
    add_again(parser)
    add_experiment(parser, "sweep", "sweeps", "the graph's own seed")


def run(options: Namespace) -> int:
    """Run the trials that have no row yet; print and draw the results."""
    start_early(options)
    from runtime.experiments import run_sweep
    from runtime.experiments.execution import sweep_plan

    plan = sweep_plan(experiment_of(options), note_of(options))
    result = run_sweep(plan, run_options(options, plan.name), progress_of(options, plan.name))
    for reason in result.tally.top_reasons() * (not options.json):
        tell(f"  {reason['count']} x {reason['reason']}")
    if result.is_interrupted:
        show_results(options, result.to_dict(), f"{result.text}\n")
    return conclude(options, result)
