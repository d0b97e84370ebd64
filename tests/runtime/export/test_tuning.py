"""Parameters of exported C, set by name, against a session's ``set``; saved states; no learning."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks import Block
from runtime import toolchain
from runtime.export import export
from runtime.export.library import export_library
from tests.runtime.export.every_block import first_cases, graph_of
from tests.runtime.export.test_every_block import exportable

pytestmark = pytest.mark.skipif(not toolchain.available(), reason="needs a C compiler")
CASES = first_cases()
QUICK = ("Gain", "DiscretePID", "Lowpass", "ActuatorFault", "Function")
# A session reads their sum over neurons from Python, which adds in another order than C.
SUMMED = ("AdaptiveEnsemble", "RateEnsemble")
SHARE, BEFORE, AFTER = 0.8125, 12, 25  # of a value; ticks before it changes, and all of them
# What follows from these parameters is solved for or tabled by Python: C has the result, as
# the gain of a regulator, as a parameter instead.
BY_GRAPH = {
    *("DiscreteSteadyStateKalman", "ExtendedKalmanFilter", "KalmanFilter", "LQI", "LQR"),
    *("LinearDisturbanceObserver", "LinearMPC", "LinearQuadraticRegulator", "LookupTable", "MPC"),
    "Piecewise",
}


def load(folder: Path, name: str = "controller") -> Any:
    """The class in an exported Python module."""
    spec = importlib.util.spec_from_file_location(f"{folder.name}_{name}", folder / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def tunables(block: Block) -> dict[str, Any]:
    """The numbers of a block that a session may change, by path."""
    found = {n: block.value(n) for n, each in block.spec.params.items() if each.tunable}
    for name, value in list(found.items()):
        if hasattr(value, "values"):
            found |= {f"{name}.{key}": each for key, each in value.values.items()}
            del found[name]
    return {path: v for path, v in found.items() if np.asarray(v).dtype.kind == "f"}


def compare(block: str, path: str, value: Any, folder: Path) -> None:
    """Set a parameter in a session and in C, and compare each output of each tick."""
    session = graph_of(CASES[block]).set("run.engine", "compiled").session()
    network = session.graph.network
    made = load(folder)
    controller = made.Controller()
    entry = network.entries["block"]
    wires = {port: [] for port in entry.cls.spec.inputs}
    for wire in network.wires:
        wires[wire.port].append(f"{wire.source.block}.{wire.source.port}")
    sources = {s.replace(".", "_"): s for each in wires.values() for s in each}
    for tick in range(AFTER):
        if tick == BEFORE:
            name, _, key = path.partition(".")
            new = (np.asarray(value) * SHARE).tolist()
            written = {**entry.block.value(name).values, key: new} if key else new
            session.set(f"block.{name}", written)
            for i, number in enumerate(np.ravel(new)):
                controller.set(f"block.{path}", number, i)
        given = {m: np.ravel(session.read(sources[m])).tolist() for m in made.INPUTS}
        given = {m: v if made.INPUTS[m] else v[0] for m, v in given.items()}
        outputs = controller.step(**given)
        for port in entry.cls.spec.outputs:
            if f"block_{port}" in outputs:
                expected = np.ravel(session.read(f"block.{port}"))
                found = np.ravel(outputs[f"block_{port}"])
                said = f"{port}, tick {tick}"
                rounding = 1e-12 if block in SUMMED else 0.0
                np.testing.assert_allclose(found, expected, rounding, 0.0, err_msg=said)
        session.step()


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(each, marks=() if each in QUICK else pytest.mark.slow)
        for each in sorted(filter(exportable, CASES))
        if tunables(CASES[each].block)
    ],
)
def test_a_parameter_acts_as_in_a_session(name: str, tmp_path: Path) -> None:
    export_library(graph_of(CASES[name]), tmp_path, blocks=["block"], ticks=20)
    header = (tmp_path / "controller.h").read_text()
    by_c = 0
    for path, value in tunables(CASES[name].block).items():
        if f"/* block.{path}: " not in header or f"/* block.{path}: the graph" in header:
            assert name in BY_GRAPH, f"{path} cannot be set"
            continue
        if not np.isfinite(value).all():
            value = np.copysign(np.full_like(value, 2.0), value)
        compare(name, path, value, tmp_path)
        by_c += 1
    assert by_c or name in BY_GRAPH


@pytest.fixture(scope="module")
def learner(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Case A without the robot, whose two ensembles learn."""
    folder = tmp_path_factory.mktemp("learner")
    graph = runtime.load("line_actuator_failure")
    export_library(graph, folder, others=["plant", "fault"], ticks=20)
    return load(folder)


