"""``runtime report``: write one HTML file about a run or an experiment."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from runtime.arguments import add_json
from runtime.files import write_out
from runtime.terminal import show, show_json

HELP = "write an HTML file about a run, sweep, ablation, tuning, contest"
EXAMPLES = """
runtime report runs/adaptive_line/latest
runtime report sweeps/adaptive_line -o sweep.html
runtime report contests/gains
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "path",
        metavar="FOLDER",
        help="folder of a run, sweep, ablation, tuning or contest, as in runs/<graph>/latest",
    )
    parser.add_argument(
        "-o", "--out", metavar="FILE", help="file to write (report.html in FOLDER); - is stdout"
    )
    add_json(parser)


def run(options: Namespace) -> int:
    """Write the report, and print its path."""
    from runtime.errors import UsageError
    from runtime.files import check_inside, system_errors, write_whole
    from runtime.reports import report

    if options.out == "-" and options.json:
        raise UsageError("'--out -' writes the page to stdout, where --json writes; leave one out")
    page = report(Path(options.path))
    if options.out == "-":
        sys.stdout.buffer.write(page.html.encode())
        return 0
    written = Path(options.out) if options.out else page.folder / "report.html"
    with system_errors(f"write '{written}'"):
        if options.out:
            write_out(written, page.html)
        else:
            check_inside(page.folder)
            write_whole(written, page.html)
    if options.json:
        summary = {"schema_version": 1, "kind": page.kind, "folder": str(page.folder)}
        show_json({**summary, "report": str(written)})
    else:
        show(written)
    return 0
