"""``runtime ablate``: baseline and variants on the same seeds, in one table and one figure."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.cli.commands.changes import add_changes, changed, with_changes
from runtime.cli.commands.workers import add_workers, chosen_seeds, noted, pool_of, start_early
from runtime.errors import UsageError
from runtime.terminal import show, show_json, tell

if TYPE_CHECKING:
    from runtime.experiments import AblationResult
    from runtime.experiments.design import Experiment, Variant

HELP = "baseline and variants on the same seeds, in one table and one figure"
DEFAULT_SEEDS = 10
ABOUT = """
Variants: --without, --bypass and --replace each begin one, and other changes belong to the variant
that they follow; before the first, they change the baseline and with it all variants. --variant
NAME begins one of that name, and all changes up to the next --variant are part of it. Without any
variant, every block is tried alone: bypassed if it has a through-pair, left out if the graph can
live without it, listed as essential otherwise.

  runtime ablate G --without adaptive --replace lqr=PID --set lqr.kp=2
  runtime ablate G --variant soft --set lqr.q='[0.01, 0.01, 0.01]' --seeds 0..19
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.description = ABOUT.strip()
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.add_argument("graph", help="a graph, or an experiment.yaml with variants")
    parser.add_argument(
        "--out", default="ablations", metavar="DIR", help="where folders go (ablations)"
    )
    parser.add_argument(
        "--test",
        choices=("t", "bootstrap"),
        default="t",
        help="intervals and differences by Student's t (default), or by resampling",
    )
    parser.add_argument(
        "--resume", metavar="FOLDER", help="go on with an ablation that was interrupted"
    )
    add_workers(parser, f"0..{DEFAULT_SEEDS - 1}")
    add_changes(parser, seed=False, variants=True)


def run(options: Namespace) -> int:
    """Run the variants; print the table and draw the figure."""
    start_early(options)
    from runtime.experiments import ablate
    from runtime.experiments.design import Seeds
    from runtime.experiments.execution import ablation_plan
    from runtime.runs import link_latest, new_folder
    from runtime.terminal import Progress

    experiment, variants, essential = _asked(options)
    seeds = chosen_seeds(options) or experiment.seeds or Seeds(((0, DEFAULT_SEEDS - 1),))
    quiet = options.quiet or options.json
    plan = ablation_plan(experiment, variants, seeds, noted(quiet))
    if not plan.metrics:
        raise UsageError("the graph measures nothing that variants could differ in; add 'metrics:'")
    folder = new_folder(Path(options.out), plan.name)
    if options.resume is not None:
        folder = Path(options.resume).resolve()
        if not folder.is_dir():
            raise UsageError(f"--resume {options.resume}: there is no such folder")
    done = ablate(
        *(plan, variants, essential, folder, pool_of(options), options.test, options.timeout),
        Progress(plan.name, wanted=not quiet),
    )
    link_latest(folder)
    if done.is_interrupted:
        tell(f"interrupted; --resume {folder} goes on")
        return 130
    pictures = [] if options.no_plots else _pictures(done)
    if options.json:
        show_json({**done.to_dict(), "plots": [str(path) for path in pictures]})
    else:
        _print(done, pictures, options.quiet)
    return 3 if all(row.status != "ok" for rows in done.rows.values() for row in rows) else 0


def _asked(options: Namespace) -> tuple[Experiment, list[Variant], dict[str, str]]:
    """The experiment with its variants, those of the file first; or every block tried alone."""
    from runtime.experiments.design import (
        Variant,
        check_variants,
        each_alone,
        grouped,
        read_experiment,
    )

    common, named = grouped(options.changes or ())
    options.changes = common
    experiment = read_experiment(
        options.graph, lambda graph: changed(graph, options), modules=not options.no_modules
    )
    graph = experiment.graph.check()
    variants = [
        *experiment.variants,
        *(Variant.of(name, with_changes(graph, changes), graph) for name, changes in named),
    ]
    essential: dict[str, str] = {}
    if variants:
        check_variants(variants)
    else:
        variants, essential = each_alone(graph)
    if not variants:
        raise UsageError("no block of this graph can be taken out alone; name variants yourself")
    return experiment, variants, essential


def _pictures(done: AblationResult) -> list[Path]:
    from runtime.experiments.analysis.ablation_plots import save_ablation_figure

    return [save_ablation_figure(done.folder)]


def _print(done: AblationResult, pictures: list[Path], quiet: bool) -> None:
    from runtime.experiments.analysis import legend, table

    plan = done.plan
    if not quiet:
        for variant in done.variants.values():
            for note in variant.graph.notes:
                tell(f"note: {variant.name}: {note}")
    show(f"{plan.name}: {len(plan.cases)} variants, seeds {plan.seeds}")
    lines = done.lines()
    show(f"{table(lines)}\n\n{legend(lines, done.test)}")
    for name, rows in done.rows.items():
        bad = [row for row in rows if row.status != "ok"]
        if bad:
            show(f"{name}: {len(bad)} of {len(rows)} runs not ok, first: {bad[0].reason}")
    if done.essential:
        show("\nessential, cannot be taken out alone:")
        for name, reason in done.essential.items():
            show(f"  {name}: {reason}")
    show(f"\nablation folder: {done.folder}")
    for path in pictures:
        show(f"  {path.relative_to(done.folder)}")
