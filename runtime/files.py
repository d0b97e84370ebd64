"""Files and their names: atomic writing, JSON and its form, hashes, slugs, links not followed.

In: paths, and data that may come from others. Out: files that are complete or as they were, and
data whose form is known::

    write_json(folder / "metrics.json", {"miss": math.inf})     # {"miss": null}
    check_form(manifest, {"dt": (int, float), "probes": [str]})  # ValueError: dt is missing
"""

from __future__ import annotations

import errno
import importlib
import json
import math
import os
import re
import shutil
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from blocks.files import opened, read_text, resolved
from blocks.limits import JSON_VALUES
from runtime.errors import UsageError

Content = str | bytes | Callable[[BinaryIO], object]

NAME_BYTES = 120  # of a file name made from any string; file systems allow 255
# Under Windows a lock is of bytes and keeps others from reading them: this one is beyond any
# content.
LOCKED_BYTE = 2**30
LARGEST = 1e308  # about the largest float
NUMBER, MAYBE_NUMBER = (int, float), (int, float, type(None))
_NAMES = {str: "a string", int: "a number", float: "a number", bool: "true or false"}
_NAMES |= {list: "a list", dict: "an object", type(None): "null"}


def slug(text: str, otherwise: str = "graph") -> str:
    """A string as a safe file name: ASCII, no separators, not hidden, not too long.

    A shortened name ends in a hash of the string, so that two long ones get different names.
    """
    name = re.sub(r"[^A-Za-z0-9_.-]+", "_", text).strip("._") or otherwise
    if len(name) <= NAME_BYTES:
        return name
    import hashlib  # and with it OpenSSL

    digest = hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()[:8]
    return f"{name[: NAME_BYTES - 9]}-{digest}"


@contextmanager
def system_errors(action: str = "") -> Iterator[None]:
    """Report an error of the system as a ``UsageError``: ``cannot <action>: <reason>``.

    Without an action it is the writing of the file that the error names.
    """
    try:
        yield
    except OSError as error:
        action = action or f"write '{error.filename}'"
        raise UsageError(f"cannot {action}: {error.strerror or error}") from None


def read_json(path: Path) -> Any:
    """Read a JSON file of up to :data:`JSON_VALUES` values.

    Raises
    ------
    OSError, ValueError : it cannot be read, is longer, or is not valid.
    """
    return parse_json(read_text(path))


def parse_json(text: str) -> Any:
    """What a JSON text holds, of up to :data:`JSON_VALUES` values.

    Raises
    ------
    ValueError : it holds more, or is not valid.
    """
    # Counted before it is read: an empty list of 3 characters takes 70 bytes of memory.
    if sum(map(text.count, "[{,")) > JSON_VALUES:
        raise ValueError(f"more than {JSON_VALUES:,} values")
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deep") from None


def refuse_link(path: Path) -> None:
    """Check that a folder to write into, inside a run folder, is not a link.

    Raises
    ------
    UsageError : it is a link.
    """
    if path.is_symlink():
        message = "is a link, which is not followed when files are written; name another folder"
        raise UsageError(f"'{path}' {message}, or remove the link")


def own_folder(path: Path) -> Path:
    """A folder to write into, created if it is missing; never the target of a link.

    Raises
    ------
    UsageError : the path is a link. OSError : the folder cannot be created.
    """
    refuse_link(path)
    path.mkdir(parents=True, exist_ok=True)
    return path


def own_file(path: Path) -> Path:
    """A path to write to: an existing link is removed, and its target left unchanged."""
    if path.is_symlink():
        path.unlink()
    return path


def check_inside(folder: Path) -> None:
    """Check that a run folder's path, if it is a link such as ``latest``, points to its sibling.

    Raises
    ------
    UsageError : it points elsewhere.
    """
    if folder.is_symlink() and resolved(folder).parent != resolved(folder.parent):
        message = f"is a link that leads to '{resolved(folder)}'; name that folder itself"
        raise UsageError(f"'{folder}' {message}, or where to write with --out")


def write_whole(path: Path, content: Content) -> None:
    """Write a file atomically; a link of that name is replaced.

    Raises
    ------
    OSError : it cannot be written; the old file is unchanged.
    """
    write_files({path: content})


def write_files(files: Mapping[Path, Content], folders: bool = False) -> None:
    """Write files, all or none; links of their names are replaced.

    ``folders`` makes the folders that are missing, and removes them again on failure. A content
    may be a function that writes into an open file.

    Raises
    ------
    OSError : one cannot be written; what was there is unchanged.
    """
    partial: dict[Path, Path] = {}
    made: list[Path] = []
    path = Path()
    try:
        for path, content in files.items():
            if path.is_dir() and not path.is_symlink():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            made += _missing(path.parent) if folders else []
            # Beside it, since a rename is atomic only within one file system.
            partial[path] = path.with_name(f".{os.urandom(6).hex()}.partial")
            with partial[path].open("xb") as file:
                _write_into(file, content)
        for path, written in partial.items():
            written.replace(path)
    # Ctrl-C as well: nothing half-written stays.
    except BaseException as error:
        for written in partial.values():
            with suppress(OSError):
                written.unlink(missing_ok=True)
        for folder in reversed(made):
            with suppress(OSError):
                folder.rmdir()
        if isinstance(error, OSError) and error.errno:
            # The temporary name says nothing to a user.
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise


def _missing(folder: Path) -> list[Path]:
    """Make a folder with those above it; returns the new ones, the outermost first."""
    absent = [each for each in (folder, *folder.parents) if not each.exists()]
    for each in reversed(absent):
        each.mkdir(exist_ok=True)
    return absent[::-1]


