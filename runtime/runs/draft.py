"""Creating a run folder in one step, and recovering what killed runs left behind.

In: a result and the path of its folder. Out: the complete folder, or none. Until a run is complete,
all of it lies in a hidden folder beside its final one, which is locked while its process lives::

    runs/my/.20260102-030405-ab12cd-3f9a01.partial/
        lock           held by the process; the system releases it, however the process ends
        recording/     what does not fit into memory
        run/           the run folder that is being written; renamed when it is complete

A killed process leaves the hidden folder behind: it can be made into a run, or removed. Links are
neither followed nor removed.
"""

from __future__ import annotations

import os
import re
import secrets
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from tempfile import mkdtemp

from blocks.core import FloatArray
from blocks.files import read
from blocks.limits import GRAPH_ARRAYS
from runtime.engine import recording_file, row_times
from runtime.errors import UsageError
from runtime.files import lock, open_file, point_link, remove_tree, slug, system_errors
from runtime.observation import RunData
from runtime.runs.commit import git_commit
from runtime.runs.folder import MANIFEST, RESOLVED, WRITTEN, read_manifest, run_from_manifest, write
from runtime.streaming import DAMAGED, open_rows

PARTIAL, RECORDING, RUN, LOCK = ".partial", "recording", "run", "lock"
# Hidden folders of runs; earlier versions had one for recordings only.
_HIDDEN = re.compile(rf"\.(?P<name>.+?)(-[0-9a-f]{{6}})?({re.escape(PARTIAL)}|\.recording)")
YOUNG = 60.0  # s; a younger folder without a lock may be about to get one
RECOVERED = "the process was killed; recovered from its recording"


def new_folder(root: Path, title: str) -> Path:
    """A fresh folder name for a run: root/<graph>/<date>-<time>-<id>."""
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    return root / slug(title) / f"{stamp}-{secrets.token_hex(3)}"


def root_of(folder: Path, title: str) -> Path:
    """Where :func:`new_folder` was to put a run of a graph that is in this folder."""
    return folder.parent.parent if folder.parent.name == slug(title) else folder.parent


def link_latest(folder: Path) -> None:
    """Point ``latest`` beside a run's folder to it; does nothing where links are not supported."""
    point_link(folder.parent / "latest", folder.name)


