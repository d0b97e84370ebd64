"""``runtime tune``: find values that minimise metrics, and judge them on held-out runs."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from runtime.cli.commands.workers import (
    add_experiment,
    add_factors,
    conclude,
    experiment_of,
    note_of,
    progress_of,
    run_options,
    start_early,
)
from runtime.cli.commands.writing import check_writable, write_values
from runtime.errors import UsageError
from runtime.terminal import tell

if TYPE_CHECKING:
    from runtime.experiments import TuningTable
    from runtime.experiments.design import Experiment

HELP = "find values that minimise metrics; judge them on held-out runs"
ABOUT = """
The values of the factors are found by an optimiser on the training runs: every condition with every
training seed. The winners are then run on held-out seeds and conditions, beside the graph's own
values. Several objectives give a front.
"""
EXAMPLES = """
runtime tune my.yaml --vary lqr.q.1='log(1..1000)' --minimize error
runtime tune experiment.yaml --trials 200 -j 8 --write
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph, or an experiment.yaml")
    add_factors(parser)
    _add_search(parser)
    parser.add_argument(
        "--held-out", metavar="SEEDS", help="seeds that judge the winners (1000..1019)"
    )
    parser.add_argument(
        "--write",
        action="store_true",
        help="write the winner's values into the file, if the held-out runs show them to be better",
    )
    parser.add_argument(
        "--force", action="store_true", help="with --write: write them even if they do not"
    )
    add_experiment(parser, "tuning", "tunings", "training; the graph's own seed")


def _add_search(parser: ArgumentParser) -> None:
    """Declare what is looked for, and how."""
    parser.add_argument("--trials", type=int, metavar="N", help="trials (100)")
    parser.add_argument(
        "--budget", type=int, metavar="N", help="the most training runs, in place of trials"
    )
    parser.add_argument(
        "--patience", type=int, metavar="N", help="stop after N trials per factor without gain"
    )
    parser.add_argument(
        "--repeats", type=int, metavar="K", help="K tunings by other sampling seeds: do they agree?"
    )
    for goal in ("minimize", "maximize"):
        parser.add_argument(
            f"--{goal}", action="append", metavar="METRIC", default=[], help="an objective"
        )
    parser.add_argument(
        "--constrain",
        action="append",
        dest="constraints",
        metavar="TEXT",
        default=[],
        help="what must hold, as 'effort below 0.3'; repeatable",
    )
    parser.add_argument(
        "--sampler",
        choices=("tpe", "nsga2", "sobol", "random"),
        help="how configurations are found (tpe)",
    )
    parser.add_argument("--batch", type=int, metavar="N", help="asked at a time (4)")
    parser.add_argument(
        "--over",
        choices=("mean", "worst"),
        help="over the conditions: the mean (default) or the worst",
    )
    parser.add_argument(
        "--no-stopping",
        action="store_const",
        const=False,
        dest="stop_early",
        help="run every trial to its end",
    )


def run(options: Namespace) -> int:
    """Run what has no row yet; print both tables and draw the results."""
    start_early(options)
    from runtime.experiments.tuning import (
        run_tuning,
        tuning_plan,
    )

    experiment = experiment_of(options)
    if options.force and not options.write:
        raise UsageError("--force: there is nothing to force; add --write")
    if options.write:
        check_writable(experiment)
    if (experiment.entries.repeats or 1) > 1:
        return _repeat(options, experiment)
    plan = tuning_plan(experiment, note_of(options))
    result = run_tuning(plan, run_options(options, plan.name), progress_of(options, plan.name))
    code = conclude(options, result)
    return _write(experiment, result, options.force) if options.write and code == 0 else code


def _repeat(options: Namespace, experiment: Experiment) -> int:
    """Tune several times, each in a folder of its own, and tell how far the tunings agree."""
    from runtime.experiments.tuning import contest_plans, run_contest

    if options.write:
        raise UsageError("--write: of several tunings, none is written; leave out --repeats")
    experiment.check_used("tuning")
    result = run_contest(
        experiment.name,
        contest_plans(experiment, note_of(options)),
        run_options(options, experiment.name),
        lambda name: progress_of(options, name),
    )
    return conclude(options, result, figures=False)


def _write(experiment: Experiment, result: TuningTable, force: bool) -> int:
    """Write the best values into the file, if they are better; returns the exit code."""
    from runtime.experiments.tuning import NOT_DISTINGUISHABLE, NOTHING

    chosen = result.better or (result.winners if force else [])
    if not chosen:
        is_open = "not distinguishable" in result.verdicts.values()
        why = f"the winner is {NOT_DISTINGUISHABLE}" if is_open else NOTHING
        more = "; --force writes it nevertheless" * bool(result.winners)
        tell(f"note: --write has written nothing: {why}{more}")
        return 1
    best = chosen[0]
    values = dict(zip(result.plan.paths, best.values or (), strict=True))
    path = write_values(experiment, values)
    tell(f"note: the values of {best.number} are written into {path}")
    return 0
