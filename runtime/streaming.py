"""Arrays larger than memory: read and written in blocks of rows.

In: arrays, some of them mapped from a file, or the path of an archive. Out: an archive as
:func:`numpy.savez` writes it, or its arrays::

    for rows, (x, y) in row_blocks(position, speed):   # at most 4 MiB of each at a time
        total += float((x * y).sum())
"""

from __future__ import annotations

import mmap
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from blocks.core import FloatArray

BLOCK = 1 << 22  # bytes of an array in memory at a time
MAPPED_ABOVE = 1 << 26  # bytes; the arrays of larger archives are mapped, not read


def row_blocks(*arrays: FloatArray) -> Iterator[tuple[slice, list[FloatArray]]]:
    """Blocks of rows of arrays of equal length, each with the slice of its rows.

    Memory of a mapped file is released before the next block is read.
    """
    widest = max(array[:1].nbytes for array in arrays) or 8
    count = max(1, BLOCK // widest)
    for first in range(0, len(arrays[0]), count):
        rows = slice(first, first + count)
        yield rows, [array[rows] for array in arrays]
        for array in arrays:
            release(array)


def release(array: FloatArray) -> None:
    """Let the system drop the cached pages of a file that is mapped for reading."""
    # A slice is a view of a view: the map is at the end of the chain.
    base: Any = array
    while base is not None and not isinstance(base, mmap.mmap):
        base = getattr(base, "base", None)
    if base is not None and hasattr(base, "madvise") and hasattr(mmap, "MADV_DONTNEED"):
        # Pages that were read count as memory of this process: a limited one would be killed.
        base.madvise(mmap.MADV_DONTNEED)


def save_arrays(path: Path | BinaryIO, arrays: Mapping[str, FloatArray]) -> None:
    """Write arrays like :func:`numpy.savez`, without loading them into memory."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            header = {"descr": "<f8", "fortran_order": False, "shape": array.shape}
            # Its size is not known to zipfile in advance: without zip64, 2 GiB are an error at the
            # end.
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array_header_1_0(file, header)
                for _, (rows,) in row_blocks(np.atleast_1d(array)):
                    file.write(np.ascontiguousarray(rows, dtype="<f8").data)


# What numpy and zipfile raise for archives that are damaged. Numpy reads a header as Python, and
# only warns about some that it cannot be sure of.
DAMAGED: tuple[type[Exception], ...] = (
    *(OSError, ValueError, TypeError, EOFError, KeyError, RuntimeError, MemoryError, OverflowError),
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, Warning),
)


def open_arrays(path: Path) -> dict[str, FloatArray]:
    """The arrays of an archive; those of a large one stay on disk until they are used.

    The whole archive is read once and compared with its checksums.

    Raises
    ------
    DAMAGED : for damaged files.
    """
    with path.open("rb") as file:
        _check_members(file)
        if path.stat().st_size <= MAPPED_ABOVE:
            return dict(np.load(file, allow_pickle=False))
        with zipfile.ZipFile(file) as archive:
            return {
                info.filename.removesuffix(".npy"): _map_member(path, archive, info)
                for info in archive.infolist()
            }


def _check_members(file: BinaryIO) -> None:
    """Refuse an archive that claims to hold more than the file: runs are not compressed."""
    size = file.seek(0, 2)
    file.seek(0)
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
    if any(member.compress_type != zipfile.ZIP_STORED for member in members):
        raise ValueError("it is compressed; the arrays of a run are not")
    if sum(member.file_size for member in members) > size:
        raise ValueError("its arrays are declared larger than the file")
    file.seek(0)


def _map_member(path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> FloatArray:
    if info.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"'{info.filename}' is compressed; expected arrays that are stored")
    with archive.open(info) as member:
        version = np.lib.format.read_magic(member)
        if version != (1, 0):
            raise ValueError(f"'{info.filename}' has format {version}; expected (1, 0)")
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(member)
        header = member.tell()
        # A memory map needs the bytes as they are: no conversion, rows one after the other.
        if dtype != np.float64 or fortran:
            raise ValueError(f"'{info.filename}' is {dtype}; expected rows of float64")
        size = header
        # Reading to the end compares the checksum.
        while block := member.read(BLOCK):
            size += len(block)
    if size - header != 8 * int(np.prod(shape, dtype=object)):
        raise ValueError(f"'{info.filename}' holds {size - header} bytes for shape {shape}")
    with path.open("rb") as file:
        # The member's own header: 30 bytes, a name and an extra field. The lengths of the two in
        # the archive's directory may be others.
        file.seek(info.header_offset + 26)
        lengths = file.read(4)
        start = 30 + int.from_bytes(lengths[:2], "little") + int.from_bytes(lengths[2:], "little")
    offset = info.header_offset + start + header
    # An empty file cannot be mapped.
    if size == header:
        return np.empty(shape)
    return np.asarray(np.memmap(path, "<f8", "r", offset, shape))
