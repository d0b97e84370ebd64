"""Whatever is done to a sound graph, it runs or is refused with a place: never a traceback."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from runtime.document import dump_yaml
from runtime.errors import GraphError, SimulationError

SOUND: dict[str, Any] = {
    "graph": "sound",
    "run": {"dt": 0.001, "until": 0.004, "seed": 1},
    "params": {"v": 1.0, "neurons": 4},
    "world": {"circles": [[50.0, 5.0, 0.5]], "room": [[-9, -9], [90, -9], [90, 90], [-9, 90]]},
    "blocks": {
        "track": {"type": "LinePath", "samples": 11},
        "match": {"type": "MatchingPoint", "v_r": "$v", "dt": 0.002},
        "error": {"type": "TrackingError"},
        "part": {
            "params": {"n": "$neurons", "k": 2.0},
            "inputs": {"x": "Scalar", "e": {"type": "Scalar", "optional": True}},
            "outputs": {"y": "gain.out"},
            "blocks": {
                "snn": {"type": "AdaptiveEnsemble", "neurons": "$n"},
                "gain": {"type": "Gain", "gain": "$k"},
            },
            "wires": {
                "snn": {"input": "inputs.x", "error": "inputs.x"},
                "gain": {"input": "snn.output"},
            },
        },
        "mux": {"type": "Mux"},
        "total": {"type": "Sum", "signs": [1, -1]},
        "limit": {"type": "Saturator", "omega_max": 1.0},
        "plant": {"type": "DifferentialDrive", "x0": [0.0, 0.5, 0.0]},
    },
    "wires": {
        "match": {"pose": "plant.pose", "path": "track.path"},
        "error": {"pose": "plant.pose", "reference": "match.reference"},
        "part": {"x": "error.position"},
        "mux": {"omega": "part.y"},
        "total": {"terms": ["match.feedforward", "mux.out"]},
        "limit": {"command": "total.out"},
        "plant": {"command": "limit.limited"},
    },
    "without": ["part.gain"],
    "bypass": ["limit"],
    "probes": {
        "pose": {"of": "plant.pose", "every": 2},
        "both": ["error.position", "plant.pose.theta"],
        "spikes": "part.snn.spikes",
    },
    "plots": {
        "way": {"kind": "trajectory", "of": ["pose", "track.path"], "title": "The way"},
        "raster": {"kind": "raster", "of": "spikes"},
        "map": {"kind": "map", "of": ["pose", "match.reference"], "distance": 1.0},
    },
    "metrics": {
        "settled": {"kind": "settling_time", "of": "both", "band": [0.1, 0.2]},
        "fast": {"kind": "first_time", "of": "plant.pose.x", "level": 0.001},
        "near": {"kind": "distance_mae", "of": "pose", "distance": 2.0},
        "last": {"kind": "final", "of": "plant.pose.x", "above": -10.0, "after": 0.001},
    },
}


def test_the_graph_is_sound() -> None:
    assert runtime.load(SOUND).run().failures == []


def entries(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The paths of all entries below a node."""
    keys = node.keys() if isinstance(node, dict) else range(len(node))
    for key in keys:
        yield (*path, key)
        if isinstance(node[key], (dict, list)):
            yield from entries(node[key], (*path, key))


PATHS = sorted(entries(SOUND), key=str)
NAMES = sorted({str(key) for path in PATHS for key in path})
TEXTS = sorted({value for path in PATHS for value in [str(path[-1])]} | {"plant.pose", "$v"})
VALUES = st.one_of(
    st.sampled_from([None, True, False, 0, 1, -1, 2, 7, 0.5, -0.5, 1e-9, 1e300, 10**30]),
    st.sampled_from([float("nan"), float("inf"), "", " ", ".", "a.b.c.d", "$", "$zz", "inputs.x"]),
    st.sampled_from([[], {}, [[]], [None], {"": None}, ["plant.pose"], {"type": "Sum"}]),
    st.sampled_from(TEXTS),
    st.text(max_size=4),
).map(copy.deepcopy)


@st.composite
def mutated(draw: st.DrawFn) -> dict[str, Any]:
    """The sound graph with one to three entries deleted, renamed, retyped, moved or added."""
    graph = copy.deepcopy(SOUND)
    for _ in range(draw(st.integers(1, 3))):
        paths = sorted(entries(graph), key=str)
        if not paths:
            break
        *above, key = draw(st.sampled_from(paths))
        owner: Any = graph
        for name in above:
            owner = owner[name]
        what = draw(st.sampled_from(["delete", "rename", "retype", "move", "add"]))
        if what == "delete":
            del owner[key]
        elif what == "retype":
            owner[key] = draw(VALUES)
        elif what == "move":
            *source, last = draw(st.sampled_from(paths))
            found: Any = graph
            for name in (*source, last):
                found = found[name]
            owner[key] = copy.deepcopy(found)
        elif isinstance(owner, list):
            owner.append(draw(VALUES))
        elif what == "add":
            owner[draw(st.sampled_from(NAMES) | st.text(max_size=4))] = draw(VALUES)
        else:
            name = draw(st.sampled_from(NAMES) | st.just(key[:-1]) | st.just(f"{key}x"))
            items = [(name if k == key else k, v) for k, v in owner.items()]
            owner.clear()
            owner.update(items)
    return graph


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mutated") / "g.yaml"


def run_or_refuse(source: Any) -> GraphError | None:
    try:
        graph = runtime.load(source).check()
    except GraphError as error:
        assert error.problems
        return error
    if graph.network.ticks < 100:
        try:
            graph.run()
        except SimulationError as error:
            assert error.block in graph.network.entries
    return None


@given(mutated())
def test_a_mutated_mapping_runs_or_is_refused_with_addresses(graph: dict[str, Any]) -> None:
    error = run_or_refuse(graph)
    for problem in error.problems if error else ():
        assert problem.address or problem.text.startswith("algebraic loop")
        assert "\n" not in str(problem)


@given(mutated())
def test_a_mutated_text_runs_or_is_refused_with_places(file: Path, graph: dict[str, Any]) -> None:
    text = dump_yaml(graph)
    file.write_text(text, encoding="utf-8", newline="")
    error = run_or_refuse(file)
    lines = text.split("\n")
    for problem in error.problems if error else ():
        assert problem.where.file == str(file)
        if not problem.text.startswith("algebraic loop"):
            line, column = problem.where.line, problem.where.column
            assert 1 <= line <= len(lines)
            assert 1 <= column <= len(lines[line - 1]) + 1


@given(mutated())
def test_text_and_mapping_have_the_same_problems(file: Path, graph: dict[str, Any]) -> None:
    file.write_text(dump_yaml(graph), encoding="utf-8", newline="")
    found = []
    for source in (graph, file):
        error = run_or_refuse(source)
        found.append({problem.text for problem in error.problems} if error else set())
    assert found[0] == found[1]
