"""What a metric without a value is called: never settled, or a dash."""

from __future__ import annotations

from pathlib import Path

import runtime
from runtime.runs import read_run


def late(until: float) -> runtime.Graph:
    """A step that enters the band at 0.5 s."""
    document = {
        "graph": "late",
        "run": {"dt": 0.01, "until": until},
        "blocks": {"one": {"type": "Step", "time": 0.5, "before": 1.0, "after": 0.0}},
        "probes": {"out": "one.out"},
        "metrics": {"settled": {"kind": "settling_time", "of": "out", "band": 0.1}},
    }
    return runtime.load(document)


def test_a_run_says_that_it_never_settled(tmp_path: Path) -> None:
    result = late(0.4).run()
    assert (result.metrics, result.metric_text("settled")) == ({"settled": None}, "never settled")
    assert result.metric_text("unknown") == "-"
    assert late(2.0).run().metric_text("settled") == "0.5"
    folder = result.save(tmp_path / "runs")
    assert read_run(folder).metric_text("settled") == "never settled"
