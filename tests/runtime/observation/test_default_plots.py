"""The plots of a graph that has no section ``plots``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import runtime
from tests.conftest import Run

GRAPH: dict[str, Any] = {
    "graph": "seen",
    "run": {"dt": 0.001, "until": 0.02, "engine": "python"},
    "blocks": {
        "command": {"type": "Constant", "value": [1.0, 0.5], "signal": "Twist"},
        "robot": {"type": "Unicycle"},
        "clock": {"type": "Clock"},
        "neurons": {"type": "Ensemble", "neurons": 10, "dimensions": 1},
        "many": {"type": "WhiteNoise", "density": 1.0, "signal": "Vector(40)"},
    },
    "wires": {"robot": {"command": "command.value"}, "neurons": {"input": "clock.time"}},
    "probes": {
        "command": "command.value",
        "pose": "robot.pose",
        "clock": "clock.time",
        "two": ["clock.time", "robot.pose.x"],
        "spikes": "neurons.spikes",
        "many": "many.out",
    },
}
KINDS = {
    "pose": "trajectory",
    "clock": "timeseries",
    "two": "timeseries",
    "spikes": "raster",
    "many": "heatmap",
}


def test_each_probe_that_changes_has_a_plot() -> None:
    result = runtime.load(GRAPH).run()
    assert {plot.name: plot.kind for plot in result.plots} == KINDS
    assert {plot.of for plot in result.plots} == {(name,) for name in KINDS}


def test_the_command_line_draws_them(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "seen.yaml").write_text(runtime.load(GRAPH).to_yaml(), encoding="utf-8")
    done = cli("run", "seen.yaml")
    assert done.returncode == 0, done.stderr
    drawn = (tmp_path / "runs" / "seen" / "latest" / "plots").iterdir()
    assert {file.name for file in drawn} == {f"{name}.png" for name in KINDS}


def test_a_section_plots_is_all_that_is_drawn() -> None:
    for plots in ({}, {"where": {"kind": "xy", "of": ["robot.pose.x", "robot.pose.y"]}}):
        result = runtime.load({**GRAPH, "plots": plots}).run()
        assert [plot.name for plot in result.plots] == list(plots)
