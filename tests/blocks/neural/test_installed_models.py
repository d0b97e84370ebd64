"""Neuron models of installed packages, under the entry points `spikeblocks.neurons`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from runtime.runs import open_run
from tests.blocks.neural.test_own_models import GRAPH, MINE, MODULE
from tests.blocks.test_extensions import package
from tests.conftest import Run

GROUP = "[spikeblocks.neurons]\n"
PACKAGED = "{type: quadratic, tau: 0.2}"


@pytest.fixture(autouse=True)
def _site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with a model, one that raises, and one that offers something else."""
    site = tmp_path / "site"
    package(site, "sb_model", f"{GROUP}quadratic = sb_model:Quadratic\n", MODULE)
    package(site, "sb_raises", f"{GROUP}broken = sb_raises:A\n", "raise OSError('no license')")
    package(site, "sb_other", f"{GROUP}other = sb_other:A\n", "class A: pass")
    package(site, "sb_taken", f"{GROUP}LIF = sb_taken:A\n", "raise RuntimeError('imported')")
    monkeypatch.setenv("PYTHONPATH", str(site))


def graph(folder: Path, neuron: str, name: str = "own") -> None:
    (folder / f"{name}.yaml").write_text(GRAPH.format(neuron=neuron))


@pytest.mark.slow
def test_it_computes_what_the_same_class_of_a_file_does(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "mine.py").write_text(MODULE)
    graph(tmp_path, PACKAGED)
    graph(tmp_path, MINE, "file")
    for name, engine in (("own", "python"), ("own", "compiled"), ("file", "python")):
        out = ["--out", f"{name}_{engine}", "--engine", engine, "--no-plots"]
        done = cli("run", f"{name}.yaml", *out)
        assert done.returncode == 0, done.stderr
    python, compiled, file = (
        open_run(tmp_path / run / "own" / "latest")["out"]
        for run in ("own_python", "own_compiled", "file_python")
    )
    assert np.array_equal(python, file)
    np.testing.assert_allclose(compiled, python, atol=1e-12)
    assert np.any(python)
    manifest = json.loads(
        (tmp_path / "own_compiled" / "own" / "latest" / "manifest.json").read_text()
    )
    assert manifest["engine"] == "compiled"


@pytest.mark.slow
def test_a_run_folder_runs_again_and_workers_find_it(cli: Run, tmp_path: Path) -> None:
    graph(tmp_path, PACKAGED)
    assert cli("run", "own.yaml", "--out", "first", "--no-plots").returncode == 0
    first, again = (tmp_path / name / "own" / "latest" for name in ("first", "again"))
    resolved = (first / "graph.resolved.yaml").read_text()
    assert "type: quadratic" in resolved
    assert "module" not in resolved
    done = cli("run", "first/own/latest/graph.resolved.yaml", "--out", "again", "--no-plots")
    assert done.returncode == 0, done.stderr
    assert np.array_equal(open_run(first)["out"], open_run(again)["out"])
    options = ["--vary", "a.neurons=[20, 50]", "--seeds", "0..1", "-j", "2", "-q"]
    done = cli("sweep", "own.yaml", *options)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("neuron", "message"),
    [
        ("quadratik", "did you mean 'quadratic'"),
        ("broken", "'broken' of package sb_raises 1.0: sb_raises:A cannot be imported: OSError"),
        ("other", "'other' of package sb_other 1.0: sb_other:A is not a subclass of NeuronModel"),
        ("{type: quadratic, tua: 1}", "neuron.tua: unknown, did you mean 'tau'"),
    ],
)
def test_errors(cli: Run, tmp_path: Path, neuron: str, message: str) -> None:
    graph(tmp_path, neuron)
    done = cli("validate", "own.yaml")
    assert done.returncode == 2
    assert message in done.stderr, done.stderr
    assert done.stderr.startswith("own.yaml:6:")


def test_one_that_is_not_named_is_not_imported(cli: Run, tmp_path: Path) -> None:
    graph(tmp_path, "LIF")  # which sb_taken offers too, and raises when it is imported
    done = cli("validate", "own.yaml")
    assert done.returncode == 0, done.stderr
