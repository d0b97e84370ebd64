"""Trials that run in the engine of the trial before have the bits of new runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import runtime
from runtime.errors import GraphError, SimulationError
from runtime.experiments.execution.trials import Configuration, GraphBundle, Trial
from runtime.experiments.execution.worker import Task, run_task
from runtime.graph import RepeatedRuns
from runtime.graph.numbers import is_number
from tests.compilers import skip_without_compiler

GRAPHS = Path(runtime.__file__).parents[1] / "graphs"
SHIPPED = sorted(
    str(path.relative_to(GRAPHS).with_suffix(""))
    for path in (*GRAPHS.glob("*.yaml"), *(GRAPHS / "gallery").rglob("*.yaml"))
)
ENGINES = ("python", "compiled")
TICKS = 60
# What the graphs below have in common: states, noise, neurons that learn, events, parts, delays.
SWEPT: dict[str, Any] = {
    "graph": "swept",
    "run": {"dt": 0.002, "until": 0.2, "solver": "rk4"},
    "params": {"k": 1.5, "level": 0.4, "n": 9},
    "blocks": {
        "push": {"type": "Step", "time": 0.051, "after": "$k"},
        "force": {"type": "Sum", "signs": [1, -1, 1]},
        "drag": {"type": "Gain", "gain": 0.5},
        "speed": {"type": "Integrator", "initial": 0.1},
        "noise": {"type": "WhiteNoise", "density": 0.001},
        "relay": {"type": "Relay", "switch_on": "$level", "switch_off": 0.1},
        "cells": {"type": "Ensemble", "neurons": "$n"},
        "read": {"type": "Decoder", "synapse": 0.02},
        "fixed": {"type": "Constant", "value": "$k"},
    },
    "wires": {
        "force": {"terms": ["push.out", "drag.out", "noise.out"]},
        "drag": {"input": "speed.out"},
        "speed": {"input": "force.out"},
        "relay": {"input": "speed.out"},
        "cells": {"input": "speed.out"},
        "read": {"spikes": "cells.spikes"},
    },
    "probes": {
        "speed": "speed.out",
        "read": {"of": "read.value", "synapse": 0.05},
        "relay": "relay.out",
        "fixed": "fixed.value",
        "spikes": "cells.spikes",
    },
    "metrics": {"rms": {"kind": "rms", "of": "speed.out"}},
}


def bits(graph: runtime.Graph, result: runtime.Result) -> dict[str, bytes]:
    probes = {name: each.values.tobytes() for name, each in result.probes.items()}
    return {**probes, "metrics": repr(result.metrics).encode()}


def compared(
    runs: RepeatedRuns, graph: runtime.Graph, values: dict[str, Any], seed: int, fails: bool = False
) -> bool:
    """Whether the engine of the last run was used again; its bits must be those of a new run."""
    before = runs._last
    try:
        found = bits(graph, runs.run(values, seed, whole=False))
    except (GraphError, SimulationError) as error:
        found = {"error": type(error).__name__.encode()}
    for path, value in values.items():
        graph = graph.set(path, value, origin=path)
    try:
        fresh = runtime.load(graph.to_dict(modules=True)).with_seed(seed)
        expected = bits(graph, fresh.run())
    except (GraphError, SimulationError) as error:
        expected = {"error": type(error).__name__.encode()}
    assert found == expected, values
    assert "error" not in found or fails, found["error"]
    return before is not None and runs._last is before


@pytest.mark.parametrize("engine", ENGINES)
def test_other_numbers_and_seeds_take_no_new_engine(engine: str) -> None:
    if engine == "compiled":
        skip_without_compiler()
    graph = runtime.load(SWEPT).set("run.engine", engine)
    runs = RepeatedRuns(graph)
    paths = {
        "drag.gain": (0.5, 0.75, 0.75, 2),
        "speed.initial": (0.1, -0.3, 0.0, 0.1),
        "params.k": (1.5, 2, -1.0, 1.5),
        "relay.switch_off": (0.1, 0.2, 0.2, 0.0),
    }
    for i, seed in enumerate((1, 1, 2, 1)):
        values = {path: found[i] for path, found in paths.items()}
        assert compared(runs, graph, values, seed) == (i > 0)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("key", "value"), [("memory", 100), ("keep", 0.05)])
def test_recordings_on_disk_and_of_the_last_part(engine: str, key: str, value: Any) -> None:
    if engine == "compiled":
        skip_without_compiler()
    graph = runtime.load(SWEPT).set("run.engine", engine).set(f"run.{key}", value)
    runs, folders = RepeatedRuns(graph), []
    for i, gain in enumerate((0.5, 0.7, 0.6)):
        assert compared(runs, graph, {"drag.gain": gain}, 1) == (i > 0)
        folders.append(runs._last and runs._last.engine.recorder.folder)
    # Those of the trials before are removed.
    assert [each is not None and each.exists() for each in folders] == [
        False,
        False,
        key == "memory",
    ]


@pytest.mark.parametrize(
    ("path", "values"),
    [
        ("push.time", (0.051, 0.061, 0.06)),  # an edge, which the plan has
        ("params.n", (9, 12)),  # neurons: another shape, and what a Decoder reads
        ("cells.radius", (1.0, 2.0)),  # published
        ("run.until", (0.2, 0.1)),
        ("drag.gain", (0.5, "$k", 0.5)),
        ("params.level", (0.4, 0.2)),
    ],
)
def test_what_a_plan_depends_on_prepares_the_run_anew(path: str, values: tuple[Any, ...]) -> None:
    graph = runtime.load(SWEPT).set("run.engine", "python")
    runs = RepeatedRuns(graph)
    again = [compared(runs, graph, {path: value}, 1) for value in values]
    assert any(again) == (path == "params.level")


def test_a_param_that_something_is_computed_from_prepares_the_run_anew() -> None:
    text = {**SWEPT, "params": {**SWEPT["params"], "k2": "$k * 2"}}
    text["blocks"] = {**SWEPT["blocks"], "drag": {"type": "Gain", "gain": "$k2"}}
    graph = runtime.load(text).set("run.engine", "python")
    runs = RepeatedRuns(graph)
    assert not any(compared(runs, graph, {"params.k": k}, 1) for k in (1.0, 0.5))


def numbers_of(graph: runtime.Graph) -> list[tuple[str, Any]]:
    """All numbers that are written in the blocks of a graph, with their paths."""
    found = []

    def walk(prefix: str, node: Any) -> None:
        for name, entry in node.items():
            if name in ("dt", "seed", "offset", "neurons", "n"):
                continue
            if isinstance(entry, dict):
                walk(f"{prefix}{name}.", entry)
            elif is_number(entry) and entry not in ([], [[]]):
                found.append((f"{prefix}{name}", entry))

    walk("", {k: v for k, v in graph.to_dict()["blocks"].items() if isinstance(v, dict)})
    return found


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", SHIPPED)
@settings(
    max_examples=2, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_random_numbers_of_shipped_graphs(name: str, engine: str, data: st.DataObject) -> None:
    if engine == "compiled":
        skip_without_compiler()
    graph = runtime.load(GRAPHS / f"{name}.yaml").set("run.engine", engine)
    graph = graph.set("run.until", TICKS * graph.network.dt)
    numbers = numbers_of(graph)
    if not numbers:
        pytest.skip("no block has a number")
    runs = RepeatedRuns(graph)
    chosen = data.draw(st.lists(st.sampled_from(numbers), min_size=1, max_size=3, unique_by=str))
    for _ in range(4):
        factors = st.sampled_from((1.0, 0.9, 1.1, 0.5))
        values = {path: (np.asarray(value) * data.draw(factors)).tolist() for path, value in chosen}
        compared(runs, graph, values, data.draw(st.integers(0, 2)), fails=True)


def test_a_worker_uses_the_engine_of_the_trial_before(monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = GraphBundle.of(runtime.load(SWEPT).set("run.engine", "python"))

    def trial(number: int, gain: float, keep: tuple[str, ...] = ()) -> Any:
        configuration = Configuration(number, (), bundle, (("drag.gain", str(gain)),))
        return run_task(Task(Trial(number, configuration, 1), "all", keep))

    first = trial(0, 0.5)
    # Nothing is prepared from here on.
    with monkeypatch.context() as patched:
        patched.setattr("runtime.graph.repeating.chosen_runner", None)
        second, third = trial(1, 0.7), trial(2, 0.5)
    assert first.status == second.status == third.status == "ok"
    assert first.metrics == third.metrics != second.metrics
    kept = trial(3, 0.7, keep=("ok",))
    values = kept.result.probes["speed"].values.copy()
    trial(4, 0.1)
    assert kept.metrics == second.metrics
    assert kept.result.texts["graph.resolved.yaml"].count("gain: 0.7") == 1
    np.testing.assert_array_equal(kept.result.probes["speed"].values, values)


@pytest.mark.parametrize("engine", ENGINES)
def test_another_seed_starts_what_draws_and_what_reads_it(
    engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if engine == "compiled":
        skip_without_compiler()
    graph = runtime.load(SWEPT).set("run.engine", engine)
    runs = RepeatedRuns(graph)
    compared(runs, graph, {}, 1)
    started: list[str] = []
    for name, entry in graph.network.entries.items():
        start = entry.cls.start

        def noted(block: Any, state: Any, name: str = name, start: Any = start) -> None:
            started.append(name)
            start(block, state)

        monkeypatch.setattr(entry.cls, "start", noted)
    assert runs.run({}, 2, whole=False).status == "complete"
    # The noise draws in its output, the cells when they start, and the decoder reads the cells.
    assert sorted(started) == ["cells", "noise", "read"]
    monkeypatch.undo()
    assert compared(runs, graph, {}, 3)
