"""``runtime tune``: find values that minimise metrics, and judge them on held-out runs."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.cli.commands import add_output, integer, show_folder
from runtime.cli.commands.changes import add_changes, changed
from runtime.cli.commands.workers import add_workers, chosen_seeds, pool_of, start_early
from runtime.errors import Where
from runtime.terminal import show, show_json, tell

if TYPE_CHECKING:
    from runtime.experiments import TuningRequest, TuningResult
    from runtime.experiments.design import Experiment

HELP = "find values that minimise metrics, and judge them on held-out runs (extra tune)"
ABOUT = """
The values of the factors are found by an optimiser on the training runs: every condition with every
training seed. The winners are then run on held-out seeds and conditions, beside the graph's own
values. Several objectives give a front.

  runtime tune G --vary lqr.q.1='log(1..1000)' --minimize error --constrain 'effort below 0.3'
  runtime tune experiment.yaml --trials 200 -j 8 --write
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.description = ABOUT.strip()
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.add_argument("graph", help="a graph, or an experiment.yaml")
    _add_search(parser)
    parser.add_argument(
        "--held-out", metavar="SEEDS", help="seeds that judge the winners (1000..1019)"
    )
    parser.add_argument("--no-stopping", action="store_true", help="run every trial to its end")
    parser.add_argument(
        "--write",
        action="store_true",
        help="write the winner's values into the file, if they are better on the held-out runs",
    )
    parser.add_argument("--name", help="name of the folder (the graph's, or the experiment's)")
    parser.add_argument("--resume", action="store_true", help="continue an interrupted tuning")
    add_workers(parser, "training; the graph's own seed")
    add_output(parser, "tunings", "tunings")
    add_changes(parser, seed=False)


def _add_search(parser: ArgumentParser) -> None:
    """Declare what is looked for, and how."""
    parser.add_argument("--trials", type=integer(1, 10**6), metavar="N", help="trials (100)")
    parser.add_argument(
        "--vary",
        action="append",
        metavar="PATH=VALUES",
        default=[],
        help="a factor, as for sweep: a=0.1..0.9, b='log(1e-5..1e-2)', n='int(50..200)'; "
        "repeatable",
    )
    for goal in ("minimize", "maximize"):
        parser.add_argument(
            f"--{goal}", action="append", metavar="METRIC", default=[], help="an objective"
        )
    parser.add_argument(
        "--constrain",
        action="append",
        metavar="TEXT",
        default=[],
        help="what must hold, as 'effort below 0.3'; repeatable",
    )
    parser.add_argument(
        "--sampler",
        choices=("tpe", "nsga2", "sobol", "random"),
        help="how configurations are found (tpe)",
    )
    parser.add_argument("--batch", type=integer(1, 4096), metavar="N", help="asked at a time (4)")
    parser.add_argument(
        "--sampling-seed", type=integer(0, 2**31), metavar="K", help="seed of the sampler (0)"
    )
    parser.add_argument(
        "--over",
        choices=("mean", "worst"),
        help="over the conditions: the mean (default) or the worst",
    )


def run(options: Namespace) -> int:
    """Run what has no row yet; print both tables and draw the results."""
    start_early(options)
    from runtime.engine import silent
    from runtime.experiments import tuning_request
    from runtime.experiments.design import read_experiment
    from runtime.experiments.tuning import (
        TuningOptions,
        check_writable,
        run_tuning,
        save_json,
        summary,
    )
    from runtime.terminal import Progress

    experiment = read_experiment(
        options.graph, lambda graph: changed(graph, options), modules=not options.no_modules
    )
    if options.write:
        check_writable(experiment)
    quiet = options.quiet or options.json
    plan = tuning_request(experiment, _request(options), silent if quiet else tell)
    folder = Path(options.out) / plan.name
    how = TuningOptions(folder, options.resume, pool_of(options), options.timeout)
    result = run_tuning(plan, how, Progress(plan.name, wanted=not quiet))
    stored = save_json(result)
    if result.is_interrupted:
        tell(f"interrupted after {result.runs} training runs; --resume continues {result.folder}")
        return 130
    pictures: list[Path] = []
    if not options.no_plots:
        from runtime.experiments.tuning.tuning_plots import save_tuning_figures

        pictures = save_tuning_figures(result.folder)
    if options.json:
        show_json({**stored, "plots": [str(path) for path in pictures]})
    else:
        show(summary(result))
        show()
        show_folder("tuning", result.folder, pictures)
    if not result.has_feasible:
        return 3
    return _write(experiment, result) if options.write else 0


def _write(experiment: Experiment, result: TuningResult) -> int:
    """Write the best values into the file, if they are better; returns the exit code."""
    from runtime.experiments.tuning import NOTHING, write_values

    if not result.better:
        tell(f"note: --write has written nothing: {NOTHING}")
        return 1
    best = result.better[0]
    values = dict(zip(result.plan.paths, best.values or (), strict=True))
    path = write_values(experiment, values)
    tell(f"note: the values of {best.number} are written into {path}")
    return 0


def _request(options: Namespace) -> TuningRequest:
    from runtime.document import parse_yaml
    from runtime.errors import Problems, UsageError
    from runtime.experiments import TuningRequest
    from runtime.experiments.design import Objective, parse_seeds

    vary = []
    for text in options.vary:
        path, equals, values = text.partition("=")
        if not equals:
            raise UsageError(f"--vary {text}: expected PATH=VALUES")
        vary.append((path.strip(), parse_yaml(values, f"--vary {text}")))
    held_out = None
    if options.held_out is not None:
        problems = Problems()
        origin = f"--held-out {options.held_out}"
        held_out = parse_seeds(parse_yaml(options.held_out, origin), "", problems)
        problems.raise_any()
    return TuningRequest(
        vary=vary,
        objectives=[
            *(Objective(metric) for metric in options.minimize),
            *(Objective(metric, "maximize") for metric in options.maximize),
        ],
        constraints=[(text, Where(f"--constrain {text}")) for text in options.constrain],
        trials=options.trials,
        sampler=options.sampler,
        batch=options.batch,
        sampling_seed=options.sampling_seed,
        over=options.over,
        stop_early=False if options.no_stopping else None,
        seeds=chosen_seeds(options),
        held_out=held_out,
        name=options.name,
        options="--{}",
    )
