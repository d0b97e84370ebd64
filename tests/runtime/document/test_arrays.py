"""Arrays beside a document: read from archives, given in Python, written, run again, refused."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

import blocks
import runtime
from blocks.core import StoredArray
from runtime.document import limits
from runtime.document import node as document
from runtime.errors import GraphError, UsageError

RNG = np.random.default_rng(3)
MATRIX = RNG.standard_normal((12, 12))
TEXT = """
run: {dt: 0.001, until: 0.003}
params: {w: sub/w.npz#w}
blocks:
  x: {type: Constant, value: sub/w.npz#x}
  y: {type: Gain, gain: $w}
wires: {y: {input: x.value}}
probes: {y: y.out}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "sub").mkdir()
    np.savez(tmp_path / "sub" / "w.npz", w=MATRIX, x=np.arange(12))
    (tmp_path / "g.yaml").write_text(TEXT, encoding="utf-8")
    return tmp_path


def given_in_python(matrix: Any) -> runtime.Graph:
    x, y = blocks.Constant(value=np.arange(len(matrix)) * 1.0), blocks.Gain(gain=matrix)
    graph = runtime.Graph("own", dt=0.001, until=0.003).add("x", x).add("y", y)
    return graph.connect("x.value", "y.input").probe("y", "y.out")


def test_arrays_of_a_file_are_those_of_the_graph(folder: Path) -> None:
    graph = runtime.load(folder / "g.yaml")
    expected = MATRIX @ np.arange(12)
    np.testing.assert_allclose(graph.run()["y"][-1], expected, rtol=1e-13)
    assert "<array 12x12 float64" in repr(graph.document.plain())
    assert runtime.load(graph.to_dict()) == graph


def test_a_run_runs_again_from_its_folder_without_the_archive(folder: Path) -> None:
    result = runtime.load(folder / "g.yaml").run()
    saved = result.save(folder / "run")
    (folder / "sub" / "w.npz").unlink()
    again = runtime.load(Path(saved) / "graph.resolved.yaml").run()
    assert np.array_equal(again["y"], result["y"])
    read = result.manifest["read"]
    assert [name for name in read if name.endswith("w.npz#w")]


def test_a_sweep_takes_its_arrays_along(folder: Path) -> None:
    graph = runtime.load(folder / "g.yaml").metric("last", "final", "y.out[1]")
    table = runtime.sweep(graph, {"run.until": [0.002]}, seeds=1, jobs=1, folder=folder / "sweep")
    assert table.trials[0].metrics["last"] == pytest.approx((MATRIX @ np.arange(12))[1])


@given(arrays(float, array_shapes(min_dims=2, max_dims=2, min_side=11, max_side=14),
              elements=st.floats(-1e9, 1e9)))  # fmt: skip
def test_what_is_saved_is_read_again(tmp_path_factory: Any, matrix: np.ndarray) -> None:
    path = tmp_path_factory.mktemp("saved") / "my.yaml"
    graph = runtime.load(
        {"blocks": {"x": {"type": "Gain", "gain": matrix}}, "run": {"dt": 0.1, "until": 1.0}}
    )
    graph.save(path)
    loaded = runtime.load(path)
    assert loaded == graph
    node = loaded.document.get("blocks").get("x").get("gain")  # type: ignore[union-attr]
    assert node is not None and np.array_equal(node.value.values, matrix)
    assert "my.npz#x.gain" in path.read_text(encoding="utf-8")
    # Saved once more to the same place, which is where its arrays are.
    loaded.set("run.dt", 0.2).save(path)
    assert runtime.load(path) == graph.set("run.dt", 0.2)
    assert runtime.load(graph.to_dict()) == graph


def test_arrays_of_other_archives_stay_where_they_are(folder: Path) -> None:
    before = (folder / "sub" / "w.npz").read_bytes()
    graph = runtime.load(folder / "g.yaml")
    graph.save(folder / "copy.yaml")
    assert runtime.load(folder / "copy.yaml") == graph
    assert not (folder / "copy.npz").exists()
    assert (folder / "sub" / "w.npz").read_bytes() == before


def test_few_numbers_are_a_list_and_many_are_one_value() -> None:
    assert document.from_python(np.eye(3)).plain() == np.eye(3).tolist()
    many = document.from_python(np.zeros((1000, 1000)))
    assert isinstance(many.value, StoredArray)
    assert limits.Measure().of(many) == (1, 0)


def test_a_text_of_moderate_arrays_reads_as_equal() -> None:
    graph = given_in_python(MATRIX)
    assert runtime.load({**graph.to_dict()}) == graph
    text = graph.to_yaml()
    assert f"{float(MATRIX[3, 4])!r}" in text
    with pytest.raises(UsageError, match=r"y\.gain: 160000 numbers .* graph\.save"):
        given_in_python(np.zeros((400, 400))).to_yaml()


def test_a_changed_array_is_another_graph(folder: Path) -> None:
    graph = runtime.load(folder / "g.yaml")
    np.savez(folder / "sub" / "w.npz", w=2.0 * MATRIX, x=np.arange(12))
    changed = runtime.load(folder / "g.yaml")
    assert changed != graph
    assert np.array_equal(changed.run()["y"], 2.0 * graph.run()["y"])


def test_a_change_and_an_initial_state_name_arrays(folder: Path) -> None:
    archive = folder / "sub" / "w.npz"
    graph = runtime.load(folder / "g.yaml").set("params.w", f"{archive}#x")
    np.testing.assert_array_equal(graph.run()["y"][-1], np.arange(12.0) ** 2)
    states = {
        "run": {"dt": 0.1, "until": 0.1},
        "blocks": {"d": {"type": "UnitDelay", "signal": "Vector(12)"}},
        "wires": {"d": {"input": "d.out"}},
        "initial": {"d.memory": f"{archive}#x"},
        "probes": {"d": "d.out"},
    }
    np.testing.assert_array_equal(runtime.load(states).run()["d"][0], np.arange(12.0))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("w.npz#v", "'w.npz' has no array 'v'; it has w, n, t"),
        ("w.npz#ww", "has no array 'ww', did you mean 'w'?"),
        ("x.npz#w", "there is no file 'x.npz'; paths are relative to the file that names them"),
        ("bad.npz#w", "'bad.npz' is no archive as numpy.savez writes it"),
        ("w.npz#t", "'w.npz#t': expected numbers, got <U3"),
        ("w.npz#n", "expected a number or an array of n or m x n numbers, got an array of"),
        ("huge.npz#w", "'huge.npz#w': 1000000000 x 1000000000 numbers are more than 2 GiB"),
        ("$dir/w.npz#w", "there is no param 'dir'"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path: Path, name: str, expected: str) -> None:
    np.savez(tmp_path / "w.npz", w=np.eye(3), n=np.array([[np.nan]]), t=np.array(["abc"]))
    (tmp_path / "bad.npz").write_text("no archive", encoding="utf-8")
    with (
        zipfile.ZipFile(tmp_path / "huge.npz", "w") as archive,
        archive.open("w.npy", "w") as file,
    ):
        header = {"descr": "<f8", "fortran_order": False, "shape": (10**9, 10**9)}
        np.lib.format.write_array_header_1_0(file, header)
    path = tmp_path / "g.yaml"
    path.write_text(f'blocks: {{y: {{type: Gain, gain: "{name}"}}}}\n', encoding="utf-8")
    with pytest.raises(GraphError) as raised:
        runtime.load(path).check()
    assert expected in str(raised.value)
    assert f"{path}:1:" in str(raised.value)


def test_all_arrays_together_are_limited(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MAX_ARRAY_BYTES", 12 * 12 * 8 + 12 * 8)
    runtime.load(folder / "g.yaml").check()
    monkeypatch.setattr(limits, "MAX_ARRAY_BYTES", 12 * 12 * 8 + 12 * 8 - 1)
    with pytest.raises(GraphError, match="the arrays of this graph take more than"):
        runtime.load(folder / "g.yaml")
