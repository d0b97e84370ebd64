"""The cache folder: only the user may write to it, entries are checked, and it is bounded."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from runtime.toolchain import VARIABLE, folder, store


def test_the_folder_is_the_users_alone(cache: Path) -> None:
    assert stat.S_IMODE(cache.stat().st_mode) == 0o700


def shared(wanted: Path) -> Path:
    wanted.mkdir()
    wanted.chmod(0o777)
    return wanted


def of_a_group(wanted: Path) -> Path:
    wanted.mkdir()
    wanted.chmod(0o770)
    return wanted


def linked(wanted: Path) -> Path:
    (wanted.parent / "elsewhere").mkdir()
    wanted.symlink_to(wanted.parent / "elsewhere")
    return wanted


def a_file(wanted: Path) -> Path:
    wanted.write_text("")
    return wanted


def in_an_open_folder(wanted: Path) -> Path:
    return shared(wanted) / "mine"


@pytest.mark.parametrize("make", [shared, of_a_group, linked, a_file, in_an_open_folder])
def test_a_folder_that_others_may_have_written_is_not_used(
    make: Callable[[Path], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = make(tmp_path / "cache")
    monkeypatch.setenv(VARIABLE, str(wanted))
    check_own(wanted)


def test_a_folder_of_another_user_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(os, "getuid", lambda: tmp_path.stat().st_uid + 1)
    check_own(tmp_path)


def check_own(wanted: Path) -> None:
    found = folder()
    assert not found.is_relative_to(wanted)
    assert stat.S_IMODE(found.stat().st_mode) == 0o700
    assert found.stat().st_uid == os.geteuid()
    assert found.parent == Path(tempfile.gettempdir()) and len(found.name) > len("spikeblocks-") + 6
    store.write("entry", b"content")
    assert store.read("entry") == b"content" and (found / "entry").exists()
    assert not wanted.is_dir() or not list(wanted.iterdir())


def test_a_link_in_the_folder_is_replaced_and_not_followed(cache: Path, tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.write_bytes(b"mine")
    (cache / "entry").symlink_to(target)
    (cache / "entry.sha256").symlink_to(target)
    store.write("entry", b"content")
    assert store.read("entry") == b"content" and target.read_bytes() == b"mine"


@pytest.mark.parametrize("content", [b"", b"text", bytes(range(256))])
def test_an_entry_is_what_was_written(cache: Path, content: bytes) -> None:
    assert store.read("entry") is None and store.verified_path("entry") is None
    assert store.write("entry", content) == cache / "entry" == store.verified_path("entry")
    assert store.read("entry") == content


def entry(cache: Path, name: str, age: float, size: int) -> None:
    """An entry that was last used so many seconds ago."""
    path = store.write(name, bytes(size))
    now = path.stat().st_mtime
    for file in (path, cache / f"{name}.sha256"):
        os.utime(file, (now - age, now - age))


def test_the_oldest_entries_are_removed(cache: Path) -> None:
    for i in range(10):
        entry(cache, f"entry{i}", 100.0 * i, 1000)
    (cache / "__pycache__").mkdir()
    other = cache / "__pycache__" / "of_an_earlier_version.nbc"
    other.write_bytes(bytes(1000))
    os.utime(other, (0, 0))
    store.shrink(limit=11_000)
    assert len(list(cache.glob("entry*"))) == 20 and other.exists()
    store.shrink(limit=6_000)
    kept = {path.name for path in cache.glob("entry*") if path.suffix != ".sha256"}
    assert kept == {f"entry{i}" for i in range(5)} and not other.exists()
    assert {path.stem for path in cache.glob("*.sha256")} == kept


def test_the_folder_is_not_walked_at_each_build(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walks: list[None] = []
    monkeypatch.setattr(store, "shrink", lambda: walks.append(None))
    store.shrink_at_times()
    store.shrink_at_times()
    assert len(walks) == 1
    now = (cache / store.WALKED).stat().st_mtime
    for age, expected in ((0.5, 1), (2.0, 2), (-2.0, 3)):  # the last: the clock was set back
        then = now - age * store.PAUSE
        os.utime(cache / store.WALKED, (then, then))
        store.shrink_at_times()
        assert len(walks) == expected


def test_what_is_used_is_not_old(cache: Path) -> None:
    entry(cache, "used", 3 * store.DAY, 1000)
    entry(cache, "unused", 2 * store.DAY, 1000)
    assert store.read("used") is not None
    store.shrink(limit=1_500)
    assert store.read("used") is not None and store.read("unused") is None


def test_what_a_killed_build_left_is_removed_after_a_day(cache: Path) -> None:
    with store.work_folder() as running:
        (running / "unit.o").write_bytes(b"new")
        left = cache / ".build-left"
        (left / "unit").mkdir(parents=True)
        old = cache.stat().st_mtime - 2 * store.DAY
        os.utime(left, (old, old))
        store.shrink()
        assert running.exists() and not left.exists()
    assert not running.exists()


def test_a_folder_that_is_removed_meanwhile_is_made_again(cache: Path) -> None:
    cache.rmdir()
    with store.work_folder() as running:
        assert running.is_dir() and stat.S_IMODE(running.stat().st_mode) == 0o700
    shutil.rmtree(cache)
    store.write("entry", b"content")
    assert store.read("entry") == b"content" and stat.S_IMODE(cache.stat().st_mode) == 0o700


def test_files_may_go_while_the_folder_is_looked_at(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for i in range(3):
        entry(cache, f"entry{i}", 100.0 * i, 1000)
    with store.work_folder() as running:
        (running / "unit.o").write_bytes(b"new")
        lstat = Path.lstat

        def slow(path: Path) -> os.stat_result:
            """Another process ends its build, and removes an entry, just before."""
            shutil.rmtree(running, ignore_errors=True)
            (cache / "entry1").unlink(missing_ok=True)
            return lstat(path)

        monkeypatch.setattr(Path, "lstat", slow)
        store.shrink(limit=1_500)
    assert store.read("entry0") is not None and store.read("entry2") is None


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="changes owners")
@pytest.mark.parametrize(
    ("owner", "mode"),
    [(65534, 0o755), (0, 0o775), (0, 0o777), (65534, 0o1777)],
    ids=["of another user", "of a group", "of all", "sticky, of another user"],
)
def test_a_folder_below_one_that_others_control_is_not_used(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, owner: int, mode: int
) -> None:
    wanted = tmp_path / "parent" / "cache"
    monkeypatch.setenv(store.VARIABLE, str(wanted))
    assert store.folder() == wanted and store.write("below", b"content").parent == wanted
    # After it was found to be good: it is checked each time.
    os.chown(wanted.parent, owner, -1)
    wanted.parent.chmod(mode)
    assert store.folder() != wanted and store.read("below") is None
    assert store.verified_path("below") is None
    os.chown(wanted.parent, 0, -1)
    wanted.parent.chmod(0o1777)  # as /tmp is
    assert store.read("below") == b"content"
