"""Reports are self-contained pages with all tables and curves; all text is escaped."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import runtime
from blocks.core.signals import FloatArray
from runtime.reports import report, zoom
from runtime.reports.svg import figure_svg
from tests.browser import Element, elements, find, load, measure, rows
from tests.conftest import Run

GRAPH = """
graph: small <b>&amp; robust_</b><script>alert(1)</script>
run: {dt: 0.01, until: 2.0, seed: 3}
params: {omega: 0.25}
blocks:
  go: {type: Constant, value: [1.0, 0.5], signal: Twist}
  limit: {type: Saturator, omega_max: $omega}
  plant: {type: DifferentialDrive}
  noise: {type: PoseNoise}
wires:
  limit: {command: go.value}
  plant: {command: limit.limited}
  noise: {pose: plant.pose}
probes: {pose: plant.pose, seen: noise.measured}
plots:
  way: {kind: trajectory, of: [pose], title: The way </svg><script>x</script>}
  seen: {kind: timeseries, of: [seen]}
  table: {kind: heatmap, of: [seen]}
metrics:
  turned: {kind: final, of: plant.pose.theta, below: 0.1, above: $omega}
  far: {kind: path_length, of: pose, below: 100}
  settled: {kind: settling_time, of: plant.pose.x, band: 0.1}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("reports")
    (root / "small.yaml").write_text(GRAPH)
    return runtime.load(root / "small.yaml").bypass("limit").run().save(root / "run")


