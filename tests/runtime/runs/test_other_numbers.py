"""A changed copy of a graph that shares blocks and texts with it, against the graph loaded anew."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from blocks import Ensemble
from runtime.engine.compiled.runner import _latest
from runtime.errors import GraphError, SimulationError
from runtime.graph import Graph, load
from tests.examples import examples

TEXT: dict[str, Any] = {
    "run": {"dt": 0.001, "until": 0.02},
    "params": {"k": 2.0},
    "blocks": {
        "wave": {"type": "Sine", "frequency": 3.0},
        "noise": {"type": "WhiteNoise", "density": 0.01},
        "gain": {"type": "Gain", "gain": "$k"},
        "again": {"type": "Lowpass", "tau": 0.02, "dt": 0.002},
        "sum": {"type": "Sum"},
        "a": {"type": "Ensemble", "neurons": 6},
        "b": {"type": "Ensemble", "neurons": 6},
        "read": {"type": "Decoder", "synapse": 0.01},
        "plant": {
            "type": "StateSpace",
            "A": [[-1.0, 0.5], [0.0, -2.0]],
            "B": [0.0, 1.0],
            "C": [1.0, 0.0],
        },
    },
    "wires": {
        "gain": {"input": "wave.out"},
        "again": {"input": "noise.out"},
        "sum": {"terms": ["gain.out", "again.out"]},
        "a": {"input": "sum.out"},
        "b": {"input": "plant.out"},
        "read": {"spikes": "a.spikes"},
        "plant": {"input": "read.value"},
    },
    "probes": {"y": "plant.out", "b": "b.spikes", "sum": "sum.out"},
    "metrics": {"mean": {"kind": "mean", "of": "y"}},
}
NUMBERS = st.floats(0.1, 5.0).map(lambda value: round(value, 3))
ODD = st.sampled_from([0.0, -1.0, [1.0, 2.0], [[1.0]], "2", "none", True, None])
CHANGES = st.one_of(
    st.tuples(
        st.sampled_from(
            ["params.k", "wave.frequency", "a.radius", "b.radius", "again.tau", "read.synapse"]
        ),
        NUMBERS | ODD,
    ),
    st.tuples(st.sampled_from(["a.neurons", "b.neurons"]), st.integers(-1, 8)),
    st.tuples(st.sampled_from(["a.neuron", "b.neuron"]), st.sampled_from(["LIF", "ReLU", "Lif"])),
    st.tuples(st.just("plant.D"), st.sampled_from([0.0, 1.0, [[2.0]], [[1.0, 2.0]]])),
    st.tuples(st.just("plant.A.0.1"), NUMBERS | st.just(0.0)),
    st.tuples(st.sampled_from(["again.dt", "run.dt"]), st.sampled_from([0.001, 0.002, 0.0015])),
    st.tuples(st.just("gain.gian"), NUMBERS),
)


def outcome(graph: Graph) -> Any:
    """All that a run says: the text of what is wrong, or every recorded bit."""
    try:
        result = graph.run()
    except GraphError as error:
        return [str(problem) for problem in error.problems]
    except SimulationError as error:
        return str(error)
    recorded = {name: (r.values.shape, r.values.tobytes()) for name, r in result.probes.items()}
    return recorded, result.metrics, result.notes, result.manifest["order"]


@pytest.mark.parametrize("engine", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
@given(changes=st.lists(CHANGES, min_size=1, max_size=3))
@example(changes=[("a.neuron", "ReLU")])  # which is computed apart from b then
@examples(40)
def test_other_values_are_what_a_graph_loaded_anew_says(
    engine: str, changes: list[tuple[str, Any]]
) -> None:
    begun = load(TEXT)._set("run.engine", engine)
    first = outcome(begun)
    graph = begun
    for i in range(len(changes)):
        anew = load(TEXT)._set("run.engine", engine)
        for path, value in changes[: i + 1]:
            anew = anew._set(path, value)
        changed = graph._set(*changes[i])
        assert outcome(changed) == outcome(anew)
        graph = changed
    assert outcome(begun) == first  # and back again


def texts(graph: Graph) -> list[int]:
    program = graph.program()
    return [id(program.code), id(program.first), id(program.names)]


def test_another_number_makes_one_block_and_no_text_anew() -> None:
    graph = load(TEXT).check()
    other = graph.set("a.radius", 2.0).check()
    assert texts(other) == texts(graph)
    before, after = graph.network.entries, other.network.entries
    assert [name for name in before if before[name].block is not after[name].block] == ["a"]
    first, second = before["a"].block, after["a"].block
    assert isinstance(first, Ensemble) and isinstance(second, Ensemble)
    assert [first.radius, second.radius] == [1.0, 2.0]
    # Neurons with other lengths are another plan.
    wider = other.set("a.neurons", 7).check()
    assert not set(texts(wider)) & set(texts(graph))


def test_another_number_uses_the_same_compiled_code() -> None:
    graph = load(TEXT)._set("run.engine", "compiled").check()
    graph.run()
    made = dict(_latest[graph.program().origin])
    other = graph.set("plant.A.0.1", 0.25)
    other.run()
    assert _latest[other.program().origin] == made


def test_a_block_that_reads_a_file_reads_it_again(tmp_path: Any) -> None:
    table = tmp_path / "table.csv"
    table.write_text("t,x\n0,1\n1,1\n", encoding="utf-8")
    text = {
        "run": {"dt": 0.1, "until": 0.3},
        "blocks": {
            "table": {"type": "FromFile", "file": str(table), "columns": ["x"]},
            "gain": {"type": "Gain", "gain": 1.0},
        },
        "wires": {"gain": {"input": "table.out"}},
        "probes": {"y": "gain.out"},
    }
    graph = load(text)
    assert np.all(graph.run()["y"] == 1.0)
    table.write_text("t,x\n0,3\n1,3\n", encoding="utf-8")
    assert np.all(graph.set("gain.gain", 2.0).run()["y"] == 6.0)
