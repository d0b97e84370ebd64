"""The fingerprint changes with the sources that compute, and with nothing else."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import runtime
from runtime.runs.fingerprint import check_same_program, program, program_of

ROOT = Path(__file__).parents[3]
PRINT = "from runtime.runs.fingerprint import program; print(program())"


def fingerprint(folder: Path) -> str:
    command = [sys.executable, "-c", PRINT]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.mark.slow
def test_what_computes_is_part_of_it_and_what_presents_is_not(tmp_path: Path) -> None:
    for name in ("blocks", "runtime"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    assert fingerprint(tmp_path) == str(program())
    changed = tmp_path / "runtime" / "cli" / "commands" / "run.py"
    changed.write_text(changed.read_text() + "\n# A comment.\n")
    windows = tmp_path / "blocks" / "library" / "registry.py"
    windows.write_bytes(windows.read_bytes().replace(b"\n", b"\r\n"))
    assert fingerprint(tmp_path) == str(program())
    header = next((tmp_path / "runtime" / "codegen").glob("*.h"))
    header.write_text(header.read_text() + "\n")
    assert fingerprint(tmp_path) != str(program())


def test_a_package_that_is_missing_is_named() -> None:
    assert program_of(runtime.load("starters/adaptive").network) == program()
    with pytest.raises(ImportError, match="no module named 'no_such_blocks'"):
        program(("no_such_blocks",))
    assert program(("json",)).fingerprint != program().fingerprint


def test_all_programs_that_computed_are_named() -> None:
    here = program()
    check_same_program([str(here)], here, "it", "Begin anew")
    check_same_program(["", "a"], here, "it", "Begin anew", mixed=True)
    with pytest.raises(runtime.UsageError) as failed:
        check_same_program(["a", str(here), "", "a"], here, "it", "Begin anew.")
    assert str(failed.value) == (
        f"it was computed by another program, 'a' and one that left no record; this is '{here}', "
        "and its numbers may differ. Begin anew."
    )
