"""``runtime clean``: list, recover or remove what killed runs left behind."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from datetime import datetime
from pathlib import Path

from runtime.arguments import add_json
from runtime.errors import UsageError
from runtime.terminal import readable_bytes, show, show_json, tell

HELP = "list, recover or remove what killed runs left behind"
EXAMPLES = """
runtime clean
runtime clean runs --recover
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", nargs="?", default="runs", help="folder of run folders (runs)")
    parser.add_argument(
        "--recover",
        action="store_true",
        help="make a run folder from each recording of a killed run",
    )
    parser.add_argument("--yes", action="store_true", help="remove what is listed")
    add_json(parser)


def run(options: Namespace) -> int:
    """List leftovers; recover them with ``--recover``, remove them with ``--yes``."""
    from runtime.runs import leftovers, recover, remove

    found, code = leftovers(Path(options.folder)), 0
    rows = []
    for leftover in found:
        row = {"path": str(leftover.path), "bytes": leftover.size, "run": None, "removed": False}
        keep = False
        if options.recover and leftover.has_recording:
            try:
                row["run"] = str(recover(leftover))
            except UsageError as error:
                tell(error)
                keep, code = True, error.exit_code
        if options.yes and not keep:
            row["removed"] = remove(leftover)
        rows.append(row)
        if not options.json:
            when = datetime.fromtimestamp(leftover.changed_at).isoformat(" ", "minutes")
            show(f"{leftover.path}  {readable_bytes(leftover.size)}, {when}{_outcome(row)}")
    if options.json:
        show_json({"schema_version": 1, "leftovers": rows})
    elif not found:
        show(f"nothing left behind in {options.folder}")
    elif not options.yes:
        recordings = any(leftover.has_recording for leftover in found)
        offer = "; '--recover' makes runs from recordings" if recordings else ""
        tell(f"'runtime clean {options.folder} --yes' removes these{offer}")
    return code


def _outcome(row: dict[str, object]) -> str:
    recovered = f"; recovered as {row['run']}" if row["run"] else ""
    return recovered + ("; removed" if row["removed"] else "")