def driven(controller: Any, first: int, ticks: int) -> list[list[float]]:
    """The outputs of some ticks, with a pose that moves."""
    poses = ([0.01 * k, 0.3 + 0.1 * np.sin(0.05 * k), 0.1] for k in range(first, first + ticks))
    return [controller.step(plant_pose=pose)["limit_limited"] for pose in poses]


def test_what_was_saved_goes_on_to_the_bit(learner: Any) -> None:
    one, other = learner.Controller(), learner.Controller()
    driven(one, 0, 60)
    saved = one.save()
    assert len(saved) == len(other.save())
    other.load(saved)
    other.set("limit.omega_max", one.get("limit.omega_max"))
    assert driven(one, 60, 60) == driven(other, 60, 60)
    assert one.save() == other.save()


def test_damaged_bytes_are_refused(learner: Any) -> None:
    one = learner.Controller()
    driven(one, 0, 5)
    saved = one.save()
    for at in (0, 9, 40, len(saved) - 1):
        damaged = bytes([*saved[:at], saved[at] ^ 1, *saved[at + 1 :]])
        with pytest.raises(ValueError, match="not of this controller"):
            one.load(damaged)
    assert one.save() == saved  # a refused load changes nothing


@pytest.mark.slow
def test_bytes_of_other_neurons_are_refused(learner: Any, tmp_path: Path) -> None:
    saved = learner.Controller().save()
    graph = runtime.load("line_actuator_failure").set("run.seed", 5)
    export_library(graph, tmp_path, others=["plant", "fault"], ticks=20)
    with pytest.raises(ValueError, match="not of this controller"):
        load(tmp_path).Controller().load(saved)  # other neurons need other weights


def test_what_does_not_learn_stays_as_it_is(learner: Any) -> None:
    frozen, still = learner.Controller(), learner.Controller()
    for each in (frozen, still):
        driven(each, 0, 40)
    frozen.learn(False)
    for name in ("v", "omega"):  # the same as a session's learning_rate of 0
        still.set(f"adaptive.snn_{name}.learning_rate", 0.0)
    assert driven(frozen, 40, 80) == driven(still, 40, 80)
    frozen.learn(True)
    still.set("adaptive.snn_v.learning_rate", 1.0)
    assert driven(frozen, 120, 80) != driven(still, 120, 80)


def test_wrong_names_indices_and_values_are_said(learner: Any) -> None:
    one = learner.Controller()
    with pytest.raises(ValueError, match="no such parameter"):
        one.set("limit.omega", 1.0)
    with pytest.raises(ValueError, match="no such index"):
        one.set("lqr.gain", 1.0, 6)
    for value in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="out of bounds"):
            one.set("limit.omega_max", value)
    with pytest.raises(ValueError, match="there is no input pose"):
        one.step(pose=[0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="expected 3 numbers, got 2"):
        one.step(plant_pose=[0.0, 0.0])
    with pytest.raises(learner.StepError, match=r"plant\.pose is not finite"):
        one.step(plant_pose=[0.0, float("nan"), 0.0])


def test_ports_of_the_graph_name_members(tmp_path: Path) -> None:
    made = export(runtime.load("gallery/cart_pole_balance"), tmp_path, ticks=20)
    network = runtime.load("gallery/cart_pole_balance").network
    assert {name for name, _ in made.members[0]} == set(network.inputs)
    assert set(network.outputs) <= {name for name, _ in made.members[1]}


def test_a_filter_that_is_tuned_follows_its_formula(tmp_path: Path) -> None:
    graph = runtime.Graph("one", dt=0.01, until=1.0).add("signal", blocks.Constant(value=1.0))
    graph = graph.add("filter", blocks.Lowpass(tau=0.5)).connect("signal.value", "filter.input")
    export_library(graph, tmp_path, name="tuned_filter")
    one = load(tmp_path, "tuned_filter").TunedFilter()
    one.set("filter.tau", 0.05)
    one.set("signal.value", 3.0)
    found = [one.step()["filter_out"] for _ in range(50)]
    expected = 3.0 * -np.expm1(-0.01 * np.arange(50) / 0.05)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
