"""``runtime fit``: find numbers of a graph that reproduce recorded data."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

from runtime.arguments import add_output, integer
from runtime.cli.commands.changes import add_changes
from runtime.cli.commands.workers import experiment_of, note_of, show_results
from runtime.cli.commands.writing import check_writable, write_values
from runtime.errors import UsageError
from runtime.terminal import tell

if TYPE_CHECKING:
    from runtime.experiments.design import Measurement
    from runtime.fitting import Fit
    from runtime.graph import Graph

HELP = "find numbers of a graph that reproduce recorded data"
ABOUT = """
Runs the graph again and again, until its signals are as close as possible to columns of a file: by
least squares, within the ranges that --vary gives. Prints each number with its 95 % interval, and
says which numbers the data do not determine.
"""
EXAMPLES = """
runtime fit arm.yaml --vary arm.damping=0..1 --to push.csv:angle=arm.angle
runtime fit experiment.yaml --starts 8 --write
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph, or an experiment.yaml with 'data'")
    parser.add_argument(
        "--vary",
        action="append",
        metavar="PATH=RANGE",
        default=[],
        help="a number to find: arm.damping=0..1, gain.gain='log(0.1..10)'; repeatable",
    )
    parser.add_argument(
        "--to",
        action="append",
        metavar="FILE:COLUMN=SIGNAL[,...]",
        default=[],
        help="data: push.csv:angle=arm.angle; each --to is a run of its own; repeatable",
    )
    parser.add_argument(
        "--weight",
        action="append",
        metavar="SIGNAL=W",
        default=[],
        help="how much a signal's difference, in standard deviations of its data, counts (1)",
    )
    parser.add_argument(
        "--starts",
        type=integer(1, 10_000),
        default=4,
        metavar="N",
        help="starts of the search, the first from the graph's own numbers (4)",
    )
    parser.add_argument("--name", help="the fit's name (the graph's)")
    parser.add_argument(
        "--write", action="store_true", help="write the numbers into the file, comments kept"
    )
    add_output(parser, "fits", "fits")
    add_changes(parser)


def run(options: Namespace) -> int:
    """Fit, print the table, draw the figure."""
    from runtime.files import own_folder, remove_tree, system_errors
    from runtime.fitting import fit_model, model_of, summary
    from runtime.runs import new_folder
    from runtime.terminal import Progress

    experiment = experiment_of(options)
    if options.write:
        check_writable(experiment)
    model = model_of(experiment, _measurements(options, experiment.graph), note_of(options))
    # Made before the work, which may take hours.
    folder = new_folder(Path(options.out), experiment.name)
    with system_errors(f"write '{folder}'"):
        own_folder(folder)
    progress = Progress(experiment.name, wanted=not (options.quiet or options.json))
    fit = None
    try:
        fit = fit_model(model, options.starts, progress)
    except KeyboardInterrupt:
        tell(f"interrupted after {model.count} runs; nothing is written")
        return 130
    finally:
        progress.close()
        if fit is None:
            remove_tree(folder)
    stored, pictures, problem = _written(fit, folder, experiment.name, options)
    show_results(options, stored, summary(fit), pictures)
    if problem:
        raise UsageError(problem)
    if options.write:
        tell(f"note: the numbers are written into {write_values(experiment, fit.values)}")
    return 0


def _written(
    fit: Fit, folder: Path, name: str, options: Namespace
) -> tuple[dict[str, Any], list[Path], str]:
    """What is stored of a fit, its pictures, and what could not be written where it should be."""
    from runtime.fitting import as_plain, fit_figures, save_fit
    from runtime.runs import link_latest

    pictures: list[Path] = []
    try:
        stored = save_fit(fit, folder)
        link_latest(folder)
        if not options.no_plots:
            from runtime.experiments.analysis.figures import save_figures

            figures = fit_figures(fit, name, options.style)
            pictures = save_figures(folder, figures, options.figures)
        return stored, pictures, ""
    except UsageError as error:
        problem = str(error)
    try:
        elsewhere = Path(mkdtemp(prefix="spikeblocks-"))
        return save_fit(fit, elsewhere), [], f"{problem}; the fit is in '{elsewhere}'"
    except (OSError, UsageError):
        return {**as_plain(fit), "folder": str(folder)}, [], f"{problem}; it is printed above"


def _measurements(options: Namespace, graph: Graph) -> tuple[Measurement, ...]:
    from runtime.experiments.design import parse_measurement

    weights = dict(map(_weight, options.weight))
    found = [parse_measurement(text, graph) for text in options.to]
    unknown = weights.keys() - {signal for each in found for signal in each.signals.values()}
    if unknown:
        raise UsageError(f"--weight {min(unknown)}: there is no --to with this signal")
    return tuple(
        replace(each, weights={c: weights[s] for c, s in each.signals.items() if s in weights})
        for each in found
    )


def _weight(text: str) -> tuple[str, float]:
    signal, equals, number = text.partition("=")
    try:
        weight = float(number)
    except ValueError:
        weight = 0.0
    if not (equals and 0.0 < weight < float("inf")):
        raise UsageError(f"--weight {text}: expected SIGNAL=W with a number above 0")
    return signal.strip(), weight
