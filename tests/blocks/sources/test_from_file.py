"""Signals from csv and npz files, against numpy and scipy; and files that are wrong."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import integrate, interpolate

import runtime
from blocks import FromFile
from runtime.cli import run
from runtime.errors import GraphError
from runtime.graph import Graph
from runtime.runs import open_run

TIMES = np.array([0.0, 0.3, 0.55, 1.2, 2.0])
TABLE = np.array([[1.0, -2.0], [3.0, 0.5], [2.0, 4.0], [-1.0, 4.0], [0.0, 1.0]])


def graph_of(folder: Path, **entry: Any) -> Graph:
    """A graph in the folder with one FromFile."""
    plain = {
        "run": {"dt": 0.05, "until": 2.0},
        "blocks": {"data": {"type": "FromFile", **entry}},
        "probes": {"out": "data.out"},
    }
    (folder / "graph.yaml").write_text(runtime.load(plain).to_yaml() if not entry else _text(plain))
    return runtime.load(folder / "graph.yaml")


def _text(plain: dict[str, Any]) -> str:
    import json

    return json.dumps(plain)


def csv(path: Path, header: str = "t,a,b\n", separator: str = ",") -> Path:
    rows = np.column_stack([TIMES, TABLE]).tolist()
    path.write_text(header + "\n".join(separator.join(map(str, row)) for row in rows) + "\n")
    return path


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("method", ["hold", "linear", "cubic"])
def test_a_table_is_what_numpy_and_scipy_read_from_it(
    method: str, engine: str, tmp_path: Path
) -> None:
    csv(tmp_path / "data.csv")
    graph = graph_of(tmp_path, file="data.csv", method=method)
    found = graph.set("run.engine", engine).run()
    t = found.time("out")
    if method == "hold":
        expected = TABLE[np.searchsorted(TIMES, t + 1e-9, side="right") - 1]
    elif method == "linear":
        expected = np.column_stack([np.interp(t, TIMES, column) for column in TABLE.T])
    else:
        expected = interpolate.CubicSpline(TIMES, TABLE)(t)
    np.testing.assert_allclose(found["out"], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("header", "separator", "columns"),
    [
        ("# measured\nt,a,b\n", ",", ["b"]),
        ("\ufefftime; a; b\n", ";", ["b"]),
        ("", "\t", ["2"]),
    ],
)
def test_columns_are_chosen_by_name_or_number(
    header: str, separator: str, columns: list[str], tmp_path: Path
) -> None:
    csv(tmp_path / "data.csv", header, separator)
    found = graph_of(tmp_path, file="data.csv", columns=columns).run()
    assert found["out"].ndim == 1
    np.testing.assert_allclose(found["out"], np.interp(found.time("out"), TIMES, TABLE[:, 1]))


def test_the_probes_of_a_run_are_a_source(tmp_path: Path) -> None:
    first = runtime.load("gallery/harmonic_oscillator").set("run.until", 3.0).run()
    first.save(tmp_path / "first")
    name = next(iter(first.probes))
    graph = graph_of(tmp_path, file="first/probes.npz", columns=[name])
    graph = graph.set("run.dt", float(np.diff(first.time(name))[0]))
    found = graph.run()["out"]
    np.testing.assert_array_equal(found, first[name][: len(found)])


def test_a_record_names_its_components_and_units(tmp_path: Path) -> None:
    csv(tmp_path / "data.csv")
    graph = graph_of(tmp_path, file="data.csv", signal="Twist")
    found = graph.probe("omega", "data.out.omega").run()
    np.testing.assert_allclose(found["omega"], np.interp(found.time("omega"), TIMES, TABLE[:, 1]))
    mixed = graph.set("blocks.sum", {"type": "Sum"}).wire(
        "sum.terms", ["data.out.v", "data.out.omega"]
    )
    with pytest.raises(GraphError, match="expected m/s as 'data.out.v' has, got rad/s"):
        mixed.check()


def test_outside_the_file_a_value_holds_or_is_zero(tmp_path: Path) -> None:
    csv(tmp_path / "data.csv")
    graph = graph_of(tmp_path, file="data.csv", columns=["a"]).set("run.until", 4.0)
    with pytest.raises(GraphError, match="has values from 0 s to 2 s, but the run takes 4 s"):
        graph.check()
    held = graph.set("blocks.data.outside", "hold").run()
    np.testing.assert_allclose(held["out"], np.interp(held.time("out"), TIMES, TABLE[:, 0]))
    zero = graph.set("blocks.data.outside", "zero").set("blocks.data.columns", ["b"]).run()
    inside = zero.time("out") <= 2.0 + 1e-9
    np.testing.assert_allclose(zero["out"][inside][-1], 1.0)
    assert not zero["out"][~inside].any()


def test_a_run_folder_holds_the_file_and_runs_again(tmp_path: Path) -> None:
    data = csv(tmp_path / "data.csv")
    graph = graph_of(tmp_path, file="data.csv")
    folder = graph.run().save(tmp_path / "saved")
    data.unlink()
    again = runtime.load(folder / "graph.resolved.yaml").run()
    np.testing.assert_array_equal(again["out"], open_run(folder)["out"])
    read = open_run(folder).manifest["read"]
    assert any(Path(name).name == "data.csv" for name in read)


def test_a_sweep_takes_the_file_along(tmp_path: Path) -> None:
    csv(tmp_path / "data.csv")
    graph = graph_of(tmp_path, file="data.csv", columns=["a"])
    graph = graph.metric("mean", "rms", "out")
    (tmp_path / "graph.yaml").write_text(graph.to_yaml())
    before = Path.cwd()
    os.chdir(tmp_path)
    try:
        arguments = ["sweep", "graph.yaml", "--vary", "data.method=[hold, linear]", "--seeds", "0"]
        assert run([*arguments, "-q", "-j", "1", "--no-plots", "--out", "sweeps"]) == 0
    finally:
        os.chdir(before)
    (index,) = (tmp_path / "sweeps").rglob("index.csv")
    assert (index.parent / "data.csv").read_bytes() == (tmp_path / "data.csv").read_bytes()
    assert index.read_text().count(",ok,") == 2


@pytest.mark.parametrize(
    ("text", "entry", "message"),
    [
        ("t,a\n0,1\n1,x\n", {}, "line 3, column 'a': expected a number, got 'x'"),
        ("t,a\n0,1\n1\n", {}, "line 3: expected 2 numbers, got 1"),
        ("t,a\n0,1\n0,2\n", {}, "ascending order, got 0 s before 0 s"),
        ("t,a\n0,1\n", {}, "at least two times"),
        ("", {}, "the file is empty"),
        ("t\n0\n1\n", {}, "no column beside the times"),
        ("t,a\n0,1\n9,nan\n", {}, "column 'a', row 2: expected a finite number"),
        ("t,a,a\n0,1,1\n1,1,1\n", {}, "two columns are named 'a'"),
        ("t,speed\n0,1\n9,2\n", {"columns": ["sped"]}, "did you mean 'speed'"),
        ("t,a\n0,1\n9,2\n", {"signal": "Pose"}, "expected a type of 1 component"),
        ("t,a\n0,1\n9,2\n", {"file": "other.csv"}, "cannot read"),
        ("t,a\n0,1\n9,2\n", {"file": "$name"}, "write the path itself"),
        ("t,a\n0,1\n9,2\n", {"file": "data.txt"}, "ends in .csv or .npz"),
        ("t,a\n1,1\n9,2\n", {}, "has values from 1 s"),
    ],
)
def test_a_wrong_file_is_refused(
    text: str, entry: dict[str, Any], message: str, tmp_path: Path
) -> None:
    (tmp_path / "data.csv").write_text(text)
    with pytest.raises(GraphError, match=message.replace(".", r"\.")):
        graph_of(tmp_path, **{"file": "data.csv", **entry}).check()


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"\x80\x04K\x01."])
def test_a_file_that_is_not_npz_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "data.npz").write_bytes(content)
    with pytest.raises(GraphError, match="not an npz file of numbers"):
        graph_of(tmp_path, file="data.npz").check()


def test_objects_in_an_npz_file_are_not_loaded(tmp_path: Path) -> None:
    np.savez(tmp_path / "data.npz", t=TIMES, x=np.array([object()] * 5), allow_pickle=True)
    with pytest.raises(GraphError, match="expected n or n x k numbers, got object"):
        graph_of(tmp_path, file="data.npz").check()


def test_the_pushed_mass_of_the_gallery_agrees_with_scipy() -> None:
    found = runtime.load("gallery/recorded_push").run()
    file = Path(runtime.__file__).parents[1] / "graphs" / "gallery" / "recorded_push.csv"
    rows = np.loadtxt(file, delimiter=",", comments="#", skiprows=2)

    def rates(t: float, x: Any) -> list[float]:
        force = float(np.interp(t, rows[:, 0], rows[:, 1], right=0.0))
        return [x[1], force - 0.6 * x[1] - 9.0 * x[0]]

    t = found.time("position")
    solved = integrate.solve_ivp(
        rates, (0, 10), [0, 0], t_eval=t, max_step=0.01, rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(found["position"], solved.y[0], atol=1e-6)
    assert np.ptp(found["position"]) > 0.5


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_scan_with_misses_is_replayed(tmp_path: Path, engine: str) -> None:
    text = {
        "run": {"dt": 0.1, "until": 1.0},
        "world": {"room": [[0, 0], [30, 0], [30, 4], [0, 4]]},
        "blocks": {
            "pose": {"type": "Constant", "signal": "Pose", "value": [2, 2, 0.3]},
            "lidar": {"type": "Lidar", "beams": 16, "dropout": 0.2},
        },
        "wires": {"lidar": {"pose": "pose.value"}},
        "probes": {"s": "lidar.scan"},
    }
    first = runtime.load(text).run()
    first.save(tmp_path / "first")
    assert np.isinf(first["s"]).any()
    assert np.isfinite(first["s"]).any()
    taken: dict[str, Any] = {"file": "first/probes.npz", "columns": ["s"], "signal": "Scan(16)"}
    graph = graph_of(tmp_path, **taken, method="hold", outside="hold").set("run.dt", 0.1)
    found = graph.set("run.until", 1.0).run(engine=engine)["out"]
    np.testing.assert_array_equal(found, first["s"])
    for changed, part in (
        (("signal", "Vector(16)"), "for a Vector"),
        (("method", "cubic"), "hold"),
    ):
        with pytest.raises(GraphError, match=part):
            graph.set(f"data.{changed[0]}", changed[1]).check()


@pytest.mark.parametrize(
    ("block", "is_valid"),
    [
        ({"type": "Constant", "signal": "Scan(2)", "value": [1.0, float("inf")]}, True),
        ({"type": "Constant", "value": [1.0, float("inf")]}, False),
        ({"type": "Constant", "value": float("inf")}, False),
        (
            {
                "type": "Piecewise",
                "times": [0, 1],
                "values": [[1, float("inf")], [1, 2]],
                "signal": "Scan(2)",
            },
            True,
        ),
        ({"type": "Piecewise", "times": [0, 1], "values": [1, float("inf")]}, False),
    ],
)
def test_misses_are_written_as_they_are_recorded(block: dict[str, Any], is_valid: bool) -> None:
    graph = runtime.load({"run": {"dt": 0.1, "until": 0.2}, "blocks": {"a": block}})
    if not is_valid:
        with pytest.raises(GraphError, match="expected finite numbers"):
            graph.check()
        return
    out = "value" if block["type"] == "Constant" else "out"
    np.testing.assert_array_equal(graph.probe("y", f"a.{out}").run()["y"][-1], [1.0, np.inf])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("t,x\n0,1_000\n1,2\n", "line 2, column 'x': expected a number, got '1_000'"),
        ("t,x\n0,1\n1,\u0661\n", "line 3, column 'x': expected a number, got '\u0661'"),
        # In the first line as well, which would be names otherwise.
        ("0,1_000\n1,2\n", "line 1, column '1': expected a number, got '1_000'"),
        ("t,x\n0,1\n1,2,3\n", "line 3: expected 2 numbers, got 3"),
        ("t,x,x\n0,1,2\n", "two columns are named 'x'"),
        (",".join("c" * 100_001) + "\n", "it has more than 100,000 columns"),
        pytest.param(
            *("t,x\n" + "0,0\n" * 2_000_001, "it holds more than 4,000,000 numbers"),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_is_no_table_of_ascii_numbers_is_refused(
    text: str, reason: str, tmp_path: Path
) -> None:
    (tmp_path / "data.csv").write_text(text, encoding="utf-8")
    with pytest.raises(GraphError) as refused:
        graph_of(tmp_path, file="data.csv", outside="hold").check()
    assert reason in str(refused.value)


def test_many_columns_are_read_in_time_that_grows_with_their_number(tmp_path: Path) -> None:
    names = ["time", *(f"c{i}" for i in range(99_999))]
    lines = [",".join(row) for row in (names, ["0"] * 100_000, ["1"] * 100_000)]
    (tmp_path / "data.csv").write_text("\n".join(lines), encoding="utf-8")
    graph = graph_of(tmp_path, file="data.csv", outside="hold", columns=["c0", "c99998"])
    assert graph.set("run.until", 1.0).run()["out"].shape == (20, 2)


def test_the_numbers_of_an_archive_are_counted_before_it_is_unpacked(tmp_path: Path) -> None:
    rows = np.linspace(0.0, 2.0, 4_000_001)
    np.savez(tmp_path / "data.npz", time=rows[::2_000_000], small=rows[::2_000_000], large=rows)
    graph = graph_of(tmp_path, file="data.npz", columns=["small"])
    assert graph.run()["out"][-1] == pytest.approx(1.95)
    with pytest.raises(GraphError, match="4,000,000 numbers; name fewer columns"):
        graph_of(tmp_path, file="data.npz").check()


def test_times_since_the_epoch_begin_with_the_first_row(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,u\n1700000000,1\n1700000001,3\n1700000002,2\n")
    block = FromFile(file=str(tmp_path / "log.csv"), start="first")
    assert block.rows[0].tolist() == [0.0, 1.0, 2.0]
