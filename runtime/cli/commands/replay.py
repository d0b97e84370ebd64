"""``runtime replay``: compute a saved session again, and compare it with what was saved."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from runtime.arguments import add_no_modules
from runtime.errors import UsageError
from runtime.terminal import show, show_json

HELP = "compute a saved session again, and compare every bit"
ABOUT = """
A session is saved by Session.save, with its changes and their ticks. The exit code is 1 if a
recording differs from the saved one.
"""
EXAMPLES = """
runtime replay sessions/a
runtime replay sessions/a --save sessions/b
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("session", help="the folder of a saved session")
    parser.add_argument("--save", metavar="FOLDER", help="write what comes out as a session")
    add_no_modules(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(options: Namespace) -> int:
    """Compute the session, and print what differs."""
    import numpy as np

    from runtime.graph import is_session, open_session
    from runtime.runs import open_run
    from runtime.sessions import RUN

    if not is_session(options.session):
        raise UsageError(f"'{options.session}' is no saved session, which Session.save writes")
    saved = open_run(Path(options.session) / RUN)
    session = open_session(options.session, not options.no_modules)
    result = session.result()
    different = [
        name
        for name, recording in saved.probes.items()
        if name not in result.probes
        or not np.array_equal(recording.values, result.probes[name].values, equal_nan=True)
    ]
    if options.save:
        session.save(options.save)
    if options.json:
        show_json({"ticks": session.tick, "changes": len(session.log), "different": different})
    else:
        count = len(session.log)
        show(f"{result.title}: {session.tick} ticks, {count} change{'s' * (count != 1)}")
        equal = "all recordings have the bits that were saved"
        show(f"different: {', '.join(different)}" if different else equal)
    return 1 if different else 0
