"""Each bridge can be deleted: its folder, its tests, its lines in pyproject.toml, and its graphs.

What is left is tried in a copy: the command line, every shipped graph, and quick tests of the core.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from runtime import toolchain
from tests.test_rooms import BRIDGES, ROOT

Python = Callable[..., "subprocess.CompletedProcess[str]"]
NAMES = sorted(room.partition(".")[2] for room in BRIDGES)
FOLDERS = ("blocks", "runtime", "spikeblocks", "graphs", "tests", "docs", "examples", "benchmarks")
QUICK = (
    *("test_rooms.py", "test_files.py", "blocks/core", "blocks/test_extensions.py"),
    *("runtime/cli", "runtime/network", "runtime/runs/test_fingerprint.py"),
)
# An editable installation would find what is deleted in the copy.
CUSTOMIZE = """import sys
sys.meta_path = [f for f in sys.meta_path if "editable" not in getattr(f, "__module__", "")]
"""
RUN = ("run", "starters/adaptive", "--until", "0.01", "--no-plots", "--out", "here")


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The project, as somebody unpacks it."""
    place = tmp_path / "project"
    made = shutil.ignore_patterns("__pycache__", "_build", ".*")
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, place / folder, ignore=made)
    for file in ROOT.iterdir():
        if file.is_file():
            shutil.copy2(file, place)
    (place / "sitecustomize.py").write_text(CUSTOMIZE)
    return place


@pytest.fixture
def python(copy: Path) -> Python:
    """Runs Python in the copy, which it imports."""

    def run(*words: str, timeout: float = 300) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, *words],
            cwd=copy,
            env={**os.environ, "PYTHONPATH": str(copy)},
            capture_output=True,
            text=True,
            timeout=timeout,
        )

    return run


def offers(place: Path) -> dict[str, dict[str, str]]:
    """The entry points in the project's file, by the group without its prefix."""
    text = (place / "pyproject.toml").read_text(encoding="utf-8")
    groups = tomllib.loads(text)["project"]["entry-points"]
    return {name.partition(".")[2]: points for name, points in groups.items()}


def delete(name: str, place: Path) -> dict[str, set[str]]:
    """Delete a bridge; returns what it offered, by group."""
    before = offers(place)
    shutil.rmtree(place / "spikeblocks" / name)
    shutil.rmtree(place / "tests" / "bridges" / name)
    file = place / "pyproject.toml"
    text = file.read_text(encoding="utf-8")
    line = rf'^[\w-]+ = "spikeblocks\.{name}\b.*\n'
    file.write_text(re.sub(line, "", text, flags=re.MULTILINE), encoding="utf-8")
    after = offers(place)
    gone = {group: points.keys() - after[group].keys() for group, points in before.items()}
    for graph in (place / "graphs").rglob("*.yaml"):
        types = re.findall(r"type: (\w+)", graph.read_text(encoding="utf-8"))
        if gone["blocks"] & {*types} or name in graph.stem:
            graph.unlink()
    return gone


@pytest.mark.slow
@pytest.mark.timeout(2400)
@pytest.mark.parametrize("name", NAMES)
def test_without_a_bridge_all_else_works(name: str, copy: Path, python: Python) -> None:
    gone = delete(name, copy)
    made = python("setup.py", "-q", "egg_info")
    assert made.returncode == 0, made.stderr

    def command(*words: str) -> str:
        done = python("-m", "spikeblocks_command", *words)
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
        return done.stdout

    verbs = re.findall(r"^  ([\w-]+) ", command("--help"), re.MULTILINE)
    assert not gone["verbs"] & {*verbs}
    assert {"run", "validate", "export"} <= {*verbs}
    help_of_targets = command("export", "--help")
    assert not any(f"; {target}: " in help_of_targets for target in gone["exports"])
    types = command("blocks")
    assert not any(re.search(rf"\b{kind}\b", types) for kind in gone["blocks"])
    assert "status" in command(*RUN, "--json")
    graphs = [
        str(path.relative_to(copy / "graphs").with_suffix(""))
        for path in sorted((copy / "graphs").rglob("*.yaml"))
        if "\nrun:" in path.read_text(encoding="utf-8")
    ]
    assert len(graphs) > 60
    checked = python("-m", "spikeblocks_command", "validate", *graphs)
    assert checked.returncode == 0, checked.stderr
    if toolchain.available():
        assert "written to" in command("export", "starters/adaptive", "out", "--block", "lqr")
    imported = python("-c", f"import spikeblocks.{name}")
    assert f"No module named 'spikeblocks.{name}'" in imported.stderr
    tests = [f"tests/{each}" for each in QUICK]
    tested = python("-m", "pytest", "-x", "-p", "no:cacheprovider", *tests, timeout=2000)
    assert tested.returncode == 0, tested.stdout[-3000:]


def test_every_entry_point_is_of_a_bridge_and_loads() -> None:
    for group, points in offers(ROOT).items():
        for name, value in points.items():
            assert ".".join(value.split(":")[0].split(".")[:2]) in BRIDGES, f"{group}: {name}"
