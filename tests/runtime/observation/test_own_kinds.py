"""Metrics and plot kinds of a graph's own file: `{kind: mine, module: mine.py}`."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest

import runtime
from runtime.runs import open_run
from tests.conftest import Run

HOW_TO = (Path(__file__).parents[3] / "docs" / "how-to.md").read_text(encoding="utf-8")
(MODULE,) = re.findall(r"```python\n# mine.py\n(.*?)```", HOW_TO, re.S)
MODULE += """

def fails(series, options):
    return 1 / 0


broken = MetricKind(fails, "fails")
rms = MetricKind(lambda series, options: 42.0, "named as one of the library")
"""
GRAPH = """
graph: own
run: {dt: 0.1, until: 10.0}
blocks:
  ramp: {type: Function, expression: "t"}
  gain: {type: Gain, gain: 1.0}
wires: {gain: {input: ramp.out}}
metrics:
  p: {kind: percentile, module: kinds/mine.py, of: gain.out, percent: 25}
plots:
  steps: {kind: stairs, module: kinds/mine.py, of: gain.out}
"""


@pytest.fixture
def graph(tmp_path: Path) -> Path:
    (tmp_path / "kinds").mkdir()
    (tmp_path / "kinds" / "mine.py").write_text(MODULE)
    path = tmp_path / "own.yaml"
    path.write_text(GRAPH)
    return path


def test_the_metric_and_the_plot_of_the_how_to(graph: Path) -> None:
    result = runtime.load(graph).run()
    # Of t = 0, 0.1, ... 9.9, a quarter lies below 2.475.
    assert result.metrics["p"] == pytest.approx(2.475)
    figure = result.plot()["steps"]
    (line,) = figure.axes[0].lines
    assert line.get_drawstyle() == "steps-post"
    assert line.get_ydata()[-1] == pytest.approx(9.9)


def test_a_kind_of_a_file_hides_that_of_the_library(graph: Path) -> None:
    changed = GRAPH.replace("kind: percentile", "kind: rms").replace(", percent: 25", "")
    graph.write_text(changed)
    assert runtime.load(graph).run().metrics["p"] == 42.0


def test_a_run_folder_holds_the_file_and_runs_again(cli: Run, graph: Path) -> None:
    done = cli("run", "own.yaml")
    assert done.returncode == 0, done.stderr
    folder = graph.parent / "runs" / "own" / "latest"
    assert (folder / "mine.py").read_text() == MODULE
    manifest = json.loads((folder / "manifest.json").read_text())
    assert "mine.py" in " ".join(manifest["read"])
    assert (folder / "plots" / "steps.png").is_file()
    (graph.parent / "kinds" / "mine.py").unlink()
    again = runtime.load(folder / "graph.resolved.yaml").run()
    seen = open_run(folder)
    assert again.metrics == seen.metrics
    assert again.plot().keys() == {"steps"}
    # Viewing a run imports none of its files.
    assert not seen.plots
    assert any("'steps' is not drawn again" in note for note in seen.notes)
    report = cli("report", str(folder))
    assert report.returncode == 0, report.stderr


def test_workers_get_the_file(cli: Run, graph: Path) -> None:
    options = ["--vary", "gain.gain=[1, 2]", "--seeds", "0..1", "-j", "2", "-q"]
    done = cli("sweep", "own.yaml", *options, "--out", "out")
    assert done.returncode == 0, done.stderr
    (index,) = (graph.parent / "out").rglob("index.csv")
    with index.open() as file:
        rows = list(csv.DictReader(file))
    assert sorted(float(row["p"]) for row in rows) == pytest.approx([2.475, 2.475, 4.95, 4.95])


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("kind: percentil, module: kinds/mine.py", "did you mean 'percentile'"),
        (
            "kind: stairs, module: kinds/mine.py",
            "expected a MetricKind of that file, got the string 'stairs'",
        ),
        ("module: kinds/mine.py", "kind: expected a MetricKind of that file, got nothing"),
        ("kind: p, module: kinds/none.py", "metrics.p.module: no such file: 'kinds/none.py'"),
        ("kind: p, module: kinds/mine.yaml", "metrics.p.module: expected a Python file"),
        ("kind: p, module: 3", "metrics.p.module: expected a Python file, got 3"),
        ("kind: percentile, module: $m", "metrics.p.module: write the path itself"),
        ("kind: percentile, module: kinds/mine.py, percent: 120", "at most 100"),
        ("kind: percentile, module: kinds/mine.py, procent: 20", "did you mean 'percent'"),
        ("kind: percentile", "expected one of settling_time"),
    ],
)
def test_errors(cli: Run, graph: Path, entry: str, message: str) -> None:
    written = "kind: percentile, module: kinds/mine.py, of: gain.out, percent: 25"
    graph.write_text(GRAPH.replace(written, f"{entry}, of: gain.out"))
    done = cli("validate", "own.yaml")
    assert done.returncode == 2
    assert message in done.stderr, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith("own.yaml:9:")


def test_modules_are_refused_where_they_should_be(cli: Run, graph: Path) -> None:
    done = cli("validate", "own.yaml", "--no-modules")
    assert done.returncode == 2
    for place in ("metrics.p.kind", "plots.steps.kind"):
        assert f"{place}: 'kinds/mine.py' was not imported" in done.stderr, done.stderr


def test_a_formula_that_fails_is_a_note_with_its_line(graph: Path) -> None:
    changed = GRAPH.replace("kind: percentile", "kind: broken").replace(", percent: 25", "")
    graph.write_text(changed)
    result = runtime.load(graph).run()
    assert result.metrics["p"] is None
    line = MODULE.splitlines().index("    return 1 / 0") + 1
    (note,) = (note for note in result.notes if "its formula failed" in note)
    assert "ZeroDivisionError" in note
    assert f"mine.py:{line}" in note