@pytest.fixture(scope="module")
def page(run: Path) -> Path:
    path = run.parent / "report.html"
    path.write_text(report(run).html, encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_browser_loads_it_without_messages(page: Path) -> None:
    loaded = load(page)
    assert loaded.console == []
    (script,) = find(loaded.html, "script")
    assert script.text == zoom.script()
    titles = [e.text for e in find(loaded.html, "h2")]
    assert titles == [
        *("Metrics", "Figures", "Diagram", "Recorded signals", "Graph", "Provenance"),
    ]
    (title,) = find(loaded.html, "h1")
    assert title.text == "small <b>&amp; robust_</b><script>alert(1)</script>"
    metrics = rows(loaded.html, "metrics")
    assert [row[0] for row in metrics] == ["turned", "far", "settled"]
    assert metrics[0][1:] == [
        *("0.995 rad", "above 0.25 and below 0.1: failed", "final of plant.pose.theta"),
    ]
    assert metrics[1][2] == "below 100: met"
    assert metrics[2][1:] == ["never settled", "", "settling_time of plant.pose.x, band 0.1"]
    assert [row[0] for row in rows(loaded.html, "recorded signals")] == [
        *("pose", "seen", "plant.pose.theta", "plant.pose.x"),
    ]
    source = next(e for e in find(loaded.html, "code") if e.inside("pre"))
    resolved = (page.parent / "run" / "graph.resolved.yaml").read_text()
    assert source.text == resolved.rstrip()
    versions = dict(rows(loaded.html, "versions"))  # type: ignore[arg-type]
    assert versions["numpy"] == np.__version__


@pytest.mark.slow
def test_a_browser_reports_errors_of_a_page(tmp_path: Path) -> None:
    page = tmp_path / "wrong.html"
    page.write_text(
        '<p style="width: 900px">x</p><script>console.error("broken")</script>', encoding="utf-8"
    )
    assert any("broken" in line for line in load(page).console)
    found = measure(page, 360)
    assert found["width"] >= 900
    assert found["wide"][0].startswith("<p ")


def test_charts_have_the_values_of_the_run(page: Path, run: Path) -> None:
    (box,) = find(page.read_text(encoding="utf-8"), "details", class_="zoom")
    result = runtime.open(run)
    metres, radians = json.loads(box.attributes["data-charts"])
    assert [metres["unit"], radians["unit"]] == ["[m]", "[rad]"]
    t, x, y = (np.array(column) for column in metres["data"])
    np.testing.assert_allclose(t, result.time("seen"), rtol=1e-5)
    np.testing.assert_allclose(np.column_stack([x, y]), result["seen"][:, :2], rtol=1e-5)


@pytest.mark.slow
def test_a_browser_draws_the_charts(page: Path) -> None:
    opened = page.with_name("opened.html")
    html = page.read_text(encoding="utf-8").replace("<details ", "<details open ")
    opened.write_text(html, encoding="utf-8")
    loaded = load(opened)
    assert loaded.console == []
    assert len(find(loaded.html, "canvas")) == 2
    labels = {e.text for e in find(loaded.html, "div", class_="u-label")}
    assert {"x", "y"} <= labels


@pytest.mark.slow
def test_it_fits_a_phone_and_a_desk(page: Path) -> None:
    for width in (360, 1400):
        found = measure(page, width)
        assert found["width"] <= width
        assert found["wide"] == []


def test_nothing_is_loaded_from_elsewhere(page: Path) -> None:
    html = page.read_text(encoding="utf-8")
    for item in elements(html):
        for key, value in item.attributes.items():
            if key in ("src", "href", "xlink:href"):
                assert value.startswith(("#", "data:")), (item.tag, key, value)
            assert "url(" not in value or "url(#" in value
    assert "@import" not in html
    (policy,) = find(html, "meta", http_equiv="Content-Security-Policy")
    digest = base64.b64encode(hashlib.sha256(zoom.script().encode()).digest()).decode()
    assert policy.attributes["content"].startswith("default-src 'none'")
    assert policy.attributes["content"].endswith(f"; script-src 'sha256-{digest}'")


def test_ids_are_unique_and_links_have_targets(page: Path) -> None:
    every = elements(page.read_text(encoding="utf-8"))
    ids = [e.attributes["id"] for e in every if "id" in e.attributes]
    assert len(ids) == len(set(ids))
    for item in every:
        for key, value in item.attributes.items():
            wanted = re.findall(r"url\(#([^)]+)\)", value)
            if key in ("href", "xlink:href") and value.startswith("#"):
                wanted.append(value[1:])
            assert set(wanted) <= set(ids)


def _curves(svg: list[Element]) -> list[FloatArray]:
    """The points of each line that is clipped to its axes, grids left out."""
    found = []
    for item in svg:
        if item.tag == "path" and "clip-path" in item.attributes:
            points = np.array(re.findall(r"[ML] (\S+) (\S+)", item.attributes["d"]), dtype=float)
            if len(points) > 2:
                found.append(points)
    return found


def test_figures_show_the_data(run: Path, page: Path) -> None:
    result = runtime.open(run)
    loaded = load(page)
    every = elements(loaded.html)
    way = [e for e in every if e.inside("figure", id="figure-1")]
    x, y = result["pose"][:, :2].T
    drawn = max(_curves(way), key=len).T
    # One scale for both axes, y downwards, and no point far from the trajectory.
    scale = np.ptp(drawn[0]) / np.ptp(x)
    expected = np.stack([drawn[0][0] + scale * (x - x[0]), drawn[1][0] - scale * (y - y[0])])
    apart = np.hypot(*(drawn[:, :, None] - expected[:, None, :])).min(axis=1)
    assert apart.max() < 0.5
    seen = [e for e in every if e.inside("figure", id="figure-2")]
    t, columns = result.time("seen"), result["seen"].T
    curves = [points.T for points in _curves(seen)]
    assert len(curves) == 3
    for (left, top), values in zip(curves, columns, strict=True):
        ends = np.append(t, t[-1] + t[1] - t[0])  # the last value is held for a period as well
        at = t[0] + (left - left[0]) * np.ptp(ends) / np.ptp(left)
        # A sampled signal is held: each corner is at a sample, at the value before or after it.
        sample = np.abs(at[:, None] - ends).argmin(axis=1)
        assert np.abs(at - ends[sample]).max() < 0.02 * (t[1] - t[0])
        last = len(values) - 1
        held = np.stack([values[np.maximum(sample - 1, 0)], values[np.minimum(sample, last)]])
        expected = top.max() - (held - values.min()) * np.ptp(top) / np.ptp(values)
        assert np.abs(expected - top).min(axis=0).max() < 0.02 * np.ptp(top)
    heat = [e for e in every if e.tag == "image" and e.inside("figure", id="figure-3")]
    # The map itself, and its colour bar.
    assert len(heat) == 2
    assert all(e.attributes["xlink:href"].startswith("data:image/png;base64,") for e in heat)


def test_the_diagram_shows_every_block(page: Path) -> None:
    shown = [e for e in elements(page.read_text()) if e.inside("section", id="diagram")]
    names = {
        e.attributes["data-name"] for e in shown if "block" in e.attributes.get("data-kind", "")
    }
    assert names == {"go", "limit", "plant", "noise"}
    (removed,) = [e for e in shown if e.attributes.get("data-kind") == "removed block"]
    assert removed.attributes["data-name"] == "limit"


@pytest.mark.slow
def test_the_same_run_gives_the_same_bytes(run: Path) -> None:
    code = "import sys; from runtime.reports import report\n"
    code += "sys.stdout.buffer.write(report(sys.argv[1]).html.encode())"
    command = [sys.executable, "-c", code, str(run)]
    # Each in its own process, since matplotlib's text sizes depend on earlier drawings.
    pages = {
        subprocess.run(
            command,
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("7", "8")
    }
    assert len(pages) == 1


def test_many_marks_are_an_image() -> None:
    from matplotlib.figure import Figure

    def drawn(count: int) -> str:
        figure = Figure()
        figure.subplots().plot(np.arange(count), np.arange(count), linestyle="none", marker="|")
        return figure_svg(figure, "x", "marks")

    assert drawn(500).count("<use") > 500
    dense = drawn(5000)
    assert "data:image/png" in dense
    assert len(dense) < len(drawn(500))


BREAKING = """
import blocks


class Breaking(blocks.Block):
    '''Put out what is no number at half a second.'''

    out = blocks.Output(blocks.Scalar)

    def output(self, state, t):
        return 1.0 if t < 0.5 else float("nan")
"""


@pytest.fixture
def broken(tmp_path: Path) -> Path:
    """The folder of a run that failed."""
    (tmp_path / "own.py").write_text(BREAKING)
    graph = runtime.load(
        {
            "graph": "breaking",
            "run": {"dt": 0.1, "until": 1.0},
            "blocks": {"x": {"type": "Breaking", "module": str(tmp_path / "own.py")}},
            "probes": {"x": "x.out"},
            "metrics": {"end": {"kind": "final", "of": "x", "below": 0.0}},
        }
    )
    with pytest.raises(runtime.SimulationError) as raised:
        graph.run()
    assert isinstance(raised.value.result, runtime.Result)
    return raised.value.result.save(tmp_path / "run")


def test_a_failed_run_is_marked(broken: Path) -> None:
    html = report(broken).html
    (failed,) = find(html, "ul", class_="notes failed")
    assert "block 'x' at tick 5" in failed.text
    assert "metric 'end': expected below 0" in failed.text
    assert [e.text for e in find(html, "span", class_="bad")] == ["failed", "failed"]


def test_a_report_needs_no_module_and_notes_that_it_is_missing(broken: Path) -> None:
    (broken / "own.py").unlink()
    html = report(broken).html
    shown = [e for e in elements(html) if e.attributes.get("data-kind") == "block"]
    assert [e.attributes["data-name"] for e in shown] == ["x"]
    assert "'own.py' was removed after the run was saved" in html.replace("&#x27;", "'")
    assert rows(html, "metrics")[0][0] == "end"


def test_through_the_console_script(cli: Run, broken: Path, tmp_path: Path) -> None:
    done = cli("report", "run/manifest.json", "-o", "r.html", "--json")
    assert done.returncode == 0, done.stderr
    message = json.loads(done.stdout)
    assert (message["kind"], message["report"]) == ("run", "r.html")
    assert (tmp_path / "r.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert cli("report", "run").stdout == "run/report.html\n"
    assert (broken / "report.html").is_file()
    both = cli("report", "run", "-o", "-", "--json")
    assert (both.returncode, both.stdout) == (2, "")
    assert "leave one out" in both.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_report_that_cannot_be_written_is_an_error(
    cli: Run, broken: Path, tmp_path: Path
) -> None:
    done = cli("report", "run", "-o", "/dev/full")
    assert done.returncode == 2
    assert done.stderr == "cannot write '/dev/full': No space left on device\n"
    assert stat.S_ISCHR(Path("/dev/full").stat().st_mode)
    (tmp_path / "there.html").mkdir()
    assert "Is a directory" in cli("report", "run", "-o", "there.html").stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "there is no 'nowhere'; expected"),
        (["run", "-o", "no/such/r.html"], "cannot write 'no/such/r.html': No such file"),
    ],
)
def test_errors_end_with_2_and_one_line(
    cli: Run, broken: Path, arguments: list[str], message: str
) -> None:
    done = cli("report", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