def _write_into(file: BinaryIO, content: Content) -> None:
    if callable(content):
        content(file)
    elif isinstance(content, str):
        file.write(content.encode("utf-8", "backslashreplace"))
    else:
        file.write(content)


def write_out(path: Path, content: str | bytes) -> None:
    """Write what a user asked for, where the user said: atomically, to a link's target.

    A pipe or a device, such as ``/dev/stdout``, is written to directly.

    Raises
    ------
    OSError : it cannot be written.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        with path.open("wb") as file:
            _write_into(file, content)
        return
    path = resolved(path)
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    write_whole(path, content)


def open_file(path: Path, flags: int) -> int:
    """``os.open`` of bytes, closed in child processes; a link is not followed.

    Raises
    ------
    OSError : it cannot be opened, or is a link.
    """
    for name in ("O_CLOEXEC", "O_NOFOLLOW", "O_BINARY", "O_NONBLOCK"):  # no system has all of them
        flags |= getattr(os, name, 0)
    if path.is_symlink():
        # Windows has no O_NOFOLLOW.
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
    file = os.open(path, flags, 0o666)
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise OSError(errno.EINVAL, "it is no regular file", str(path))
    return file


def append(path: Path, text: str) -> None:
    """Add a text to the end of a file, which is made if it is missing; a link is not followed.

    Raises
    ------
    OSError : it cannot be written.
    """
    with os.fdopen(open_file(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT), "ab") as file:
        file.write(text.encode())


def lock(file: int) -> bool:
    """Lock an open file for as long as it is open; False if another process holds it.

    True, and no lock, on a file system without locks.
    """
    try:
        # Imported by name: mypy checks for each system, and only one of them has the module.
        unix: Any = importlib.import_module("fcntl")
    except ImportError:
        return _lock_byte(file)
    try:
        unix.flock(file, unix.LOCK_EX | unix.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def _lock_byte(file: int) -> bool:
    """:func:`lock` under Windows."""
    try:
        windows: Any = importlib.import_module("msvcrt")
    except ImportError:
        return True
    os.lseek(file, LOCKED_BYTE, os.SEEK_SET)
    try:
        windows.locking(file, windows.LK_NBLCK, 1)
    except PermissionError:
        return False
    except OSError:
        return True
    return True


def json_text(value: Any, indent: int | None = None) -> str:
    """A value as JSON that every reader accepts.

    JSON has neither infinity nor NaN, which become null, nor lone surrogates (which Python uses
    for file names that are not UTF-8), which become escapes.
    """
    return json.dumps(_plain(value), indent=indent, allow_nan=False)


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file atomically.

    Raises
    ------
    UsageError : it cannot be written.
    """
    with system_errors(f"write '{path}'"):
        write_whole(path, json_text(value, indent=2) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        # json would write Infinity and NaN, which other languages' readers refuse.
        return value if math.isfinite(value) else None
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode()
    if isinstance(value, dict):
        return {_plain(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def sha256(path: Path) -> str:
    """The SHA-256 hash of a file of any size."""
    import hashlib

    with opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def remove_tree(folder: Path) -> None:
    """Remove a folder as far as possible; links in it are removed, not followed."""
    with suppress(OSError):
        if not folder.is_symlink():
            shutil.rmtree(folder, ignore_errors=True)


def point_link(link: Path, target: str) -> None:
    """Point a link at a folder beside it; does nothing where links are not supported.

    A file that has the link's name is somebody's, and stays.
    """
    if os.path.lexists(link) and not link.is_symlink():
        return
    # Made beside and renamed over the old one, so that `latest` exists at any moment.
    fresh = link.parent / f".{link.name}-{os.urandom(3).hex()}"
    try:
        fresh.symlink_to(target, target_is_directory=True)
        fresh.replace(link)
    except OSError:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)


def check_form(value: Any, form: Any, address: str = "", longest: float = math.inf) -> None:
    """Check that a value has a form.

    Parameters
    ----------
    value : of dicts, lists and scalars.
    form : a type or a tuple of types; ``[form]`` for a list; ``{key: form}`` for a mapping with at
        least these keys.
    address : of the value, for the message.
    longest : the largest length of a string or a list.

    Raises
    ------
    ValueError : it does not; the message gives the address, the expected types and the value.
    """
    if isinstance(form, dict):
        _expect(value, (dict,), address)
        for key, inner in form.items():
            inside = f"{address}.{key}".lstrip(".")
            if key not in value:
                raise ValueError(f"{inside} is missing")
            check_form(value[key], inner, inside, longest)
    elif isinstance(form, list):
        _expect(value, (list,), address)
        for i, item in enumerate(value):
            check_form(item, form[0], f"{address}[{i}]", longest)
    else:
        _expect(value, form if isinstance(form, tuple) else (form,), address)
    if isinstance(value, (str, list)) and len(value) > longest:
        raise ValueError(f"{address}: expected a length of up to {longest}, got {len(value)}")


def is_number(value: Any) -> bool:
    """Whether a value is a number that a float can hold; in Python, a bool is an int."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return isinstance(value, float) or abs(value) < LARGEST


def _expect(value: Any, types: tuple[type, ...], address: str) -> None:
    # For isinstance true is an int, but in JSON it is no number. An integer of JSON has no limit,
    # and one that no float holds would fail where it is first computed with.
    is_valid = bool in types if isinstance(value, bool) else isinstance(value, types)
    is_huge = isinstance(value, int) and abs(value) >= LARGEST
    if not is_valid or is_huge:
        names = " or ".join(dict.fromkeys(_NAMES[t] for t in types))
        raise ValueError(f"{address or 'top level'}: expected {names}, got {str(value)[:40]!r}")
