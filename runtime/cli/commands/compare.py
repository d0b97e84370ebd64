"""``runtime compare``: overlay runs, and list their differences."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.arguments import add_output, at_least
from runtime.terminal import show, show_json

if TYPE_CHECKING:
    from runtime.compare import Comparison

HELP = "overlay runs; list differences in graphs, metrics and probes"
EXAMPLES = """
runtime compare runs/a/latest runs/b/latest --labels before,after
runtime compare runs/a/latest runs/b/latest --exact
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "runs", nargs="+", metavar="run", help="run folders, as in runs/<graph>/latest; two or more"
    )
    parser.add_argument(
        "--exact",
        action="store_true",
        help="first tick and probe at which runs differ in any bit; exit code 1 if they do",
    )
    for flag, value, text in (
        ("--rtol", 1e-9, "tolerated difference relative to the first run's value (1e-9)"),
        ("--atol", 1e-12, "tolerated difference, in the probe's unit (1e-12)"),
    ):
        parser.add_argument(flag, type=at_least(0.0), default=value, metavar="X", help=text)
    parser.add_argument(
        "--probes", default="", metavar="NAME[,NAME]", help="compare only these probes (all)"
    )
    parser.add_argument(
        "--labels", default="", metavar="A,B[,...]", help="names of the runs, in their order"
    )
    add_output(parser, "comparisons", "pictures")


def run(options: Namespace) -> int:
    """Compare, draw and print; returns 1 if ``--exact`` is given and any bit differs."""
    from runtime.compare import as_data, compare, exact_summary, open_runs, summary

    runs = open_runs(options.runs, _names(options.labels))
    folder = None if options.no_plots else _folder(options, runs[0].result.title)
    comparison = compare(runs, _names(options.probes), causes_first=options.exact)
    pictures = [] if folder is None else _pictures(comparison, options, folder)
    if options.json:
        stored = as_data(comparison, options.exact, options.rtol, options.atol)
        files = [str(path) for path in pictures]
        show_json({**stored, "plots": files})
    else:
        tolerances = (options.rtol, options.atol)
        show(exact_summary(comparison) if options.exact else summary(comparison, *tolerances))
        if folder is not None and pictures and not options.quiet:
            show(f"\npictures: {folder}")
            for path in pictures:
                show(f"  {path.name}")
    sys.stdout.flush()
    differs = options.exact and not all(other.is_same for other in comparison.others)
    return 1 if differs else 0


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")] if text else []


def _folder(options: Namespace, title: str) -> Path:
    """A new folder for pictures, made before they are drawn."""
    from runtime.files import own_folder, system_errors
    from runtime.runs import new_folder

    folder = new_folder(Path(options.out), title)
    with system_errors(f"write '{folder}'"):
        return own_folder(folder)


def _pictures(comparison: Comparison, options: Namespace, folder: Path) -> list[Path]:
    """Draw the overlaid runs into a folder."""
    from runtime.compare.overlay import save_overlays
    from runtime.files import system_errors
    from runtime.runs import link_latest

    names = [pair.name for other in comparison.others for pair in other.pairs if not pair.fault]
    with system_errors(f"write '{folder}'"):
        probes, how = list(dict.fromkeys(names)), (options.figures, options.style)
        pictures = save_overlays(comparison.runs, probes, folder, *how)
    link_latest(folder)
    return pictures
