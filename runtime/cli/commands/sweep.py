"""``runtime sweep``: vary parameters and seeds, in parallel; resumable."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.cli.commands import add_output, show_folder
from runtime.cli.commands.changes import add_changes, changed
from runtime.cli.commands.workers import add_workers, chosen_seeds, pool_of, start_early
from runtime.errors import UsageError
from runtime.terminal import short, show, show_json, tell, with_unit

if TYPE_CHECKING:
    from runtime.experiments import SweepResult
    from runtime.experiments.design import Additions, Method

HELP = "vary parameters (grids or samples) and seeds; parallel and resumable"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph, or an experiment.yaml")
    parser.add_argument(
        "--vary",
        action="append",
        metavar="PATH=VALUES",
        default=[],
        help="a factor: lqr.q='[[1, 1, 1], [2, 2, 2]]', a=0.1..0.9:5, b='log(1e-5..1e-2):7', "
        "n='int(50..200):4'; repeatable",
    )
    sampled = parser.add_mutually_exclusive_group()
    sampled.add_argument("--random", type=int, metavar="N", help="N random samples of the ranges")
    sampled.add_argument("--sobol", type=int, metavar="N", help="N samples of a Sobol sequence")
    parser.add_argument("--sampling-seed", type=int, metavar="K", help="seed of the samples (0)")
    goal = parser.add_mutually_exclusive_group()
    goal.add_argument("--minimize", metavar="METRIC", help="the objective (the first metric)")
    goal.add_argument("--maximize", metavar="METRIC", help="likewise, if larger is better")
    parser.add_argument(
        "--keep",
        default="none",
        metavar="WHICH",
        help="trials that keep a run folder: all, failed, best:N or none (none)",
    )
    parser.add_argument(
        "--name", help="name of the sweep's folder (the graph's, or the experiment's)"
    )
    parser.add_argument("--resume", action="store_true", help="continue an interrupted sweep")
    add_workers(parser, "the graph's own seed")
    add_output(parser, "sweeps", "sweeps")
    add_changes(parser, seed=False)


def run(options: Namespace) -> int:
    """Run the trials that have no row yet; print and draw the results."""
    start_early(options)
    from runtime.engine import silent
    from runtime.experiments import SweepOptions, run_sweep
    from runtime.experiments.design import Seeds, read_experiment
    from runtime.experiments.execution import sweep_plan
    from runtime.terminal import Progress

    experiment = read_experiment(
        options.graph, lambda graph: changed(graph, options), modules=not options.no_modules
    )
    own = experiment.graph.check().network.seed
    seeds = chosen_seeds(options) or experiment.seeds or Seeds(((own, own),))
    experiment = _additions(options).to(experiment, seeds)
    quiet = options.quiet or options.json
    plan = sweep_plan(experiment, seeds, silent if quiet else tell)
    folder = Path(options.out) / plan.name
    how = SweepOptions(folder, options.resume, pool_of(options), options.keep, options.timeout)
    result = run_sweep(plan, how, Progress(plan.name, wanted=not quiet))
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


def _additions(options: Namespace) -> Additions:
    """What the command line adds to the experiment."""
    from runtime.document import parse_yaml
    from runtime.experiments.design import Additions, Objective

    vary = []
    for text in options.vary:
        path, equals, values = text.partition("=")
        origin = f"--vary {text}"
        if not equals:
            raise UsageError(f"{origin}: expected PATH=VALUES")
        vary.append((path.strip(), parse_yaml(values, origin)))
    method: Method | None = None
    if options.random is not None:
        method = "random"
    elif options.sobol is not None:
        method = "sobol"
    objective = None
    if options.minimize is not None:
        objective = Objective(options.minimize)
    elif options.maximize is not None:
        objective = Objective(options.maximize, "maximize")
    return Additions(
        vary=vary,
        method=method,
        samples=(options.random if options.sobol is None else options.sobol) or 0,
        sampling_seed=options.sampling_seed,
        objective=objective,
        name=options.name,
        options="--{}",
    )


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
            found = ranked.objective
            mean = mean_of(found, len(plan.seeds), tally.never)
            ends = f"  {interval(found)}" if found.n > 1 else ""
            values = zip(plan.columns.factors, ranked.cells, strict=True)
            configuration = ", ".join(f"{factor}={short(value)}" for factor, value in values)
            show(f"  {mean:<10}{ends}  {configuration}".rstrip())
        if any(ranked.objective.is_same for ranked in tally.best):
            show(f"{SAME}: {SAME_RUNS}")
    for reason in tally.top_reasons():
        tell(f"  {reason['count']} x {reason['reason']}")
    show_folder("sweep", result.folder, pictures)
