"""The cheap graph in an empty folder, and the command line within this process."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from runtime.cli import run
from tests.conftest import Run
from tests.runtime.experiments.graphs import write_graph


@pytest.fixture
def draw(tmp_path: Path) -> Path:
    """The graph's file, in the folder where the command line runs."""
    return write_graph(tmp_path)


@pytest.fixture
def here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Run:
    """Runs the command line as the fixture ``cli`` does, without starting Python for it."""

    def called(*arguments: str) -> subprocess.CompletedProcess[str]:
        monkeypatch.chdir(tmp_path)
        capsys.readouterr()
        try:
            code = run(arguments)
        except SystemExit as left:  # argparse's own way out
            code = int(left.code or 0)
        seen = capsys.readouterr()
        return subprocess.CompletedProcess(arguments, code, seen.out, seen.err)

    return called
