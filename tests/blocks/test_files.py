"""What a document names is opened in one way: a regular file, of a size, and never waited for."""

from __future__ import annotations

import io
import os
import socket
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from blocks import files, limits

MOST = 300 * 2**20


def npz(path: Path, **shapes: tuple[int, ...]) -> Path:
    """An archive of zeros, compressed a thousand times."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, shape in shapes.items():
            header = {"descr": "<f8", "fortran_order": False, "shape": shape}
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array_header_1_0(member, header)
                left = 8 * int(np.prod(shape))
                while left:
                    left -= member.write(bytes(min(left, 1 << 24)))
    return path


def test_what_is_no_regular_file_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "zero").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "fifo")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(os.path.relpath(tmp_path / "socket"))
        for name, kind in (("zero", "a device"), ("fifo", "a fifo"), ("socket", "a socket")):
            with pytest.raises(OSError, match=f"it is {kind}; expected a regular file"):
                files.read(tmp_path / name, 10)
    with pytest.raises(IsADirectoryError):
        files.read(tmp_path, 10)
    (tmp_path / "self").symlink_to("self")
    with pytest.raises(OSError, match="symbolic links"):
        files.read(tmp_path / "self", 10)


def test_a_size_is_limited(tmp_path: Path) -> None:
    (tmp_path / "ten").write_bytes(bytes(10))
    assert files.read(tmp_path / "ten", 10) == bytes(10)
    with pytest.raises(OSError, match="larger than 0 MiB, the limit"):
        files.read(tmp_path / "ten", 9)
    # Its size is said to be 0.
    with pytest.raises(OSError, match="the limit"):
        files.read("/proc/self/status", 9)
    (tmp_path / "wide").write_text("é" * limits.MIB, encoding="utf-8")
    assert len(files.read_text(tmp_path / "wide", 8 * limits.MIB)) == limits.MIB
    with pytest.raises(OSError, match="beyond ASCII"):
        files.read_text(tmp_path / "wide", 7 * limits.MIB)


def test_long_lines_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "lines"
    path.write_text("a\nb\r\nc", encoding="utf-8")
    assert list(files.lines(path, limits.INDEX)) == ["a\n", "b\r\n", "c"]
    path.write_text("a\n" + "b" * (limits.LINE + 1), encoding="utf-8")
    with pytest.raises(ValueError, match="line 2 has more than"):
        list(files.lines(path, limits.INDEX))


def test_sums_are_checked_before_anything_is_unpacked(tmp_path: Path) -> None:
    bomb = npz(tmp_path / "bomb.npz", a=(5 * 2**20,), b=(5 * 2**20,))
    with (
        pytest.raises(files.UnfitError, match="unpacks to .* times its size"),
        bomb.open("rb") as file,
        files.archive(file, limits.GIB),
    ):
        pass
    with (
        pytest.raises(files.UnfitError, match="unpacks to more than 1 MiB"),
        bomb.open("rb") as file,
        files.archive(file, limits.MIB),
    ):
        pass
    # Without compression it is as large as it says.
    np.savez(tmp_path / "plain.npz", a=np.zeros(5 * 2**20), b=np.zeros(5 * 2**20))
    with (tmp_path / "plain.npz").open("rb") as file, files.archive(file, limits.GIB) as members:
        assert files.read_array(members, "a.npy", limits.GIB).shape == (5 * 2**20,)


def test_members_that_share_their_bytes_are_counted_each(tmp_path: Path) -> None:
    one = io.BytesIO()
    with zipfile.ZipFile(one, "w") as archive:
        archive.writestr("a", bytes(1000))
    data = one.getvalue()
    start = data.index(b"PK\x01\x02")
    entry, end = data[start:-22], data[-22:]
    # Its list names the same bytes twenty times.
    fields = struct.pack("<HHII", 20, 20, 20 * len(entry), start)
    shared = data[:start] + 20 * entry + end[:8] + fields + end[20:]
    with (
        pytest.raises(ValueError, match="declared larger than the file"),
        files.archive(io.BytesIO(shared), limits.GIB),
    ):
        pass


def test_a_long_list_of_members_is_refused(tmp_path: Path) -> None:
    end = struct.pack("<4sHHHHIIH", b"PK\x05\x06", 0, 0, 9, 9, limits.ARCHIVE_LIST + 1, 0, 0)
    with (
        pytest.raises(ValueError, match="list of members is larger than"),
        files.archive(io.BytesIO(bytes(limits.ARCHIVE_LIST + 1) + end), limits.GIB),
    ):
        pass


def test_the_limits_are_those_of_the_page() -> None:
    page = (Path(__file__).parents[2] / "docs" / "security.md").read_text(encoding="utf-8")
    for what, limit in limits.TABLE:
        assert f"| {what} | {limit} |\n" in page
