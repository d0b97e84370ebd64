"""``runtime ablate``: compare a baseline and variants on the same seeds."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.arguments import show_folder
from runtime.cli.commands.changes import with_changes
from runtime.cli.commands.workers import (
    add_experiment,
    experiment_of,
    note_of,
    progress_of,
    run_options,
    start_early,
)
from runtime.terminal import show, show_json, tell

if TYPE_CHECKING:
    from runtime.experiments import AblationResult

HELP = "compare a baseline and variants on the same seeds, in a table and a figure"
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
    add_experiment(parser, "ablation", "ablations", "0..9", variants=True)


def run(options: Namespace) -> int:
    """Run the trials that have no row yet; print the table and draw the figure."""
    start_early(options)
    from runtime.experiments import run_ablation
    from runtime.experiments.design import group_changes
    from runtime.experiments.execution import ablation_plan

    options.changes, named = group_changes(options.changes or ())
    variants = [(name, partial(with_changes, changes=changes)) for name, changes in named]
    plan = ablation_plan(experiment_of(options, variants), note_of(options))
    progress = progress_of(options, plan.name)
    done = run_ablation(plan, run_options(options, plan.name), progress, options.test)
    if done.is_interrupted:
        tell(f"interrupted; --resume continues {done.folder}")
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


def _print(done: AblationResult, pictures: list[Path], quiet: bool) -> None:
    from runtime.experiments.analysis import comparison_table, legend

    plan = done.plan
    if not quiet:
        for variant in plan.variants:
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
    if plan.essential:
        show("\nessential, cannot be removed alone:")
        for name, reason in plan.essential.items():
            show(f"  {name}: {reason}")
    show()
    show_folder("ablation", done.folder, pictures)
