"""``runtime contest``: tune contestants with equal budgets, and compare them on held-out runs."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from runtime.cli.commands.workers import (
    add_experiment,
    conclude,
    experiment_of,
    note_of,
    progress_of,
    run_options,
    start_early,
)

HELP = "tune contestants with equal budgets; compare on held-out runs"
ABOUT = """
Each contestant of the file is tuned with the same number of runs on the same training runs, and
what wins there is run on the same held-out runs, which give one paired table and figure.
"""
EXAMPLES = """
runtime contest gains.yaml --budget 200
runtime contest gains.yaml --trials 50 --repeats 3 --margin 2%
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", metavar="experiment", help="an experiment.yaml with contestants")
    parser.add_argument(
        "--budget", type=int, metavar="N", help="the most training runs of each tuning"
    )
    parser.add_argument("--trials", type=int, metavar="N", help="trials of each tuning (100)")
    parser.add_argument(
        "--repeats", type=int, metavar="K", help="tunings of each, by other sampling seeds (1)"
    )
    parser.add_argument("--held-out", metavar="SEEDS", help="seeds that judge (1000..1019)")
    parser.add_argument(
        "--margin",
        action="append",
        metavar="[METRIC=]D",
        default=[],
        help="the smallest difference that counts, as error=0.001 or 5%%; repeatable",
    )
    add_experiment(parser, "contest", "contests", "training; the graph's own seed")
    parser.set_defaults(figures="pdf,png", style="paper")


def run(options: Namespace) -> int:
    """Run what has no row yet; print the table and draw the figure."""
    start_early(options)
    from runtime.errors import UsageError

    experiment = experiment_of(options)
    experiment.check_used("contest")
    if not experiment.contestants:
        raise UsageError(
            f"{options.graph}: there are no contestants; write 'contestants: {{LQR: {{vary: ...}}, "
            "PID: {replace: ..., vary: ...}}'"
        )
    from runtime.experiments.tuning import contest_plans, run_contest

    result = run_contest(
        experiment.name,
        contest_plans(experiment, note_of(options)),
        run_options(options, experiment.name),
        lambda name: progress_of(options, name),
        dict(experiment.entries.margins),
    )
    return conclude(options, result)
