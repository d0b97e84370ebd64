"""The library, and blocks that come from a file."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import blocks
from blocks.library import index
from blocks.library.registry import BUILTIN, blocks_of_module
from docs.describe import ROOMS, index_file

SOURCE = '''
from blocks import Block, Gain, Output, Scalar

class Here(Block):
    """A block."""
    out = Output(Scalar)
    def output(self, state, t):
        return VALUE

class NoBlock:
    pass
'''


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(SOURCE.replace("VALUE", "1.0"), encoding="utf-8")
    return path


def test_every_built_in_block_can_be_imported_by_its_name() -> None:
    for name, cls in BUILTIN.items():
        assert getattr(blocks, name) is cls
        assert name in blocks.__all__ or cls.__module__.startswith("spikeblocks.")


def test_the_index_is_what_the_doors_export() -> None:
    rooms = {path.parent.name for path in Path(blocks.__file__).parent.glob("*/__init__.py")}
    assert {*ROOMS, "core", "library"} == rooms
    assert Path(index.__file__).read_text(encoding="utf-8") == index_file(), (
        "python -m docs.describe writes it again"
    )


def test_a_name_that_the_index_lacks_is_found_in_the_text_of_its_door() -> None:
    code = """if True:
        from blocks.library import index
        del index.TYPES["Gain"], index.OTHERS["scaled"], index.OTHERS["param"]
        from blocks.generic import Gain, scaled
        print(Gain.__module__, scaled.__module__)
        try:
            from blocks.generic import Gains
        except ImportError as error:
            print(error)
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split()[:2] == ["blocks.generic.arithmetic"] * 2, done.stderr
    assert "cannot import name 'Gains' from 'blocks.generic'" in done.stdout


def test_all_names_exist_and_are_sorted() -> None:
    assert all(hasattr(blocks, name) for name in blocks.__all__)
    assert len(set(blocks.__all__)) == len(blocks.__all__)


def value_of(file: Path) -> Any:
    """What the block of a file puts out."""
    block: Any = blocks_of_module(file)["Here"]()
    return block.output(None, 0.0)


def test_blocks_of_a_file_are_those_it_defines(file: Path) -> None:
    found = blocks_of_module(file)
    assert list(found) == ["Here"]
    assert value_of(file) == 1.0


def test_a_file_is_run_once_until_it_changes(file: Path) -> None:
    first = blocks_of_module(file)["Here"]
    assert blocks_of_module(file)["Here"] is first
    file.write_text(SOURCE.replace("VALUE", "2.0"), encoding="utf-8")
    os.utime(file, ns=(1, 1))
    second = blocks_of_module(file)["Here"]
    assert second is not first
    assert value_of(file) == 2.0


def test_files_of_one_name_in_two_folders(file: Path, tmp_path: Path) -> None:
    other = tmp_path / "sub" / "mine.py"
    other.parent.mkdir()
    other.write_text(SOURCE.replace("VALUE", "3.0"), encoding="utf-8")
    os.utime(other, ns=(2, 2))
    os.utime(file, ns=(2, 2))
    assert value_of(file) == 1.0
    assert value_of(other) == 3.0


def test_a_file_that_fails_leaves_no_module(tmp_path: Path) -> None:
    path = tmp_path / "as_told_to_fail.py"
    path.write_text("import blocks\nraise RuntimeError('on purpose')\n", encoding="utf-8")
    for _ in range(2):
        with pytest.raises(RuntimeError, match="on purpose"):
            blocks_of_module(path)
    assert not [name for name in sys.modules if "as_told_to_fail" in name]


def test_what_is_no_python_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        blocks_of_module(tmp_path / "none.py")
    text = tmp_path / "notes.txt"
    text.write_text("", encoding="utf-8")
    with pytest.raises(ImportError, match="is not a Python file"):
        blocks_of_module(text)
