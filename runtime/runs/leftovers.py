"""What killed runs left behind: found, made into runs that can be read, removed.

A run's hidden folder is locked while its process lives (:mod:`runtime.runs.folder`), so that what
belongs to a run that goes on is never touched. Links are neither followed nor removed.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.engine import recording_file
from runtime.errors import UsageError
from runtime.files import remove_tree
from runtime.observation import RunData
from runtime.runs.folder import LOCK, MANIFEST, PARTIAL, RECORDING, RESOLVED, WRITTEN, Draft, lock
from runtime.runs.reading import described_run, read_manifest

# The hidden folders of a run, and those of versions that had one for recordings alone.
_HIDDEN = re.compile(rf"\.(?P<name>.+?)(-[0-9a-f]{{6}})?({re.escape(PARTIAL)}|\.recording)")
YOUNG = 60.0  # s: what is younger and has no lock may be about to get one
RECOVERED = "the process was killed; recovered from what it had recorded"


@dataclass(frozen=True)
class Leftover:
    """A hidden folder without a process: where, of which run, its bytes and its last change."""

    path: Path
    name: str
    size: int
    changed: float

    @property
    def has_recording(self) -> bool:
        """Whether a run can be made of it."""
        return (self.path / RECORDING / MANIFEST).is_file()


def leftovers(root: Path) -> list[Leftover]:
    """The hidden folders below ``root`` (root/<graph>/.*) whose processes are gone.

    Raises
    ------
    UsageError : the folder cannot be read.
    """
    try:
        folders = [Path(entry.path) for entry in _folders(root)]
        inside = [path for folder in folders for path in _readable(folder)]
    except OSError as error:
        raise UsageError(f"cannot read '{root}': {error.strerror or error}") from None
    found = []
    for path in sorted([*folders, *inside]):
        named = _HIDDEN.fullmatch(path.name)
        if named is not None and not _is_alive(path):
            found.append(Leftover(path, named["name"], _size(path), path.lstat().st_mtime))
    return found


def _folders(root: Path) -> list[os.DirEntry[str]]:
    with os.scandir(root) as entries:
        return [entry for entry in entries if entry.is_dir(follow_symlinks=False)]


def _readable(folder: Path) -> Iterator[Path]:
    """The folders in a folder; none in one that somebody else keeps to themselves."""
    try:
        yield from (Path(entry.path) for entry in _folders(folder))
    except OSError:
        return


def _is_alive(path: Path) -> bool:
    try:
        file = os.open(path / LOCK, os.O_RDWR | os.O_NOFOLLOW)
    except FileNotFoundError:
        return time.time() - path.lstat().st_mtime < YOUNG
    except OSError:
        return True  # somebody else's
    try:
        return not lock(file)
    finally:
        os.close(file)


def _size(path: Path) -> int:
    total = 0
    for folder, _, names in os.walk(path, followlinks=False):
        total += sum((Path(folder) / name).lstat().st_size for name in names)
    return total


def remove(leftover: Leftover) -> bool:
    """Remove a leftover unless a process has taken it up; returns whether it is gone."""
    if not _is_alive(leftover.path):
        remove_tree(leftover.path)
    return not leftover.path.exists()


def recover(leftover: Leftover) -> Path:
    """Make a run of what a killed one had recorded; returns its folder.

    Its metrics have no values: what it takes to measure it would run the graph's modules. The
    leftover stays until it is removed.

    Raises
    ------
    UsageError : it holds no recording, a damaged one, or the run cannot be written.
    """
    source = leftover.path / RECORDING
    if not leftover.has_recording:
        raise UsageError(f"'{leftover.path}' holds no recording")
    target = leftover.path.parent / leftover.name
    if os.path.lexists(target):
        raise UsageError(f"'{target}' exists already; '{leftover.path}' can be removed")
    draft = Draft(target)
    try:
        draft.commit = read_manifest(source).get("git")
        return draft.save(_recovered(source))
    finally:
        draft.close()


def _recovered(source: Path) -> RunData:
    details = read_manifest(source)
    every, dt = details.pop("every", {}), details.get("dt")
    names = details.pop("metrics", [])
    arrays: dict[str, FloatArray] = {}
    try:
        for name in details["probes"]:
            rows = _rows(source / recording_file(name))
            if rows is not None:
                arrays[name] = rows
                step = float(dt * every[name])
                arrays[f"{name}.time"] = np.arange(len(rows), dtype=np.float64) * step
        ticks = max((len(arrays[n]) * every[n] for n in arrays if n in every), default=0)
        details["probes"] = {n: info for n, info in details["probes"].items() if n in arrays}
        details["plots"] = [p for p in details["plots"] if set(p["of"]) <= set(arrays)]
        details |= {"status": "interrupted", "error": RECOVERED, "ticks": ticks}
        details["notes"] = [*details["notes"], f"metrics have no values: {RECOVERED}"]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(f"'{source / MANIFEST}' is damaged: {error!r}") from None
    result = described_run(source, details, arrays, dict.fromkeys(map(str, names)))
    texts = {WRITTEN, RESOLVED, MANIFEST}
    result.files = {
        path.name: path.read_bytes()
        for path in source.iterdir()
        if path.suffix != ".npy" and path.name not in texts and not path.is_symlink()
    }
    return result


def _rows(path: Path) -> FloatArray | None:
    """What was recorded of a probe; None if nothing was."""
    try:
        rows: Any = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    return np.asarray(rows) if rows.dtype == np.float64 and len(rows) else None
