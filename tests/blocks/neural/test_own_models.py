"""Neuron models of a user's own file: `neuron: {type: Mine, module: mine.py}`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runtime
from blocks import Ensemble
from runtime.runs import open_run
from tests.conftest import Run

MODULE = '''
import math
from blocks import NeuronModel, param

class Quadratic(NeuronModel):
    """V' = max(J, 0)^2 / tau, a spike for each whole."""

    tau: float = param(0.5, unit="s", above=0.0, doc="time in which J = 1 makes a spike")

    @staticmethod
    def step(dt, current, spikes, voltage, refractory, recovery, constants):
        for i in range(len(voltage)):
            voltage[i] += dt * max(current[i], 0.0) ** 2 / constants[0]
            whole = math.floor(voltage[i])
            voltage[i] -= whole
            spikes[i] = whole / dt

class NoStep(NeuronModel):
    pass

class WithSelf(NeuronModel):
    def step(self, dt, current, spikes, voltage, refractory, recovery, constants):
        spikes[:] = current

class Fails(NeuronModel):
    spiking, initial_voltage = False, "0"
    @staticmethod
    def step(dt, current, spikes, voltage, refractory, recovery, constants):
        spikes[:] = current[:-1]
    def rates(self, current):
        return current

class BadRates(Quadratic):
    def rates(self, current):
        return 1 / 0

class Other:
    pass
'''
GRAPH = """
graph: own
run: {{dt: 0.001, until: 0.4, seed: 2}}
blocks:
  x: {{type: Function, expression: "sin(6*t)"}}
  a: {{type: Ensemble, neurons: 50, neuron: {neuron}, max_rates: "uniform(40, 80)"}}
  out: {{type: Decoder, synapse: 0.03}}
wires: {{a: {{input: x.out}}, out: {{spikes: a.spikes}}}}
probes: {{in: {{of: x.out, synapse: 0.03}}, out: out.value}}
metrics: {{error: {{kind: rmse, of: out, reference: in, after: 0.1}}}}
"""
MINE = "{type: Quadratic, module: models/mine.py, tau: 0.2}"


def made(tmp_path: Path, neuron: str = MINE, module: str = MODULE) -> Path:
    (tmp_path / "models").mkdir(exist_ok=True)
    (tmp_path / "models" / "mine.py").write_text(module)
    path = tmp_path / "own.yaml"
    path.write_text(GRAPH.format(neuron=neuron))
    return path


def test_decoders_follow_from_the_models_simulated_rates(tmp_path: Path) -> None:
    """Spikes at J^2 / tau Hz; a Decoder finds the rates by simulation, and decodes the input."""
    run = runtime.load(made(tmp_path)).run()
    assert run.metrics["error"] is not None
    assert run.metrics["error"] < 0.1
    ensemble = runtime.load(made(tmp_path)).network.entries["a"].block
    assert isinstance(ensemble, Ensemble)
    current = np.array([-1.0, 0.0, 2.0, 4.0])
    np.testing.assert_allclose(ensemble.neuron.rates(current), [0.0, 0.0, 20.0, 80.0], atol=1.5)


def test_both_engines_step_it_alike(tmp_path: Path) -> None:
    graph = runtime.load(made(tmp_path))
    one, other = (graph.run(engine=engine) for engine in ("python", "compiled"))
    np.testing.assert_allclose(one["out"], other["out"], atol=1e-12)


@pytest.mark.slow
def test_a_run_folder_holds_the_file_and_runs_again(cli: Run, tmp_path: Path) -> None:
    made(tmp_path)
    done = cli("run", "own.yaml", "--no-plots")
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "runs" / "own" / "latest"
    assert (folder / "mine.py").read_text() == MODULE
    (tmp_path / "models" / "mine.py").unlink()
    again = runtime.load(folder / "graph.resolved.yaml").run()
    assert np.array_equal(again["out"], open_run(folder)["out"])


@pytest.mark.slow
def test_workers_get_the_file(cli: Run, tmp_path: Path) -> None:
    made(tmp_path)
    options = ["--vary", "a.neurons=[20, 50]", "--seeds", "0..1", "-j", "2", "-q"]
    done = cli("sweep", "own.yaml", *options)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("neuron", "message"),
    [
        ("{type: Quadratik, module: models/mine.py}", "did you mean 'Quadratic'"),
        ("{type: Other, module: models/mine.py}", "expected a neuron model of that file, got"),
        ("{module: models/mine.py}", "got nothing; 'models/mine.py' defines Quadratic, NoStep"),
        ("{type: Quadratic, module: models/none.py}", "no such file"),
        ("{type: Quadratic, module: models/mine.yaml}", "expected a Python file"),
        ("{type: Quadratic, module: models/mine.py, tua: 1}", "neuron.tua: unknown, did you mean"),
        ("{type: NoStep, module: models/mine.py}", "NoStep has none"),
        ("{type: WithSelf, module: models/mine.py}", "constants) that is no static method"),
        ("{type: BadRates, module: models/mine.py}", "ZeroDivisionError"),
        ("Quadratic", "; your own needs its file, as in {type: Mine, module: mine.py}"),
    ],
)
def test_errors(cli: Run, tmp_path: Path, neuron: str, message: str) -> None:
    made(tmp_path, neuron)
    done = cli("validate", "own.yaml")
    assert done.returncode == 2
    assert message in done.stderr, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith("own.yaml:6:")


def test_a_failing_step_names_the_block_and_the_line(cli: Run, tmp_path: Path) -> None:
    made(tmp_path, "{type: Fails, module: models/mine.py}")
    done = cli("run", "own.yaml", "--no-plots")
    assert done.returncode == 3
    assert "block 'a' at tick 0" in done.stderr
    line = MODULE.splitlines().index("        spikes[:] = current[:-1]") + 1
    assert f"mine.py:{line}" in done.stderr


def test_modules_are_refused_where_they_should_be(cli: Run, tmp_path: Path) -> None:
    made(tmp_path)
    done = cli("validate", "own.yaml", "--no-modules")
    assert done.returncode == 2
    assert "was not imported, since modules are refused" in done.stderr
