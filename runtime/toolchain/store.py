"""The cache folder: files named by a hash of what they were made from, kept with their own hash.

In: a name and bytes. Out: the same bytes, or None::

    write("unit_3f2a.o", content)        # and unit_3f2a.o.sha256
    read("unit_3f2a.o")                  # None if a bit of either has changed

An entry's name says what it was made from, so no entry is ever out of date, and two processes that
write the same entry write equally good files. An entry counts only if its content has the hash that
was stored with it. Only the user may write to the folder, since its content is executed.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any
from weakref import finalize

from blocks import files
from runtime.files import remove_tree, write_whole

VARIABLE = "SPIKEBLOCKS_CACHE"
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
LIMIT = 500 * 2**20  # bytes of the whole folder; the oldest entries beyond it are removed
SHARE_AFTER = 0.9  # share of the limit that remains, so that not every build removes something
DAY = 86400.0  # s
PAUSE = 600.0  # s between two walks through the folder: one reads each of its many thousand entries
WALKED = ".walked"
SEAL = ".sha256"
WORK = ".build-"


def folder() -> Path:
    """The cache folder: ``$SPIKEBLOCKS_CACHE``, or one in the user's cache folder.

    If that cannot be written, or others may write to it or replace it, a temporary folder of this
    process. Checked each time, since what is in it is executed.
    """
    path = _folder(os.environ.get(VARIABLE), os.environ.get("XDG_CACHE_HOME"))
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)  # it may have been removed
        return path if _is_private(path) else _own_folder()
    except OSError:
        return _own_folder()


@cache
def _folder(chosen: str | None, base: str | None) -> Path:
    try:
        path = Path(chosen) if chosen else Path(base or Path.home() / ".cache") / "spikeblocks"
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        if path.is_symlink() or not _is_private(path):
            return _own_folder()
        path.chmod(0o700)
        with tempfile.TemporaryFile(dir=path):
            # Without links on the way, which others could point elsewhere.
            return path.resolve()
    except (OSError, RuntimeError):  # no home folder is a RuntimeError
        return _own_folder()


def _is_private(path: Path) -> bool:
    """Whether only the user can put files into a folder, and only root besides can replace it."""
    # Under Windows, the mode says nothing, and a profile is its user's alone.
    if not hasattr(os, "getuid"):
        return True
    user, status = os.getuid(), path.lstat()
    is_own = stat.S_ISDIR(status.st_mode) and status.st_uid == user
    if not is_own or status.st_mode & OTHERS_WRITE:
        return False  # others may have written to it
    return all(_is_closed(parent.lstat(), user) for parent in path.resolve().parents)


def _is_closed(status: os.stat_result, user: int) -> bool:
    """Whether no other user can put another folder in the place of one that is in a folder.

    Its owner can, whatever its mode; so can who may write to it, unless it is sticky.
    """
    is_shared = status.st_mode & OTHERS_WRITE and not status.st_mode & stat.S_ISVTX
    return status.st_uid in (0, user) and not is_shared


@cache
def _own_folder() -> Path:
    path = Path(tempfile.mkdtemp(prefix="spikeblocks-"))
    finalize(_own_folder, _remove_own, path, os.getpid())
    return path


def _remove_own(path: Path, process: int) -> None:
    if os.getpid() == process:  # not at the end of a process that was forked from it
        shutil.rmtree(path, ignore_errors=True)


def digest(*parts: str) -> str:
    """A name for what an entry is made from."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:32]


def verified_path(name: str) -> Path | None:
    """The file of an entry; None if it is missing or its content is not what was stored."""
    path = folder() / name
    return None if read(name) is None or path.parent != folder() else path


def read(name: str) -> bytes | None:
    """The content of an entry; None if it is missing or is not what was stored."""
    path = folder() / name
    try:
        content, seal = (files.read(each, LIMIT) for each in (path, Path(f"{path}{SEAL}")))
    except OSError:
        return None
    if seal != _hash(content):
        return None
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > DAY:
            os.utime(path)  # used lately: not the next to be removed
    return content


def write(name: str, content: bytes) -> Path:
    """Store an entry.

    Raises
    ------
    OSError : it cannot be written.
    """
    path = folder() / name
    for file, data in ((path, content), (Path(f"{path}{SEAL}"), _hash(content))):
        if file.is_dir():
            remove_tree(file)
        write_whole(file, data)
    return path


def read_record(name: str) -> Any:
    """Plain data of an entry; None if it is missing or is not what was stored."""
    content = read(name)
    return None if content is None else json.loads(content)


def write_record(name: str, record: Any) -> None:
    """Store plain data; a folder that cannot be written is no error, the data is made again."""
    with suppress(OSError):
        write(name, json.dumps(record).encode())


@contextmanager
def work_folder() -> Iterator[Path]:
    """A folder for the files of one build, removed afterwards.

    Raises
    ------
    OSError : it cannot be created.
    """
    path = folder() / f"{WORK}{secrets.token_hex(8)}"
    path.mkdir(mode=0o700)
    try:
        yield path
    finally:
        remove_tree(path)


def shrink_at_times() -> None:
    """Do :func:`shrink`, unless some process began it in the last minutes.

    With 80,000 entries it takes a second of CPU time, many times what a small unit's compilation
    does.
    """
    stamp = folder() / WALKED
    with suppress(OSError):
        if 0.0 <= time.time() - stamp.stat().st_mtime < PAUSE:
            return
    with suppress(OSError):
        stamp.touch(mode=0o600)
    shrink()


def shrink(limit: int = LIMIT) -> None:
    """Remove the oldest files if the folder is larger than its limit (bytes), and what killed
    builds left."""
    now, found = time.time(), []
    # Other processes add and remove files meanwhile: os.walk passes over what is gone.
    for place, folders, names in os.walk(folder()):
        for name in (*folders, *names):
            path = Path(place, name)
            with suppress(OSError):
                status = path.lstat()
                if name.startswith(WORK) and now - status.st_mtime > DAY:
                    remove_tree(path)
                elif not stat.S_ISDIR(status.st_mode) and path.suffix != SEAL:
                    found.append((status.st_mtime, str(path), status.st_size))
    total = sum(size for _, _, size in found)
    if total <= limit:
        return
    for _, path_text, size in sorted(found):
        for file in (Path(path_text), Path(path_text + SEAL)):
            with suppress(OSError):
                file.unlink()
        total -= size
        if total <= limit * SHARE_AFTER:
            return


def _hash(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()
