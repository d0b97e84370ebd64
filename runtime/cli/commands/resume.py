"""``runtime resume``: go on with a run that was killed or interrupted, or for longer."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from runtime.arguments import Once, add_no_modules, add_output, seconds
from runtime.cli.commands.run import add_real_time
from runtime.cli.commands.running import run_graph
from runtime.cli.commands.showing import present
from runtime.terminal import tell

EVERY = 60.0  # s between two checkpoints
HELP = "go on with a run from its last checkpoint"
ABOUT = """
The run must have been started with --checkpoint. What comes out is a new run folder, with the same
bits as that of a run that was never interrupted.
"""
EXAMPLES = """
runtime resume runs/line_actuator_failure
runtime resume runs/line_actuator_failure/latest --until 120
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("run", help="a run folder, or the folder of a graph's runs for its newest")
    parser.add_argument("--until", type=float, metavar="TIME", help="a longer end of the run")
    parser.add_argument(
        "--checkpoint",
        action=Once,
        type=seconds,
        metavar="TIME",
        help="the time between two further checkpoints (60s)",
    )
    parser.add_argument(
        "--mixed",
        action="store_true",
        help="go on although another version of the program began the run: its numbers may differ",
    )
    add_no_modules(parser)
    add_real_time(parser)
    add_output(parser, "where the run is", "the new run folder")
    parser.set_defaults(out="", vs=None, labels="", animate=False, profile=False, watch=False)


def run(options: Namespace) -> int:
    """Go on, and write the run folder as ``runtime run`` does."""
    from runtime.graph import resumable
    from runtime.runs import root_of

    options.checkpoint = options.checkpoint or EVERY
    found = resumable(options.run, options.until, options.mixed, not options.no_modules)
    options.out = options.out or str(root_of(found.folder, found.graph.title))
    if not (options.quiet or options.json):
        tell(f"going on with {found.folder}")
    return present(run_graph(options, found.graph.check(), source=found.source), options)
