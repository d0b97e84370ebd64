"""Arrays larger than memory: read and written in blocks of rows.

In: arrays, some of them mapped from a file, or the path of an archive. Out: an archive as
:func:`numpy.savez` writes it, or its arrays::

    for rows, (x, y) in row_blocks(position, speed):   # at most 4 MiB of each at a time
        total += float((x * y).sum())
"""

from __future__ import annotations

import math
import mmap
import sys
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from blocks.core import FloatArray
from blocks.files import DAMAGED as DAMAGED
from blocks.files import archive, array_header, opened, read_array

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
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as written:
        for name, array in arrays.items():
            header = {"descr": "<f8", "fortran_order": False, "shape": array.shape}
            # Its size is not known to zipfile in advance: without zip64, 2 GiB are an error at the
            # end.
            with written.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array_header_1_0(file, header)
                for _, (rows,) in row_blocks(np.atleast_1d(array)):
                    file.write(np.ascontiguousarray(rows, dtype="<f8").data)


def open_arrays(path: Path) -> dict[str, FloatArray]:
    """The arrays of an archive; those of a large one stay on disk until they are used.

    The whole archive is read once and compared with its checksums.

    Raises
    ------
    DAMAGED : for damaged files.
    """
    with opened(path) as file, archive(file, sys.maxsize) as members:
        # Those of a run are not: its file is as large as what it holds.
        if any(member.compress_type != zipfile.ZIP_STORED for member in members.infolist()):
            raise ValueError("it is compressed; the arrays of a run are not")
        length = file.seek(0, 2)
        return {
            info.filename.removesuffix(".npy"): _map_member(file, members, info)
            if length > MAPPED_ABOVE
            else read_array(members, info.filename, sys.maxsize)
            for info in members.infolist()
        }


def open_rows(path: Path) -> FloatArray:
    """The array of a file as :func:`numpy.save` writes it, mapped.

    Raises
    ------
    OSError, ValueError : it cannot be read, or holds no rows of float64.
    """
    with opened(path) as file:
        shape, fortran, kind = array_header(file)
        if kind != np.float64 or fortran:
            raise ValueError(f"it is {kind}; expected rows of float64")
        if not math.prod(shape):
            return np.empty(shape)
        return np.asarray(np.memmap(file, "<f8", "r", file.tell(), shape))


def _map_member(file: BinaryIO, members: zipfile.ZipFile, info: zipfile.ZipInfo) -> FloatArray:
    with members.open(info) as member:
        shape, fortran, dtype = array_header(member)
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
    # The member's own header: 30 bytes, a name and an extra field. The lengths of the two in the
    # archive's directory may be others.
    file.seek(info.header_offset + 26)
    lengths = file.read(4)
    start = 30 + int.from_bytes(lengths[:2], "little") + int.from_bytes(lengths[2:], "little")
    offset = info.header_offset + start + header
    # An empty file cannot be mapped.
    if size == header:
        return np.empty(shape)
    return np.asarray(np.memmap(file, "<f8", "r", offset, shape))
