"""``runtime run --watch``: run again whenever a file of the graph is saved."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.cli.problems import report
from runtime.errors import NOWHERE, SpikeblocksError
from runtime.terminal import show, tell

if TYPE_CHECKING:
    from runtime.runs import Result

POLL = 0.25  # s between two looks at the files
Stamp = dict[Path, tuple[int, int]]


@dataclass
class Done:
    """A run that has ended: its exit code, its result, and the files that it depends on."""

    code: int
    result: Result
    files: list[Path]


def watch(name: str, once: Callable[[Result | None], Done]) -> int:
    """Run, wait until a file is saved, and run again, until Ctrl-C; returns the exit code.

    Parameters
    ----------
    name : the graph's file, or the name of a shipped one.
    once : runs the graph; its argument is the last run that did not fail.
    """
    from runtime.document import find_file

    main = find_file(name, (NOWHERE, ""), Path()).resolve()
    before: Result | None = None
    files: set[Path] = set()
    try:
        while True:
            stamp = _stamp(_near(main) | files)
            try:
                done = once(before)
            except SpikeblocksError as error:
                report(error)
            else:
                if done.code == 130:
                    return 0
                before, files = done.result, set(done.files)
            known = _near(main) | files
            stamp |= {path: at for path, at in _stamp(known).items() if path not in stamp}
            show(f"watching {len(known)} files; save one to run again, Ctrl-C ends", flush=True)
            _wait_for_change(main, files, stamp)
    except KeyboardInterrupt:
        tell("no longer watching")
        return 0


def _wait_for_change(main: Path, files: set[Path], stamp: Stamp) -> None:
    """Return once a file differs, and none has changed since the last look."""
    last = stamp
    while True:
        time.sleep(POLL)
        now = _stamp(_near(main) | files)
        if now == last != stamp:
            return
        last = now


def _near(main: Path) -> set[Path]:
    """The graph's file, and all graphs, modules and arrays beside it, which it may name."""
    found = {main}
    for pattern in ("*.yaml", "*.yml", "*.py", "*.npz"):
        found.update(main.parent.glob(pattern))
    return found


def _stamp(files: Iterable[Path]) -> Stamp:
    """Modification time and size of each file that is there."""
    found = {}
    for path in files:
        try:
            status = path.stat()
        except OSError:
            continue  # an editor may replace a file by renaming another
        found[path] = (status.st_mtime_ns, status.st_size)
    return found
