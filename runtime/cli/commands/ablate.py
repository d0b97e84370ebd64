"""``runtime ablate``: compare a baseline and variants on the same seeds."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.cli.commands import add_output, show_folder
from runtime.cli.commands.changes import add_changes, changed, with_changes
from runtime.cli.commands.workers import add_workers, chosen_seeds, pool_of, start_early
from runtime.errors import UsageError
from runtime.terminal import show, show_json, tell

if TYPE_CHECKING:
    from runtime.experiments import AblationResult
    from runtime.experiments.design import Experiment, Variant

HELP = "compare a baseline and variants on the same seeds, in a table and a figure"
DEFAULT_SEEDS = 10
ABOUT = """
--without, --bypass and --replace each begin a variant; other changes belong to the variant that
they follow. Changes before the first variant apply to the baseline and to all variants. --variant
NAME begins a variant with all changes up to the next --variant. If no variant is given, each block
is removed in turn: bypassed if it has a pass-through, removed if the graph runs without it, and
listed as essential otherwise.

  runtime ablate G --without adaptive --replace lqr=PathPID --set lqr.kp=2
  runtime ablate G --variant soft --set lqr.q='[0.01, 0.01, 0.01]' --seeds 0..19
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.description = ABOUT.strip()
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.add_argument("graph", help="a graph, or an experiment.yaml with variants")
    parser.add_argument(
        "--test",
        choices=("t", "bootstrap"),
        default="t",
        help="intervals and tests by Student's t (default), or by resampling",
    )
    parser.add_argument("--resume", metavar="FOLDER", help="continue an interrupted ablation")
    add_workers(parser, f"0..{DEFAULT_SEEDS - 1}")
    add_output(parser, "ablations", "ablations")
    add_changes(parser, seed=False, variants=True)


def run(options: Namespace) -> int:
    """Run the trials that have no row yet; print the table and draw the figure."""
    start_early(options)
    from runtime.engine import silent
    from runtime.experiments import run_ablation
    from runtime.experiments.design import Seeds
    from runtime.experiments.execution import ablation_plan
    from runtime.runs import link_latest, new_folder
    from runtime.terminal import Progress

    experiment, variants, essential = _requested(options)
    seeds = chosen_seeds(options) or experiment.seeds or Seeds(((0, DEFAULT_SEEDS - 1),))
    quiet = options.quiet or options.json
    plan = ablation_plan(experiment, variants, seeds, silent if quiet else tell)
    if not plan.metrics:
        raise UsageError("the graph has no metrics to compare variants by; add 'metrics:'")
    folder = new_folder(Path(options.out), plan.name)
    if options.resume is not None:
        folder = Path(options.resume).resolve()
        if not folder.is_dir():
            raise UsageError(f"--resume {options.resume}: there is no such folder")
    done = run_ablation(
        *(plan, variants, essential, folder, pool_of(options), options.test, options.timeout),
        Progress(plan.name, wanted=not quiet),
    )
    link_latest(folder)
    if done.is_interrupted:
        tell(f"interrupted; --resume {folder} continues it")
        return 130
    pictures: list[Path] = []
    if not options.no_plots:
        from runtime.experiments.analysis.ablation_plots import save_ablation_figure

        pictures = [save_ablation_figure(done.folder)]
    if options.json:
        show_json({**done.to_dict(), "plots": [str(path) for path in pictures]})
    else:
        _print(done, pictures, options.quiet)
    return 3 if all(row.status != "ok" for rows in done.rows.values() for row in rows) else 0


def _requested(options: Namespace) -> tuple[Experiment, list[Variant], dict[str, str]]:
    """The experiment and its variants, those of its file first; or each block removed in turn."""
    from runtime.experiments.design import (
        Variant,
        check_variants,
        grouped,
        read_experiment,
        removals,
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
        variants, essential = removals(graph)
    if not variants:
        raise UsageError("no block of this graph can be removed alone; give variants")
    return experiment, variants, essential


def _print(done: AblationResult, pictures: list[Path], quiet: bool) -> None:
    from runtime.experiments.analysis import comparison_table, legend

    plan = done.plan
    if not quiet:
        for variant in done.variants.values():
            for note in variant.graph.notes:
                tell(f"note: {variant.name}: {note}")
    show(f"{plan.name}: {len(plan.variants)} variants, seeds {plan.seeds}")
    lines = done.lines()
    show(f"{comparison_table(lines, plan.units, plan.never)}\n\n{legend(lines, done.test)}")
    for name, rows in done.rows.items():
        bad = [row for row in rows if row.status != "ok"]
        if bad:
            show(f"{name}: {len(bad)} of {len(rows)} trials failed, first: {bad[0].reason}")
        noted = [row for row in rows if row.status == "ok" and row.reason]
        if noted:
            tell(f"note: {name}: in {len(noted)} of {len(rows)} trials, as {noted[0].reason}")
    if done.essential:
        show("\nessential, cannot be removed alone:")
        for name, reason in done.essential.items():
            show(f"  {name}: {reason}")
    show()
    show_folder("ablation", done.folder, pictures)
