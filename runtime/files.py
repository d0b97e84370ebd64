"""Files in folders that somebody else may have made: bounded reading, and no links followed."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from runtime.errors import UsageError

MAX_TEXT = 64 * 2**20  # bytes of a text that a folder holds


def read_text(path: Path) -> str:
    """A UTF-8 text of up to :data:`MAX_TEXT` bytes.

    Raises
    ------
    OSError, ValueError : it cannot be read, is longer, or is no UTF-8.
    """
    with path.open("rb") as file:
        data = file.read(MAX_TEXT + 1)
    if len(data) > MAX_TEXT:
        raise ValueError(f"more than {MAX_TEXT // 2**20} MiB")
    return data.decode("utf-8")


def refuse_link(path: Path) -> None:
    """Check that a folder to write into, inside a run's folder, is no link.

    Raises
    ------
    UsageError : it is one.
    """
    if path.is_symlink():
        said = "is a link, which is not followed when files are written; name another folder"
        raise UsageError(f"'{path}' {said}, or remove the link")


def own_folder(path: Path) -> Path:
    """A folder to write into, made if it is not there; never what a link leads to.

    Raises
    ------
    UsageError : the path is a link. OSError : the folder cannot be made.
    """
    refuse_link(path)
    path.mkdir(parents=True, exist_ok=True)
    return path


def own_file(path: Path) -> Path:
    """A path to write to: a link that stands there is removed, and its target left alone."""
    if path.is_symlink():
        path.unlink()
    return path


def check_inside(folder: Path) -> None:
    """Check that a run folder's path, if it is a link as ``latest`` is, leads to its neighbour.

    Raises
    ------
    UsageError : it leads elsewhere, and writing there was not asked for.
    """
    if folder.is_symlink() and folder.resolve().parent != folder.parent.resolve():
        said = f"is a link that leads to '{folder.resolve()}'; name that folder itself"
        raise UsageError(f"'{folder}' {said}, or where to write with --out")


def write_whole(path: Path, text: str) -> None:
    """Write a file that is there whole or not at all; a link in its place is replaced.

    Raises
    ------
    OSError : it cannot be written.
    """
    handle, name = tempfile.mkstemp(prefix=f".{path.name[:80]}.", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        mask = os.umask(0)
        os.umask(mask)
        Path(name).chmod(0o666 & ~mask)
        Path(name).replace(path)
    except OSError:
        Path(name).unlink(missing_ok=True)
        raise
