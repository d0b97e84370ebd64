"""``runtime sweep``: turn knobs, in parallel; resumable."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.commands.changes import add_changes, changed
from runtime.commands.workers import add_workers, chosen_seeds, crew_of, noted, start_early
from runtime.errors import NOWHERE, Problems, UsageError, Where
from runtime.files import json_text

if TYPE_CHECKING:
    from runtime.experiments.experiment import Experiment
    from runtime.experiments.seeds import Seeds
    from runtime.experiments.sweeping import Swept

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
    from runtime.experiments.experiment import read_experiment
    from runtime.experiments.plan import sweep_plan
    from runtime.experiments.seeds import Seeds
    from runtime.experiments.sweeping import Way, sweep
    from runtime.progress import Progress

    experiment = read_experiment(options.graph, lambda graph: changed(graph, options))
    own = experiment.graph.check().network.seed
    seeds = chosen_seeds(options) or experiment.seeds or Seeds(((own, own),))
    experiment = _completed(experiment, options, seeds)
    quiet = options.quiet or options.json
    plan = sweep_plan(experiment, seeds, noted(quiet))
    way = Way(
        *(Path(options.out) / plan.name, options.resume, crew_of(options)),
        *(options.keep, options.timeout),
    )
    swept = sweep(plan, way, Progress(plan.name, wanted=not quiet))
    pictures = [] if options.no_plots or swept.is_interrupted else _pictures(swept)
    if options.json:
        print(json_text({**swept.summary(), "plots": [str(path) for path in pictures]}))
    else:
        _print(swept, pictures)
    if swept.is_interrupted:
        said = f"interrupted after {swept.tally.done} of {plan.total} points"
        print(f"{said}; --resume goes on with {swept.folder}", file=sys.stderr)
        return 130
    return 3 if swept.tally.counts["ok"] == 0 else 0


def _completed(experiment: Experiment, options: Namespace, seeds: Seeds) -> Experiment:
    """An experiment with what the command line adds, checked."""
    from runtime.document import parse_yaml
    from runtime.experiments.checks import check_design, check_knob, check_objective
    from runtime.experiments.experiment import slug
    from runtime.experiments.knobs import parse_knob
    from runtime.experiments.objective import Objective

    problems = Problems()
    graph = experiment.graph
    knobs = []
    for text in options.vary:
        path, equals, values = text.partition("=")
        origin = f"--vary {text}"
        if not equals:
            raise UsageError(f"{origin}: expected PATH=VALUES")
        knob = parse_knob(path.strip(), parse_yaml(values, origin), path.strip(), problems)
        if knob is not None:
            check_knob(graph, knob, Where(origin), problems)
            knobs.append(knob)
    own = {knob.path for knob in knobs}
    kept = (knob for knob in experiment.design.knobs if knob.path not in own)
    design = replace(experiment.design, knobs=(*kept, *knobs))
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


def _pictures(swept: Swept) -> list[Path]:
    from runtime.experiments.sweep_figures import save_sweep_figures

    return save_sweep_figures(swept.folder)


def _print(swept: Swept, pictures: list[Path]) -> None:
    plan, tally = swept.plan, swept.tally
    counts = ", ".join(f"{count} {status}" for status, count in sorted(tally.counts.items()))
    settings = plan.total // len(plan.seeds)
    print(
        f"{plan.name}: {tally.done} of {plan.total} points ({settings} settings, seeds "
        f"{plan.seeds}): {counts}; {swept.wall_s:.1f} s"
    )
    if plan.objective is not None and not tally.best:
        print(f"no setting has a value of {plan.objective.metric} for every seed")
    elif plan.objective is not None:
        goal = "smallest" if plan.objective.goal == "minimize" else "largest"
        print(f"{goal} {plan.objective.metric}, mean and 95 % interval over seeds:")
        for ranked in tally.best:
            found = ranked.objective
            ends = f"  [{found.low:.4g}, {found.high:.4g}]" if found.n > 1 else ""
            values = zip(plan.columns.knobs, ranked.cells, strict=True)
            setting = ", ".join(f"{knob}={value}" for knob, value in values)
            print(f"  {found.mean:<10.4g}{ends}  {setting}".rstrip())
    for told in tally.told():
        print(f"  {told['count']} x {told['reason']}", file=sys.stderr)
    print(f"sweep folder: {swept.folder}")
    for path in pictures:
        print(f"  {path.relative_to(swept.folder)}")
