"""FMUs: valid for fmpy, equal to a run to the bit, with inputs, parameters and states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.errors import UsageError
from spikeblocks.fmu.export import export_fmu
from tests.runtime.export.table import shipped
from tests.runtime.export.test_targets import FEATURES, graph_of
from tests.runtime.export.test_targets import TICKS as FEATURE_TICKS

fmpy = pytest.importorskip("fmpy", reason="needs the extra fmu")
validation = pytest.importorskip("fmpy.validation")
TICKS = 300
# Graphs whose numbers are those of the Python engine; the compiled engine rounds one sum otherwise.
ROUNDED = ("brusselator",)
STOPPING = {
    "graph": "falling",
    "run": {"dt": 0.01, "until": 2.0, "stop": {"when": "low.out", "above": 0.5}},
    "blocks": {
        "body": {
            "type": "DynamicSystem",
            "states": ["height", "speed"],
            "initial": [1.0, 0.0],
            "derivative": ["speed", "-9.81"],
        },
        "low": {"type": "Function", "names": ["x", "v"], "expression": "x < 0"},
    },
    "wires": {"low": {"u": "body.out"}},
    "probes": {"height": "body.out"},
}


@contextmanager
def instance(file: Path) -> Iterator[Any]:
    """A slave in its initial state, with ``places``: value references by name."""
    description = fmpy.read_model_description(file)
    folder = fmpy.extract(str(file))
    kind = "fmpy.fmi2" if description.fmiVersion == "2.0" else "fmpy.fmi3"
    module = __import__(kind, fromlist=["x"])
    made = getattr(module, f"FMU{description.fmiVersion[0]}Slave")(
        guid=description.guid or description.instantiationToken,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="one",
    )
    made.places = {v.name: v.valueReference for v in description.modelVariables}
    made.get = made.getReal if description.fmiVersion == "2.0" else made.getFloat64
    made.put = made.setReal if description.fmiVersion == "2.0" else made.setFloat64
    made.instantiate(**quiet(module, description.fmiVersion))
    if description.fmiVersion == "2.0":
        made.setupExperiment(startTime=0.0)
    made.enterInitializationMode()
    made.exitInitializationMode()
    yield made
    made.terminate()
    made.freeInstance()


def quiet(module: Any, version: str) -> dict[str, Any]:
    """Callbacks of its own: those of fmpy are shared, and break with an FMU that has ended."""
    if version != "2.0":
        return {}
    calls = module.fmi2CallbackFunctions()
    calls.logger = module.fmi2CallbackLoggerTYPE(lambda *said: None)
    calls.allocateMemory = module.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    calls.freeMemory = module.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    return {"callbacks": calls}


def simulated(file: Path, graph: runtime.Graph, ticks: int) -> Mapping[str, np.ndarray]:
    """All outputs at the ticks of a run, by name."""
    dt = graph.network.dt
    description = fmpy.read_model_description(file)
    names = [v.name for v in description.modelVariables if v.causality in ("output", "local")]
    found = fmpy.simulate_fmu(
        str(file), stop_time=(ticks - 1) * dt, step_size=dt, output_interval=dt, output=names
    )
    return {name: np.asarray(found[name]) for name in names}


def same(found: Mapping[str, np.ndarray], graph: runtime.Graph, result: Any) -> int:
    """Compare what an FMU gives with what a run recorded, to the bit; how many signals."""
    compared = 0
    for name, probe in graph.program().observation.probes.items():
        recording = result.probes[name]
        rows = np.rint(recording.t / graph.network.dt).astype(int)
        labels = dict(zip(recording.labels, recording.columns.T, strict=False))
        if probe.synapse is not None or len(rows) == 1:
            continue
        for signal in probe.signals:
            if len(probe.signals) == 1 and signal.address in found:
                columns = recording.columns
                whole = found[signal.address].reshape(-1, columns.shape[1])
            elif f"{signal.address}[0]" in found:
                columns = recording.column(signal.address).reshape(len(rows), -1)
                parts = [found[f"{signal.address}[{i}]"] for i in range(columns.shape[1])]
                whole = np.column_stack(parts)
            else:
                continue
            inside = rows[rows < len(whole)]
            assert np.array_equal(whole[inside], columns[: len(inside)], equal_nan=True), name
            compared += 1
        for label in labels.keys() & found.keys():
            own = found[label]
            if own.ndim == 1:
                inside = rows[rows < len(own)]
                assert np.array_equal(own[inside], labels[label][: len(inside)]), label
                compared += 1
    return compared


def equal_signals(file: Path, graph: runtime.Graph, ticks: int) -> int:
    """How many signals of a simulation in fmpy are those of a run, to the bit.

    Raises
    ------
    AssertionError : one is not, by its probe.
    """
    for probe in graph.program().observation.probes.values():
        if probe.synapse is not None:  # a filter of what is recorded is no part of the model
            graph = graph.set(f"probes.{probe.name}.synapse", None)
    result = graph.run(engine="python" if graph.network.title in ROUNDED else "compiled")
    return same(simulated(file, graph, ticks), graph, result)


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_is_valid_and_gives_what_a_run_does(fmi: int, tmp_path: Path) -> None:
    graph = runtime.load("gallery/cart_pole_balance").set("run.until", 0.6)
    made = export_fmu(graph, tmp_path, fmi=fmi)
    file = tmp_path / made.files[0]
    assert made.inputs == ("force",) and made.outputs == ("position", "velocity", "angle", "rate")
    assert validation.validate_fmu(str(file)) == []
    found = simulated(file, graph, 300)
    result = graph.run(engine="compiled")
    assert np.array_equal(found["position"], result["position"])
    assert np.array_equal(found["angle"], result["angle"])
    assert np.array_equal(found["gusts.out"], result["force"][:, 1])


@pytest.mark.parametrize("fmi", [2, 3])
def test_inputs_and_parameters_act_as_in_a_session(fmi: int, tmp_path: Path) -> None:
    graph = runtime.load("gallery/cart_pole_balance").set("run.engine", "compiled")
    file = tmp_path / export_fmu(graph, tmp_path, fmi=fmi).files[0]
    session, dt = graph.session(), graph.network.dt
    with instance(file) as slave:
        at = slave.places
        for k in range(200):
            if k == 50:
                slave.put([at["force"]], [2.5])
                session.write("force", 2.5)
            if k == 120:
                slave.put([at["cart.cart_mass"]], [1.5])
                session.set("blocks.cart.cart_mass", 1.5)
            slave.doStep(currentCommunicationPoint=k * dt, communicationStepSize=dt)
            session.step()
            found = slave.get([at[name] for name in ("position", "angle")])
            assert found == [session.read("cart.position"), session.read("cart.angle")], k


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_state_is_kept_given_back_and_goes_to_another_process(fmi: int, tmp_path: Path) -> None:
    graph = runtime.load("gallery/noise_filter")
    file = tmp_path / export_fmu(graph, tmp_path, fmi=fmi).files[0]
    dt = graph.network.dt

    def rows(slave: Any, first: int, count: int) -> list[Any]:
        found = []
        for k in range(first, first + count):
            slave.doStep(currentCommunicationPoint=k * dt, communicationStepSize=dt)
            found.append(slave.get(list(slave.places.values())))
        return found

    with instance(file) as slave:
        rows(slave, 0, 20)
        kept = slave.getFMUState()
        first = rows(slave, 20, 30)
        assert first[0] != first[-1]
        slave.setFMUState(kept)
        assert rows(slave, 20, 30) == first
        stored = slave.serializeFMUState(kept)
        slave.freeFMUState(kept)
        slave.reset()
        assert rows(slave, 0, 1)[0] != first[0]
    with instance(file) as slave:
        slave.setFMUState(slave.deserializeFMUState(stored))
        assert rows(slave, 20, 30) == first
        with pytest.raises(Exception, match="failed with status 3"):
            slave.deserializeFMUState(stored[:-8])


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_communication_step_may_have_any_length(fmi: int, tmp_path: Path) -> None:
    graph = runtime.load("gallery/harmonic_oscillator").set("run.until", 1.0)
    file = tmp_path / export_fmu(graph, tmp_path, fmi=fmi).files[0]
    dt = graph.network.dt
    result = graph.run(engine="compiled")
    probe = next(iter(result.probes.values()))
    with instance(file) as slave:
        place = slave.places[probe.labels[0]]
        now = 0.0
        for step in (0.3 * dt, 0.9 * dt, 4.0 * dt, 0.8 * dt):
            slave.doStep(currentCommunicationPoint=now, communicationStepSize=step)
            now += step
            row = int(now / dt + 1e-6)
            assert slave.get([place])[0] == probe.values.reshape(len(probe.t), -1)[row, 0]


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_run_that_ends_itself_ends_the_simulation(fmi: int, tmp_path: Path) -> None:
    graph = runtime.load(STOPPING)
    file = tmp_path / export_fmu(graph, tmp_path, fmi=fmi).files[0]
    found = simulated(file, graph, 200)
    result = graph.run(engine="compiled")
    rows = len(result.probes["height"].t)
    assert rows < 100
    assert np.array_equal(found["body.out.height"][:rows], result["height"][:, 0])
    assert len(found["body.out.height"]) <= rows + 1


def test_numbers_without_names_are_one_variable_in_fmi_3(tmp_path: Path) -> None:
    graph = runtime.load("gallery/neural_array").set("run.until", 0.02)
    names = {}
    for fmi in (2, 3):
        file = (
            tmp_path / export_fmu(graph, tmp_path / str(fmi), fmi=fmi).folder / "neural_array.fmu"
        )
        description = fmpy.read_model_description(file)
        names[fmi] = {v.name: v.shape for v in description.modelVariables}
        found = simulated(file, graph, 20)
        assert same(found, graph, graph.run(engine="compiled")) > 0
    arrays = {name: shape for name, shape in names[3].items() if shape and shape != (1,)}
    assert arrays
    assert all(f"{n}[{i}]" in names[2] for n, shape in arrays.items() for i in range(shape[0]))


def test_what_an_fmu_does_not_have_is_refused(tmp_path: Path) -> None:
    graph = runtime.load("gallery/pendulum")
    with pytest.raises(UsageError, match="an FMU has the whole graph"):
        export_fmu(graph, tmp_path, float32=True)
    with pytest.raises(UsageError, match="may be a word, a macro or a header of C"):
        export_fmu(graph, tmp_path, name="double")


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped())
def test_every_shipped_graph_as_an_fmu(name: str, tmp_path: Path) -> None:
    graph = runtime.load(name)
    ticks = min(TICKS, graph.network.ticks)
    graph = graph.set("run.until", ticks * graph.network.dt)
    fmi = 2 + sum(map(ord, name)) % 2
    file = tmp_path / export_fmu(graph, tmp_path, fmi=fmi).files[0]
    assert validation.validate_fmu(str(file)) == []
    assert equal_signals(file, graph, ticks) or not graph.program().observation.probes


@pytest.mark.slow
@pytest.mark.parametrize("feature", FEATURES)
def test_a_feature_is_exported(feature: str, tmp_path: Path) -> None:
    graph = graph_of(feature, tmp_path)
    file = tmp_path / "made" / export_fmu(graph, tmp_path / "made").files[0]
    assert not validation.validate_fmu(str(file))
    assert equal_signals(file, graph, FEATURE_TICKS)
