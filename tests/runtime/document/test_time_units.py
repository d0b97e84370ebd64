"""A graph in ns or in hours says so wherever a time or a frequency is shown."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import runtime
from runtime.diagrams.picture import picture_of
from runtime.document import TIME_UNITS, in_time, rate_text
from runtime.errors import GraphError, SimulationError
from runtime.language.schemas import json_schema
from runtime.plots.figures import draw
from runtime.runs import read_run
from tests.conftest import Run

GRAPH: dict[str, Any] = {
    "graph": "laser",
    "run": {"dt": 0.5, "until": 100.0, "time_unit": "ns"},
    "blocks": {
        "wave": {"type": "Sine", "frequency": 0.1},
        "drive": {"type": "Constant", "value": [1.0, 0.1], "signal": "Twist"},
        "robot": {"type": "DifferentialDrive", "dt": 1.0},
    },
    "wires": {"robot": {"command": "drive.value"}},
    "probes": {"wave": "wave.out", "wheels": "robot.wheels"},
    "plots": {
        "wave": {"kind": "timeseries", "of": "wave"},
        "power": {"kind": "spectrum", "of": "wave"},
        "wheels": {"kind": "timeseries", "of": "wheels"},
    },
    "metrics": {"settled": {"kind": "settling_time", "of": "wave", "band": 2.0}},
}


@pytest.mark.parametrize(
    ("unit", "ns", "hours"),
    [
        *(("s", "ns", "h"), ("m/s", "m/ns", "m/h"), ("rad/s", "rad/ns", "rad/h")),
        *(("1/s^2", "1/ns^2", "1/h^2"), ("Hz", "GHz", "1/h"), ("m", "m", "m"), ("", "", "")),
        *(("mm s", "mm ns", "mm h"), ("kHz", "kHz", "kHz"), ("samples", "samples", "samples")),
    ],
)
def test_units_that_contain_seconds(unit: str, ns: str, hours: str) -> None:
    assert (in_time(unit, "s"), in_time(unit, "ns"), in_time(unit, "h")) == (unit, ns, hours)


@pytest.mark.parametrize(
    ("period", "unit", "text"),
    [
        *(
            (0.5, "ns", "2 GHz"),
            (1e-3, "ns", "1 THz"),
            (0.5, "us", "2 MHz"),
            (4.0, "ms", "0.25 kHz"),
        ),
        *((0.5, "h", "every 0.5 h"), (15.0, "min", "every 15 min"), (1e-3, "us", "1 GHz")),
    ],
)
def test_rates(period: float, unit: str, text: str) -> None:
    assert rate_text(period, unit) == text


def test_axes_metrics_and_a_saved_run_are_in_the_unit(tmp_path: Path) -> None:
    result = runtime.load(GRAPH).run()
    assert result.units["settled"] == "ns"
    for run in (result, read_run(result.save(tmp_path / "run"))):
        wave, power, wheels = (draw(plot, run) for plot in run.plots)
        assert wave.axes[-1].get_xlabel() == "time [ns]"
        assert power.axes[-1].get_xlabel() == "frequency [GHz]"
        assert power.axes[0].get_ylabel() == "power density [1/GHz]"
        assert wheels.axes[0].get_ylabel().endswith("[m/ns]")
    again = runtime.load(tmp_path / "run" / "graph.resolved.yaml")
    assert again.network.time_unit == "ns"


def test_messages_are_in_the_unit(cli: Run, tmp_path: Path) -> None:
    path = tmp_path / "laser.yaml"
    path.write_text(json.dumps(GRAPH))
    done = cli("run", "laser.yaml", "--no-plots")
    assert "laser: 100 ns in" in done.stdout and "settled  0 ns" in done.stdout, done.stderr
    out = cli("explain", "laser.yaml").stdout
    assert "base step 0.5 ns" in out and "2 GHz" in out and "Hz" not in out.replace("GHz", "")
    assert picture_of(runtime.load(path).network).boxes["robot"].rate == "1 GHz"
    bad = runtime.load(path).set("blocks.robot.dt", 0.7)
    with pytest.raises(GraphError, match=r"0.7 ns is not a multiple of run.dt = 0.5 ns"):
        bad.check()
    failing = runtime.load(path).set("blocks.bad", {"type": "Function", "expression": "1/(t - 5)"})
    with pytest.raises(SimulationError, match=r"at tick 10 \(t = 5 ns\)"):
        failing.run()


def test_one_declaration_serves_schema_and_messages() -> None:
    assert list(TIME_UNITS) == _choices(json_schema())
    wrong = {**GRAPH, "run": {**GRAPH["run"], "time_unit": "sec"}}
    with pytest.raises(GraphError, match=r"run\.time_unit: there is no time_unit 'sec'"):
        runtime.load(wrong).check()


def _choices(tree: Any) -> list[str]:
    """The values of run.time_unit in the schema."""
    text = json.dumps(tree)
    start = text.index('"time_unit": {')
    return list(
        json.JSONDecoder().raw_decode(text[start + len('"time_unit": ') :])[0]["anyOf"][0]["enum"]
    )
