"""``runtime ablate``: compare a baseline and variants on the same seeds."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from functools import partial
from typing import TYPE_CHECKING

from runtime.cli.commands.changes import with_changes
from runtime.cli.commands.workers import (
    add_again,
    add_experiment,
    conclude,
    experiment_of,
    note_of,
    progress_of,
    run_options,
    start_early,
)
from runtime.terminal import tell

if TYPE_CHECKING:
    from runtime.experiments import AblationTable

HELP = "compare a baseline and variants on the same seeds"
ABOUT = """
--without, --bypass and --replace each begin a variant; other changes belong to the variant that
they follow. Changes before the first variant apply to the baseline and to all variants. --variant
NAME begins a variant with all changes up to the next --variant. If no variant is given, each block
is removed in turn: bypassed if it has a pass-through, removed if the graph runs without it, and
listed as essential otherwise.
"""
EXAMPLES = """
runtime ablate my.yaml --without adaptive --replace lqr=PathPID --set lqr.kp=2
runtime ablate my.yaml --without adaptive --primary error --margin error=0.001
runtime ablate my.yaml --variant soft --set lqr.q='[0.01, 0.01, 0.01]'
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph, or an experiment.yaml with variants")
    parser.add_argument(
        "--test",
        choices=("auto", "t", "ranks"),
        default="auto",
        help="paired t, or signed ranks; auto (default): ranks for skewed values and failed runs",
    )
    parser.add_argument(
        "--primary",
        action="append",
        metavar="METRIC",
        default=[],
        help="a metric that is tested, others are then described; repeatable (all are tested)",
    )
    parser.add_argument(
        "--margin",
        action="append",
        metavar="[METRIC=]D",
        default=[],
        help="the smallest difference that counts, as error=0.001 or 5%%; repeatable",
    )
    add_again(parser)
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
    if not (done.is_interrupted or options.quiet or options.json):
        _tell_notes(done)
    return conclude(options, done)


def _tell_notes(done: AblationTable) -> None:
    for variant in done.plan.variants:
        for note in variant.graph.notes:
            tell(f"note: {variant.name}: {note}")
    for name, rows in done.rows.items():
        reasons = [row.reason for row in rows if row.status == "ok" and row.reason]
        if reasons:
            tell(f"note: {name}: in {len(reasons)} of {len(rows)} trials, as {reasons[0]}")
