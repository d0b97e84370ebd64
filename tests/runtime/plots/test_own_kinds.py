"""A kind of plot of a graph's own file can do all that those of the library do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import runtime
from runtime.compare import Run
from runtime.compare.overlay import overlays, versus
from runtime.plots import draw

KIND = '''"""Every row as a dot."""

from runtime.observation import PlotKind

CALLS = []


def draw(figure, recordings, end):
    axes = figure.subplots()
    axes.plot(recordings[0].t, recordings[0].columns[:, 0], ".", label="row")
    axes.legend()
    return axes


def overlay(figure, plot, runs):
    shown = {label: run for label, run in runs.items() if plot.of[0] in run.probes}
    if len(shown) < 2:
        return None
    axes = figure.subplots()
    for label, run in shown.items():
        recording = run.probes[plot.of[0]]
        axes.plot(recording.t, recording.columns[:, 0], ".", label=label)
    axes.legend()
    return axes


def limits(figure, top, plot):
    if "xlim" in plot.options:
        top.set_xlim(-1.0, plot.options["xlim"][1])


def labels(top, plot):
    top.set_ylabel(" ".join(plot.options.get("labels", ())))
    return ()


def finish(figure, top, plot):
    CALLS.append(top.get_title(loc="left") or figure.get_suptitle() or "drawn")


dots = PlotKind(
    "dots",
    draw,
    overlay=overlay,
    limits=limits,
    labels=labels,
    finish=finish,
    compared=True,
)
'''
GRAPH: dict[str, Any] = {
    "graph": "g",
    "run": {"dt": 0.1, "until": 1.0},
    "blocks": {"ramp": {"type": "Function", "expression": "t"}},
    "probes": {"ramp": "ramp.out"},
}


@pytest.fixture
def runs(tmp_path: Path) -> list[Run]:
    (tmp_path / "kinds.py").write_text(KIND, encoding="utf-8")
    module = str(tmp_path / "kinds.py")
    plot = {"kind": "dots", "module": module, "of": "ramp", "labels": ["a", "b"], "xlim": [0, 0.5]}
    graph = runtime.load({**GRAPH, "plots": {"dots": plot}})
    double = graph.set("blocks.ramp.expression", "2*t")
    return [
        Run(label, tmp_path, made.run(), {}) for label, made in (("one", graph), ("two", double))
    ]


def test_a_run_is_drawn_by_its_functions(runs: list[Run]) -> None:
    result = runs[0].result
    (axes,) = draw(result.plots[0], result).axes
    assert axes.get_xlim() == (-1.0, 0.5)
    assert axes.get_ylabel() == "a b"
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["row"]
    own = result.plots[0].own
    assert own is not None and callable(own.finish)
    assert len(own.finish.__globals__["CALLS"]) == 1


def test_several_runs_are_overlaid_by_its_function(runs: list[Run]) -> None:
    plot = runs[0].result.plots[0]
    (axes,) = versus(runs, plot).axes
    assert [line.get_ydata()[-1] for line in axes.lines] == pytest.approx([0.9, 1.8])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["one", "two"]
    assert axes.get_xlim() == (-1.0, 0.5)
    assert [name for name, _ in overlays(runs, ["ramp"])] == ["dots", "ramp"]


def test_runs_that_it_cannot_overlay_have_a_part_each(runs: list[Run]) -> None:
    plot = runs[0].result.plots[0]
    del runs[1].result.probes["ramp"]
    figure = versus(runs, plot)
    assert any("not recorded: two" in t.get_text() for axes in figure.axes for t in axes.texts)
