"""``run.stop``: a run that ends when a signal reaches a level, at a tick or between two."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.errors import GraphError
from runtime.graph import Graph
from tests.conftest import Run
from tests.runtime.engine.test_continuous import OSCILLATOR, Opaque, graph_of

ENGINES = ("python", "compiled")
THIRD = math.pi / 3.0


def stopping(stop: dict[str, Any], **run: Any) -> Graph:
    """x = cos(t) in steps of 0.1 s."""
    return graph_of(OSCILLATOR, stop=stop, **run)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_stops_between_two_ticks(engine: str) -> None:
    result = stopping({"when": "position.out", "below": 0.5}, engine=engine).run()
    assert result.status == "stopped"
    assert result.manifest["stopped_at"] == pytest.approx(THIRD, abs=2e-6)
    # Rows at t = 0, 0.1, ..., 1.0: the last tick before the stop.
    assert len(result["x"]) == 11
    assert result.manifest["ticks"] == 11


def test_the_time_is_as_accurate_as_the_solver() -> None:
    errors = []
    for dt in (0.1, 0.05):
        stop = {"when": "position.out", "below": 0.5}
        found = stopping(stop, dt=dt, engine="python").run().manifest["stopped_at"]
        errors.append(abs(found - THIRD))
    assert math.log2(errors[0] / errors[1]) > 3.5
    precise = stopping(stop, solver="dopri5", rtol=1e-11, atol=1e-12, engine="python").run()
    assert precise.manifest["stopped_at"] == pytest.approx(THIRD, abs=1e-9)


@pytest.mark.parametrize(
    ("stop", "expected"),
    [
        ({"when": "speed.out", "above": 0.0}, math.pi),
        ({"when": "speed.out", "crosses": -0.5}, math.pi / 6.0),
        ({"when": "position.out", "crosses": 0.0}, math.pi / 2.0),
        ({"when": "speed.integral", "below": -0.5}, math.pi / 6.0),
        ({"when": "spring.out", "above": -0.5}, THIRD),
    ],
)
def test_kinds_of_stops(stop: dict[str, Any], expected: float) -> None:
    result = stopping(stop, engine="python").run()
    assert result.manifest["stopped_at"] == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sampled_signal_stops_the_run_at_a_tick(engine: str) -> None:
    graph = stopping({"when": "watch.out", "below": 0.5}, engine=engine)
    watch = {"type": "Gain", "gain": 1.0, "dt": 0.2}
    graph = graph.overlay({"blocks": {"watch": watch}, "wires": {"watch": {"input": "speed.out"}}})
    graph = graph.set("run.stop.below", -0.5)
    result = graph.run()
    assert result.manifest["stopped_at"] == pytest.approx(0.6)  # sin(0.6) = 0.56
    assert len(result["x"]) == 7


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("watched", ["position.out", "sampled.out"])
def test_a_signal_beyond_the_level_at_the_start_has_to_pass_it(engine: str, watched: str) -> None:
    """cos(t) is above 0.5 at first, and again from 5 pi / 3 = 5.236 on."""
    graph = stopping({"when": watched, "above": 0.5}, engine=engine)
    sampled = {"type": "Gain", "gain": 1.0, "dt": 0.1}
    wires = {"sampled": {"input": "position.out"}}
    result = graph.overlay({"blocks": {"sampled": sampled}, "wires": wires}).run()
    at = 5.3 if watched == "sampled.out" else 5.0 * THIRD
    assert result.manifest["stopped_at"] == pytest.approx(at, abs=2e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_crossing_has_a_direction(engine: str) -> None:
    times = []
    for direction in ("rising", "falling", "either"):
        stop = {"when": "position.out", "crosses": 0.0, "direction": direction}
        times.append(stopping(stop, engine=engine).run().manifest["stopped_at"])
    assert times == pytest.approx([1.5 * math.pi, 0.5 * math.pi, 0.5 * math.pi], abs=2e-5)


def test_a_run_that_never_reaches_the_level_is_complete() -> None:
    result = stopping({"when": "position.out", "above": 2.0}, engine="python").run()
    assert result.status == "complete"
    assert result.manifest["stopped_at"] is None
    assert len(result["x"]) == 100


def test_a_plan_that_calls_blocks_from_python_stops_as_well() -> None:
    found = []
    for engine in ENGINES:
        graph = stopping({"when": "o.y", "above": -0.5}, engine=engine)
        graph = graph.without("spring").add("o", Opaque()).connect("position.out", "o.x")
        graph = graph.wire("speed.input", "o.y")
        found.append(graph.run().manifest["stopped_at"])
    assert found[0] == found[1] == pytest.approx(THIRD, abs=2e-6)


def test_a_robot_without_continuous_states_stops_at_a_tick() -> None:
    graph = runtime.load("line_actuator_failure").set("run.until", 3.0)
    graph = graph.set("run.stop", {"when": "plant.pose.x", "above": 2.0}).set(
        "run.engine", "python"
    )
    result = graph.run()
    x = np.asarray(result["plant.pose"])[:, 0] if "plant.pose" in result else None
    assert result.status == "stopped"
    assert 0.0 < result.manifest["stopped_at"] < 3.0
    if x is not None:
        assert x[-2] <= 2.0 < x[-1]


@pytest.mark.parametrize(
    ("stop", "message"),
    [
        ({"when": "positon.out", "below": 0}, "run.stop.when: .*did you mean 'position'"),
        ({"when": "position.out"}, "run.stop: expected one of above, below, crosses"),
        ({"when": "position.out", "above": 1, "below": 0}, "run.stop: expected one of above"),
        ({"when": "position.out", "above": "x"}, "run.stop.above: expected a number"),
        ({"below": 0}, "run.stop.when: expected the address of a number"),
        ({"when": "position.out", "over": 1}, "run.stop.over: unknown key"),
        ("position.out", "run.stop: expected"),
    ],
)
def test_wrong_stops(stop: Any, message: str) -> None:
    with pytest.raises(GraphError, match=message):
        graph_of(OSCILLATOR, stop=stop).check()


def test_a_vector_needs_a_component() -> None:
    graph = runtime.load("line_actuator_failure")
    with pytest.raises(GraphError, match=r"expected one number, got 3; .* plant.pose.x"):
        graph.set("run.stop", {"when": "plant.pose", "above": 0.5}).check()


def test_a_removed_block_ends_no_run() -> None:
    graph = stopping({"when": "spring.out", "above": -0.5}, engine="python").without("spring")
    graph = graph.wire("speed.input", "position.out")
    assert (
        "'spring.out' cannot end the run (run.stop): block 'spring' is removed"
        in graph.observation.notes
    )


def test_the_metric_and_the_folder_hold_the_time(cli: Run, tmp_path: Path) -> None:
    graph = stopping({"when": "position.out", "below": 0.5}, engine="python")
    graph = graph.set("metrics.fell", {"kind": "stop_time", "below": 2.0})
    (tmp_path / "g.yaml").write_text(graph.to_yaml(), encoding="utf-8")
    done = cli(
        "run", "--no-plots", str(tmp_path / "g.yaml"), "--out", str(tmp_path / "runs"), "--json"
    )
    assert done.returncode == 0, done.stderr
    assert "stopped at t = 1.0472 s (run.stop)" in done.stderr
    found = json.loads(done.stdout)
    assert found["status"] == "stopped"
    assert found["metrics"]["fell"] == pytest.approx(THIRD, abs=2e-6)
    again = runtime.load(Path(found["run"]) / "graph.resolved.yaml").run()
    assert again.metrics["fell"] == found["metrics"]["fell"]


def test_trials_that_stop_are_sound(cli: Run, tmp_path: Path) -> None:
    """x0 cos(t) reaches 0.5 at arccos(0.5 / x0)."""
    graph = stopping({"when": "position.out", "below": 0.5}, engine="python")
    graph = graph.set("metrics.fell", {"kind": "stop_time"})
    (tmp_path / "g.yaml").write_text(graph.to_yaml(), encoding="utf-8")
    arguments = ["--vary", "position.initial=[1,2]", "--seeds", "1", "--jobs", "1"]
    out = ["--out", str(tmp_path / "s")]
    done = cli("sweep", "--no-plots", str(tmp_path / "g.yaml"), *arguments, *out)
    assert done.returncode == 0, done.stderr
    (index,) = (tmp_path / "s").glob("**/index.csv")
    rows = index.read_text(encoding="utf-8").split("\n")
    assert all(",ok," in row for row in rows[1:] if row), rows


def test_an_ablation_says_when_each_variant_stopped(cli: Run, tmp_path: Path) -> None:
    """Without the spring, the position stays where it is, and nothing stops the run."""
    graph = stopping({"when": "position.out", "below": 0.5}, engine="python")
    graph = graph.set("metrics.fell", {"kind": "stop_time"})
    graph = graph.set("blocks.push", {"type": "Sum", "signal": "Scalar"})
    graph = graph.wire("push.terms", ["spring.out"]).wire("speed.input", "push.out")
    (tmp_path / "g.yaml").write_text(graph.to_yaml(), encoding="utf-8")
    arguments = ["--without", "spring", "--seeds", "0", "--jobs", "1", "--no-plots", "--json"]
    done = cli(
        "ablate", "--no-plots", str(tmp_path / "g.yaml"), *arguments, "--out", str(tmp_path / "a")
    )
    assert done.returncode == 0, done.stderr
    (index,) = (tmp_path / "a").glob("**/index.csv")
    header, *rows = (line.split(",") for line in index.read_text().splitlines())
    fell = {row[header.index("variant")]: row[header.index("fell")] for row in rows}
    assert float(fell.pop("baseline")) == pytest.approx(THIRD, abs=2e-6)
    assert list(fell.values()) == [""]
