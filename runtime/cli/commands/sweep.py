"""``runtime sweep``: turn knobs, in parallel; resumable."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.cli.commands.changes import add_changes, changed
from runtime.cli.commands.workers import add_workers, chosen_seeds, noted, pool_of, start_early
from runtime.errors import NOWHERE, Problems, UsageError, Where
from runtime.terminal import show, show_json, tell

if TYPE_CHECKING:
    from runtime.experiments import SweepResult
    from runtime.experiments.design import Experiment, Seeds

HELP = "turn knobs: grids, samples, seeds; parallel and resumable"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph, or an experiment.yaml")
    parser.add_argument(
        "--vary",
        action="append",
        metavar="PATH=VALUES",
        default=[],
        help="a knob: lqr.q='[[1, 1, 1], [2, 2, 2]]', a=0.1..0.9:5, b='log(1e-5..1e-2):7', "
        "n='int(50..200):4'; repeatable",
    )
    sampled = parser.add_mutually_exclusive_group()
    sampled.add_argument("--random", type=int, metavar="N", help="N random points of the ranges")
    sampled.add_argument("--sobol", type=int, metavar="N", help="N points of a Sobol sequence")
    parser.add_argument("--sampling-seed", type=int, metavar="K", help="of those points (0)")
    goal = parser.add_mutually_exclusive_group()
    goal.add_argument("--minimize", metavar="METRIC", help="what 'best' means (the first metric)")
    goal.add_argument("--maximize", metavar="METRIC", help="or this, where more is better")
    parser.add_argument(
        "--keep",
        default="none",
        metavar="WHICH",
        help="run folders of points: all, failed, best:N or none (none)",
    )
    parser.add_argument("--name", help="of the sweep's folder (the graph's, or the experiment's)")
    parser.add_argument("--out", default="sweeps", metavar="DIR", help="where it goes (sweeps)")
    parser.add_argument("--resume", action="store_true", help="go on where it was interrupted")
    add_workers(parser, "the graph's own seed")
    add_changes(parser, seed=False)


def run(options: Namespace) -> int:
    """Run the points that have no row yet; print and draw what came out."""
    start_early(options)
    from runtime.experiments import Way, sweep
    from runtime.experiments.design import Seeds, read_experiment
    from runtime.experiments.execution import sweep_plan
    from runtime.terminal import Progress

    experiment = read_experiment(
        options.graph, lambda graph: changed(graph, options), modules=not options.no_modules
    )
    own = experiment.graph.check().network.seed
    seeds = chosen_seeds(options) or experiment.seeds or Seeds(((own, own),))
    experiment = _completed(experiment, options, seeds)
    quiet = options.quiet or options.json
    plan = sweep_plan(experiment, seeds, noted(quiet))
    way = Way(
        *(Path(options.out) / plan.name, options.resume, pool_of(options)),
        *(options.keep, options.timeout),
    )
    swept = sweep(plan, way, Progress(plan.name, wanted=not quiet))
    pictures = [] if options.no_plots or swept.is_interrupted else _pictures(swept)
    if options.json:
        show_json({**swept.summary(), "plots": [str(path) for path in pictures]})
    else:
        _print(swept, pictures)
    if swept.is_interrupted:
        message = f"interrupted after {swept.tally.done} of {plan.total} points"
        tell(f"{message}; --resume goes on with {swept.folder}")
        return 130
    return 3 if swept.tally.counts["ok"] == 0 else 0


def _completed(experiment: Experiment, options: Namespace, seeds: Seeds) -> Experiment:
    """An experiment with what the command line adds, checked."""
    from runtime.document import parse_yaml
    from runtime.experiments.design import (
        Objective,
        check_design,
        check_knob,
        check_objective,
        parse_knob,
        slug,
    )

    problems = Problems()
    graph = experiment.graph
    factors = []
    for text in options.vary:
        path, equals, values = text.partition("=")
        origin = f"--vary {text}"
        if not equals:
            raise UsageError(f"{origin}: expected PATH=VALUES")
        factor = parse_knob(path.strip(), parse_yaml(values, origin), path.strip(), problems)
        if factor is not None:
            check_knob(graph, factor, Where(origin), problems)
            factors.append(factor)
    own = {factor.path for factor in factors}
    kept = (factor for factor in experiment.design.factors if factor.path not in own)
    design = replace(experiment.design, factors=(*kept, *factors))
    for method in ("random", "sobol"):
        samples = getattr(options, method)
        if samples is not None:
            design = replace(design, method=method, samples=_positive(samples, f"--{method}"))
    if options.sampling_seed is not None:
        design = replace(design, seed=_positive(options.sampling_seed, "--sampling-seed", 0))
    objective = experiment.objective
    for goal in ("minimize", "maximize"):
        metric = getattr(options, goal)
        if metric is not None:
            objective = Objective(metric, goal)
            check_objective(graph, objective, NOWHERE, problems)
    problems.raise_any()
    check_design(graph, design, seeds)
    name = options.name or experiment.name
    if slug(name) != name:
        raise UsageError(f"--name {name}: expected letters, digits, '_', '-' and '.'")
    return replace(experiment, name=name, design=design, objective=objective)


def _positive(number: int, flag: str, least: int = 1) -> int:
    if number < least:
        raise UsageError(f"{flag} {number}: expected {least} or more")
    return number


def _pictures(swept: SweepResult) -> list[Path]:
    from runtime.experiments.analysis.sweep_plots import save_sweep_figures

    return save_sweep_figures(swept.folder)


def _print(swept: SweepResult, pictures: list[Path]) -> None:
    plan, tally = swept.plan, swept.tally
    counts = ", ".join(f"{count} {status}" for status, count in sorted(tally.counts.items()))
    configurations = plan.total // len(plan.seeds)
    show(
        f"{plan.name}: {tally.done} of {plan.total} points ({configurations} settings, seeds "
        f"{plan.seeds}): {counts}; {swept.wall_s:.1f} s"
    )
    if plan.objective is not None and not tally.best:
        show(f"no setting has a value of {plan.objective.metric} for every seed")
    elif plan.objective is not None:
        goal = "smallest" if plan.objective.goal == "minimize" else "largest"
        show(f"{goal} {plan.objective.metric}, mean and 95 % interval over seeds:")
        for ranked in tally.best:
            found = ranked.objective
            ends = f"  [{found.low:.4g}, {found.high:.4g}]" if found.n > 1 else ""
            values = zip(plan.columns.factors, ranked.cells, strict=True)
            configuration = ", ".join(f"{factor}={value}" for factor, value in values)
            show(f"  {found.mean:<10.4g}{ends}  {configuration}".rstrip())
    for told in tally.told():
        tell(f"  {told['count']} x {told['reason']}")
    show(f"sweep folder: {swept.folder}")
    for path in pictures:
        show(f"  {path.relative_to(swept.folder)}")
