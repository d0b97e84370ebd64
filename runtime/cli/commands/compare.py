"""``runtime compare``: runs side by side, and where they part."""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.terminal import show, show_json

if TYPE_CHECKING:
    from runtime.compare import Comparison

HELP = "overlay runs; what differs in graphs, metrics and probes"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "runs", nargs="+", metavar="run", help="run folders, as in runs/<graph>/latest; two or more"
    )
    parser.add_argument(
        "--exact",
        action="store_true",
        help="at which tick, and in which probe, bits first differ; exit code 1 if they do",
    )
    for flag, value, text in (
        ("--rtol", 1e-9, "tolerated difference relative to the first run's value (1e-9)"),
        ("--atol", 1e-12, "tolerated difference, in the probe's unit (1e-12)"),
    ):
        parser.add_argument(flag, type=_tolerance, default=value, metavar="X", help=text)
    parser.add_argument(
        "--probes", default="", metavar="NAME[,NAME]", help="these probes only (all)"
    )
    parser.add_argument(
        "--labels", default="", metavar="A,B[,...]", help="what to call the runs, in their order"
    )
    parser.add_argument(
        "--out", default="comparisons", metavar="DIR", help="where pictures go (comparisons)"
    )
    parser.add_argument("--no-plots", action="store_true", help="draw nothing")
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object and nothing else"
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="print no list of pictures")


def run(options: Namespace) -> int:
    """Compare, draw, print; 1 if ``--exact`` was asked for and bits differ."""
    from runtime.compare import as_data, compare, exact_summary, open_runs, summary

    runs = open_runs(options.runs, _names(options.labels))
    comparison = compare(runs, _names(options.probes), causes_first=options.exact)
    folder, pictures = (None, []) if options.no_plots else _pictures(comparison, options)
    if options.json:
        found = as_data(comparison, options.exact, options.rtol, options.atol)
        files = [str(path) for path in pictures]
        show_json({**found, "plots": files})
    else:
        tolerances = (options.rtol, options.atol)
        show(exact_summary(comparison) if options.exact else summary(comparison, *tolerances))
        if folder is not None and pictures and not options.quiet:
            show(f"\npictures: {folder}")
            for path in pictures:
                show(f"  {path.name}")
    sys.stdout.flush()
    is_apart = options.exact and not all(other.is_same for other in comparison.others)
    return 1 if is_apart else 0


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")] if text else []


def _tolerance(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise ArgumentTypeError(f"expected a number from 0, got '{text}'")
    return value


def _pictures(comparison: Comparison, options: Namespace) -> tuple[Path, list[Path]]:
    """Draw the runs over each other in a folder of their own."""
    from runtime.compare.overlay import save_overlays
    from runtime.errors import UsageError
    from runtime.runs import link_latest, new_folder

    names = [pair.name for other in comparison.others for pair in other.pairs if not pair.fault]
    folder = new_folder(Path(options.out), comparison.runs[0].result.title)
    try:
        pictures = save_overlays(comparison.runs, list(dict.fromkeys(names)), folder)
    except OSError as error:
        raise UsageError(f"cannot write '{folder}': {error.strerror or error}") from None
    link_latest(folder)
    return folder, pictures
