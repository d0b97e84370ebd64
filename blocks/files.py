"""The one way to read a file that a document, a folder or a person names.

In: a path and a limit. Out: the content of a regular file, or an ``OSError`` that says what it is::

    read("weights.npz", limits.RECORDED)      # bytes
    with archive(file, limits.GRAPH_ARRAYS) as members: ...    # sums checked, nothing unpacked yet

A stranger's folder can hold a link to ``/dev/zero``, which never ends, a fifo, which nobody writes
to, and an archive of some kilobytes that unpacks to any size.
"""

from __future__ import annotations

import errno
import io
import math
import os
import stat
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, BinaryIO

from blocks.limits import ARCHIVE_LIST, LARGEST_RATIO, LINE, SMALL_ARCHIVE, TEXT, size

# What numpy and zipfile raise for archives that are damaged. Numpy reads a header as Python, and
# only warns about some that it cannot be sure of.
DAMAGED: tuple[type[Exception], ...] = (
    *(OSError, ValueError, TypeError, EOFError, KeyError, RuntimeError, MemoryError, OverflowError),
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, Warning),
    *(NotImplementedError, SyntaxError),
)


class UnfitError(ValueError):
    """A file holds something else than is wanted, or more than may be read."""


_KINDS = (
    *((stat.S_ISFIFO, "a fifo"), (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device")),
    (stat.S_ISSOCK, "a socket"),
)


def opened(path: str | Path, limit: int | None = None) -> io.BufferedReader:
    """Open a regular file, or a link to one, for reading.

    Raises
    ------
    OSError : it cannot be opened, is no regular file, or has more than ``limit`` bytes.
    """
    # Asked first, since opening a device can act on it; and again below, since a name can be given
    # to another file in between.
    _check(Path(path).stat(), path, limit)
    flags = os.O_RDONLY
    # No system has all of them. A fifo that took the place of a file would block.
    for name in ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY"):
        flags |= getattr(os, name, 0)
    number = os.open(path, flags)
    try:
        _check(os.fstat(number), path, limit)
        return os.fdopen(number, "rb")
    except BaseException:
        os.close(number)
        raise


def _check(status: os.stat_result, path: str | Path, limit: int | None) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(status.st_mode):
        kind = next((kind for test, kind in _KINDS if test(status.st_mode)), "no file")
        raise OSError(errno.EINVAL, f"it is {kind}; expected a regular file", str(path))
    if limit is not None and status.st_size > limit:
        raise _too_large(path, limit)


def _too_large(path: str | Path, limit: int) -> OSError:
    return OSError(errno.EFBIG, f"it is larger than {size(limit)}, the limit", str(path))


def read(path: str | Path, limit: int) -> bytes:
    """The content of a regular file of up to ``limit`` bytes.

    Raises
    ------
    OSError : it cannot be read, is no regular file, or is larger.
    """
    with opened(path, limit) as file:
        # Read, not asked for its size: that of a file in /proc is 0, and others grow.
        data = file.read(limit + 1)
    if len(data or b"") > limit:
        raise _too_large(path, limit)
    return data or b""


def resolved(path: str | Path) -> Path:
    """A path without links, as far as it exists; also of a link to itself, unlike Path.resolve."""
    return Path(os.path.realpath(path))


def read_text(
    path: str | Path, limit: int = TEXT, encoding: str = "utf-8", errors: str = "strict"
) -> str:
    """The text of a regular file of up to ``limit`` bytes, with line ends as they are.

    Raises
    ------
    OSError, UnicodeDecodeError : it cannot be read, is larger, or is not of that encoding.
    """
    data = read(path, limit)
    # Python takes four bytes for each character of a text with one from beyond the first 65,536.
    if len(data) > limit // 4 and not data.isascii():
        raise OSError(
            errno.EFBIG, f"it is larger than {size(limit // 4)}, the limit beyond ASCII", str(path)
        )
    return data.decode(encoding, errors)


class _Tail:
    """A file in which zipfile looks for an archive's list, which it would read whole."""

    def __init__(self, file: IO[bytes]) -> None:
        self.file, self.limit = file, ARCHIVE_LIST

    def read(self, count: int = -1) -> bytes:
        if count > self.limit:
            raise UnfitError(f"its list of members is larger than {size(self.limit)}")
        return self.file.read(count)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.file, name)


@contextmanager
def archive(file: IO[bytes], limit: int) -> Iterator[zipfile.ZipFile]:
    """A zip archive in an open file, before anything is unpacked.

    ``limit`` is the largest size, in bytes, of all members together.

    Raises
    ------
    ValueError, zipfile.BadZipFile : its members are larger, or it is damaged.
    """
    length = file.seek(0, os.SEEK_END)
    file.seek(0)
    tail: Any = _Tail(file)
    with zipfile.ZipFile(tail) as found:
        tail.limit = math.inf
        members = found.infolist()
        stored = sum(m.file_size for m in members if m.compress_type == zipfile.ZIP_STORED)
        total = sum(m.file_size for m in members)
        # Members may share their bytes.
        if stored > length:
            raise ValueError("its members are declared larger than the file")
        if total > limit:
            raise UnfitError(f"it unpacks to more than {size(limit)}, the limit")
        if total > max(SMALL_ARCHIVE, LARGEST_RATIO * length):
            raise UnfitError(
                f"it unpacks to {total // length} times its size, and more than "
                f"{size(SMALL_ARCHIVE)}; write it without compression"
            )
        yield found


def array_header(member: IO[bytes]) -> tuple[tuple[int, ...], bool, Any]:
    """Shape, whether in Fortran's order, and type of an array in an archive, from its header.

    Raises
    ------
    ValueError : it has an unknown format, or is no array.
    """
    from numpy.lib import format as numpy_format

    version = numpy_format.read_magic(member)
    readers = {
        (1, 0): numpy_format.read_array_header_1_0,
        (2, 0): numpy_format.read_array_header_2_0,
    }
    if version not in readers:
        raise ValueError(f"it has an unknown format {version}")
    with warnings.catch_warnings():
        # NumPy only warns about some headers that it cannot be sure of.
        warnings.simplefilter("error")
        shape, fortran, kind = readers[version](member)
    return shape, fortran, kind


def read_array(found: zipfile.ZipFile, name: str, limit: int) -> Any:
    """One member of an archive as an array of numbers.

    Raises
    ------
    ValueError : it is no array of numbers, or takes more than ``limit`` bytes as float64.
    DAMAGED : it is damaged.
    """
    from numpy.lib import format as numpy_format

    info = found.getinfo(name)
    with found.open(info) as member:
        shape, _, kind = array_header(member)
        count = math.prod(shape)
        if kind.kind not in "fiub":
            raise UnfitError(f"expected numbers, got {kind}")
        if 8 * count > limit:
            numbers = " x ".join(map(str, shape))
            raise UnfitError(f"{numbers} numbers are more than {size(limit)}, the limit")
        if member.tell() + count * kind.itemsize != info.file_size:
            raise ValueError(f"{info.file_size} bytes are not those of shape {shape}")
    with found.open(info) as member:
        return numpy_format.read_array(member, allow_pickle=False)


def lines(path: str | Path, limit: int, errors: str = "strict") -> Iterator[str]:
    """The lines of a text file of up to ``limit`` bytes, one in memory at a time.

    Raises
    ------
    OSError, ValueError : it cannot be read, is larger, has a line of more than
        :data:`~blocks.limits.LINE` characters, or is not UTF-8.
    """
    with opened(path, limit) as file:
        for number, line in enumerate(_pieces(file), 1):
            if len(line) > LINE:
                raise ValueError(f"line {number} has more than {LINE:,} characters")
            yield line.decode("utf-8", errors)


def _pieces(file: BinaryIO) -> Iterator[bytes]:
    while line := file.readline(LINE + 1):
        yield line
