"""Metrics and plot kinds of installed packages, and of packages that are broken."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import runtime
from runtime.errors import GraphError
from tests.blocks.test_extensions import package
from tests.runtime.language.texts import edited, labels

HOW_TO = (Path(__file__).parents[3] / "docs" / "how-to.md").read_text(encoding="utf-8")
PLOT = """from runtime.observation import PLOT_KINDS, PlotKind

OWN = PlotKind("as a time series", "runtime.plots.series:draw_timeseries")
"""
GRAPH = {
    "graph": "g",
    "run": {"dt": 0.1, "until": 10.0},
    "blocks": {"ramp": {"type": "Function", "expression": "t"}},
    "metrics": {"p": {"kind": "percentile", "of": "ramp.out", "percent": 25}},
}


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    before = set(sys.modules)
    (code,) = re.findall(r"```python\n# mine.py\n(.*?)```", HOW_TO, re.S)
    (offers,) = re.findall(r"```toml\n(.*?)```", HOW_TO, re.S)
    package(
        tmp_path, "my_package", offers.replace('"', "").replace("project.entry-points.", ""), code
    )
    group = "[spikeblocks.metrics]\n"
    package(tmp_path, "sb_bad", f"{group}bad = sb_bad:BAD\n", "raise OSError('no license')")
    package(tmp_path, "sb_three", f"{group}three = sb_three:A\n", "A = 3")
    package(tmp_path, "sb_rms", f"{group}rms = sb_rms:A\n", "raise RuntimeError('imported')")
    package(tmp_path, "sb_plot", "[spikeblocks.plots]\nown = sb_plot:OWN\n", PLOT)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    for name in set(sys.modules) - before:
        del sys.modules[name]


def with_kind(kind: str) -> dict[str, object]:
    return {**GRAPH, "metrics": {"p": {"kind": kind, "of": "ramp.out"}}}


def test_the_metric_of_the_how_to_is_one_of_the_graph(site: Path) -> None:
    result = runtime.load(GRAPH).run()
    # Of t = 0, 0.1, ... 9.9, a quarter lies below 2.475.
    assert result.metrics["p"] == pytest.approx(2.475)
    window = runtime.load(GRAPH).set("metrics.p.after", 5.0).run()
    assert window.metrics["p"] == pytest.approx(5.0 + 0.25 * 4.9)
    with pytest.raises(GraphError, match="percent: expected a number at least 0 and at most 100"):
        runtime.load(GRAPH).set("metrics.p.percent", 120).check()
    # What nobody names is not imported.
    assert not {"sb_bad", "sb_three", "sb_rms", "sb_plot"} & set(sys.modules)


def test_a_broken_package_is_an_error_at_its_name_only(site: Path) -> None:
    for kind, reason in (
        ("bad", "'bad' of package sb_bad 1.0: sb_bad:BAD cannot be imported: OSError: no license"),
        ("three", "'three' of package sb_three 1.0: sb_three:A is not a MetricKind"),
    ):
        with pytest.raises(GraphError) as caught:
            runtime.load(with_kind(kind)).check()
        (problem,) = caught.value.problems
        assert (problem.address, problem.text) == ("metrics.p.kind", reason)
    with pytest.raises(GraphError, match="did you mean 'percentile'"):
        runtime.load(with_kind("percentil")).check()
    assert runtime.load(with_kind("rms")).run().metrics["p"] is not None
    assert "sb_rms" not in sys.modules


def test_a_plot_kind_of_a_package_is_drawn(site: Path) -> None:
    graph = runtime.load(with_kind("rms")).plot("curve", "own", "ramp.out")
    figure = graph.run().plot()["curve"]
    assert figure.axes[0].lines[0].get_ydata()[-1] == pytest.approx(9.9)


def test_an_editor_offers_the_kinds_of_packages_that_work(site: Path) -> None:
    offered = labels(*edited("kind: distance_floor, of", "kind: ¦, of"))
    assert "percentile" in offered
    assert not {"bad", "three"} & set(offered)
    assert "own" in labels(*edited("kind: map", "kind: ¦"))