class Draft:
    """A run folder that is not complete yet.

    Parameters
    ----------
    folder : the path of the complete run folder; it must not exist yet.

    Raises
    ------
    UsageError : the path exists, or cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.partial = folder.with_name(f".{slug(folder.name)}-{secrets.token_hex(3)}{PARTIAL}")
        self._lock: int | None = None
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            if _is_there(folder):
                text = f"'{folder}' exists already; a run is never written over another"
                raise UsageError(text)
            self.partial.mkdir()
            self._lock = open_file(self.partial / LOCK, os.O_CREAT | os.O_RDWR)
        except (OSError, ValueError) as error:
            remove_tree(self.partial)
            raise UsageError(f"cannot write '{folder}': {_reason(error)}") from None
        lock(self._lock)
        # Read now: another commit may be checked out during the run.
        self.commit = git_commit()

    @property
    def recordings(self) -> Path:
        """The folder for recordings that are larger than memory."""
        return self.partial / RECORDING

    def save(self, result: RunData) -> Path:
        """Write the run; its folder appears only when it is complete.

        Raises
        ------
        UsageError : it cannot be written. The recordings are kept.
        """
        complete = self.partial / RUN
        try:
            with system_errors(f"write '{self.folder}'"):
                remove_tree(complete)
                complete.mkdir(parents=True)
                write(result, complete, self.commit)
                # A rename within a file system is atomic: nobody ever sees half a run.
                complete.rename(self.folder)
        except UsageError:
            remove_tree(complete)
            raise
        return self.folder

    def close(self) -> None:
        """Remove the hidden folder and release its lock."""
        remove_tree(self.partial)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
            remove_tree(self.partial)  # Windows removes no file that is open


def save(result: RunData, folder: Path) -> Path:
    """Write a result; the folder appears only when it is complete.

    Raises
    ------
    UsageError : the folder exists, or cannot be written.
    """
    draft = Draft(folder)
    try:
        return draft.save(result)
    finally:
        draft.close()


# A simulation of hours must not be lost to a disk that is full or a folder that was removed
# meanwhile.
def save_elsewhere(result: RunData, name: str) -> Path:
    """Write a result into a fresh temporary folder, for when its own folder cannot be written.

    Raises
    ------
    UsageError : the temporary folder cannot be written either.
    """
    with system_errors("write a temporary folder"):
        root = Path(mkdtemp(prefix="spikeblocks-"))
    try:
        return save(result, root / name)
    except UsageError:
        remove_tree(root)
        raise


def _is_there(folder: Path) -> bool:
    """Whether anything of that name exists; OSError or ValueError for an impossible name."""
    try:
        folder.lstat()
    except FileNotFoundError:
        return False
    return True


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


@dataclass(frozen=True)
class Leftover:
    """A hidden folder whose process has ended: path, run name, size in bytes and last change."""

    path: Path
    name: str
    size: int
    changed_at: float

    @property
    def has_recording(self) -> bool:
        """Whether a run can be recovered from it."""
        return (self.path / RECORDING / MANIFEST).is_file()


def leftovers(root: Path) -> list[Leftover]:
    """The hidden folders below ``root`` (root/<graph>/.*) whose processes have ended.

    Raises
    ------
    UsageError : the folder cannot be read.
    """
    with system_errors(f"read '{root}'"):
        folders = [Path(entry.path) for entry in _folders(root)]
        inside = [path for folder in folders for path in _readable(folder)]
    result = []
    for path in sorted([*folders, *inside]):
        match = _HIDDEN.fullmatch(path.name)
        if match is not None and not _is_alive(path):
            result.append(Leftover(path, match["name"], _size(path), path.lstat().st_mtime))
    return result


def _folders(root: Path) -> list[os.DirEntry[str]]:
    with os.scandir(root) as entries:
        return [entry for entry in entries if entry.is_dir(follow_symlinks=False)]


def _readable(folder: Path) -> Iterator[Path]:
    """The folders in a folder; none if it cannot be read."""
    try:
        yield from (Path(entry.path) for entry in _folders(folder))
    except OSError:
        return


def _is_alive(path: Path) -> bool:
    try:
        file = open_file(path / LOCK, os.O_RDWR)
    except FileNotFoundError:
        # Between the folder and its lock there is a moment without a lock: a young folder counts as
        # alive.
        return time.time() - path.lstat().st_mtime < YOUNG
    except OSError:
        return True  # another user's
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
    """Remove a leftover unless a process uses it; returns whether it was removed."""
    # Asked again: the list may be minutes old, and a new process may have taken the name.
    if not _is_alive(leftover.path):
        remove_tree(leftover.path)
    return not leftover.path.exists()


def recover(leftover: Leftover) -> Path:
    """Recover a run from the recording of a killed one; returns its folder.

    Its metrics have no values: computing them would execute the graph's modules. The leftover
    stays until it is removed.

    Raises
    ------
    UsageError : there is no recording, it is damaged, or the run cannot be written.
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
        return draft.save(_read_recording(source))
    finally:
        draft.close()


def _read_recording(source: Path) -> RunData:
    details = read_manifest(source)
    ticks_of_rows, dt = details.pop("ticks_of_rows", {}), details.get("dt")
    names = details.pop("metrics", [])
    arrays: dict[str, FloatArray] = {}
    try:
        for name in details["probes"]:
            rows = _rows(source / recording_file(name))
            if rows is not None:
                arrays[name] = rows
                step, late = (float(dt * ticks) for ticks in ticks_of_rows[name])
                arrays[f"{name}.time"] = row_times(0, len(rows), step, late)
        # The manifest was written before the first tick; how far the run came is known from its
        # rows alone.
        counts = (len(arrays[n]) * k[0] + k[1] for n, k in ticks_of_rows.items() if n in arrays)
        ticks = max(counts, default=0)
        details["probes"] = {n: info for n, info in details["probes"].items() if n in arrays}
        # A probe without a row has no array, and a plot of it would only say so.
        details["plots"] = [p for p in details["plots"] if set(p["of"]) <= set(arrays)]
        details |= {"status": "interrupted", "error": RECOVERED, "ticks": ticks}
        details["notes"] = [*details["notes"], f"metrics have no values: {RECOVERED}"]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(f"'{source / MANIFEST}' is damaged: {error!r}") from None
    result = run_from_manifest(source, details, arrays, dict.fromkeys(map(str, names)))
    texts = {WRITTEN, RESOLVED, MANIFEST}
    result.files = {
        path.name: read(path, GRAPH_ARRAYS)
        for path in source.iterdir()
        if path.suffix != ".npy" and path.name not in texts and not path.is_symlink()
    }
    return result


def _rows(path: Path) -> FloatArray | None:
    """The recorded rows of a probe; None if there are none."""
    try:
        rows = open_rows(path)
    except DAMAGED:
        return None
    return rows if rows.ndim and len(rows) else None
