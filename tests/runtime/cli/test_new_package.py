"""`runtime new --package`: a package that installs, passes its test and is listed."""

from __future__ import annotations

import importlib.metadata
import json
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

import pytest

from runtime.cli.new_package import texts
from runtime.runs import versions
from tests.conftest import Run

ROOT = Path(__file__).parents[3]
GRAPH = """graph: drawn
run: {{dt: 0.01, until: 1.0}}
blocks:
  wave: {{type: Function, expression: sin(t)}}
probes: {{wave: wave.out}}
plots:
  values: {{kind: {kind}, of: wave.out}}
"""
SETUPTOOLS = int(importlib.metadata.version("setuptools").partition(".")[0])


def test_it_writes_what_it_says(cli: Run, tmp_path: Path) -> None:
    done = cli("new", "--package", "my_blocks")
    assert done.returncode == 0, done.stderr
    written = {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()}
    assert written == set(done.stdout.splitlines()[:-2])
    project = tomllib.loads((tmp_path / "my_blocks/pyproject.toml").read_text())["project"]
    major, minor, *_ = versions()["spikeblocks"].split(".")
    assert project["dependencies"] == [f"spikeblocks>={major}.{minor}"]
    again = cli("new", "--package", "my_blocks")
    assert (again.returncode, again.stderr.count("\n")) == (2, 1)
    assert "exists already" in again.stderr


@pytest.mark.parametrize("name", ["My", "1a", "a-b", "", "class", "json", "blocks", "../a"])
def test_a_name_that_no_package_has_is_refused(cli: Run, tmp_path: Path, name: str) -> None:
    done = cli("new", "--package", name)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert f"--package {name}: " in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_no_placeholder_is_left() -> None:
    for path, text in texts("my_blocks", "0.1").items():
        assert "PACKAGE" not in path + text
        assert "VERSION" not in text


@pytest.mark.slow
@pytest.mark.skipif(SETUPTOOLS < 77, reason="the package is built by setuptools 77")
def test_it_installs_and_passes_its_own_test(cli: Run, tmp_path: Path) -> None:
    assert cli("new", "--package", "my_blocks").returncode == 0
    # An environment of its own, which has the packages of this one: nothing is downloaded.
    venv.create(tmp_path / "env")
    bound = {"base": str(tmp_path / "env"), "platbase": str(tmp_path / "env")}
    site = Path(sysconfig.get_path("purelib", "venv", vars=bound))
    places = [str(ROOT), *(p for p in sys.path if "site-packages" in p)]
    (site / "outer.pth").write_text("\n".join(places) + "\n")
    python = Path(sysconfig.get_path("scripts", "venv", vars=bound)) / "python"

    def run(*words: str) -> str:
        command = [str(python), "-m", *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    alone = ("--no-build-isolation", "--no-deps", "--no-index")
    run("pip", "install", *alone, "-e", "my_blocks")
    # The plugin of nengo cannot be loaded by pytest 9.
    assert "4 passed" in run("pytest", "-p", "no:nengo", "my_blocks")
    listed = json.loads(run("spikeblocks_command", "plugins", "--json"))
    assert listed["failures"] == []
    offers = [each for each in listed["plugins"] if each["package"] == "my_blocks 0.1.0"]
    assert [(each["kind"], each["name"], each["module"]) for each in offers] == [
        ("blocks", "Peak", "my_blocks.blocks:Peak"),
        ("metrics", "crest_factor", "my_blocks.metrics:CREST_FACTOR"),
        ("plots", "histogram", "my_blocks.plots:HISTOGRAM"),
        ("verbs", "wiring", "my_blocks.wiring"),
    ]
    assert "Peak" in run("spikeblocks_command", "blocks", "Peak")
    assert "lqr (LQR): 2 in, 1 out" in run("spikeblocks_command", "wiring", "starters/adaptive")
    plotted = GRAPH.format(kind="histogram")
    (tmp_path / "drawn.yaml").write_text(plotted, encoding="utf-8")
    run("spikeblocks_command", "run", "drawn.yaml", "--vs", "set=wave.expression=cos(t)")
    assert len(list(tmp_path.glob("runs/drawn/*/plots/values.png"))) >= 1
