"""Pages that simulate: in a real browser, equal to a run, with sliders that change the curves."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.errors import UsageError
from spikeblocks.page import export_page
from spikeblocks.page.shown import plain
from tests.browser import FLAGS, Driven, browser, find
from tests.runtime.export.test_targets import FEATURES, graph_of

needs_ziglang = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs the extra compiler")
# Waits until the first run has ended, moves a slider as a hand does, and waits for the second.
DRIVE = """<!doctype html><meta charset="utf-8"><title>driving</title>
<iframe src="{page}" style="width: 900px; height: 900px"></iframe><pre></pre>
<script>
const frame = document.querySelector("iframe");
const over = (of) => of.eval("core && isOver() && !page.running");
async function done(of) {{
  do await new Promise((go) => setTimeout(go, 200)); while (!over(of));
}}
frame.addEventListener("load", async () => {{
  const of = frame.contentWindow, said = {{}};
  await done(of);
  said.first = of.eval("page.columns");
  const slider = of.document.querySelector("#slider-0");
  const box = slider.getBoundingClientRect();
  said.wide = box.width;
  slider.value = slider.max;
  slider.dispatchEvent(new of.Event("input", {{bubbles: true}}));
  await done(of);
  said.second = of.eval("page.columns");
  said.ghost = of.eval("page.ghost");
  said.text = slider.previousElementSibling.textContent;
  of.document.querySelector("#defaults").click();
  await done(of);
  said.third = of.eval("page.columns");
  of.document.querySelector("#play").click();
  said.label = of.eval("page.dirty = true, draw(), byId('play').textContent");
  document.querySelector("pre").textContent = JSON.stringify(said);
}});
</script>
"""

# Steps the module of a page as its script does, and writes the rows.
NODE = """
const fs = require("fs"), zlib = require("zlib");
const text = fs.readFileSync(process.argv[1], "utf8");
const DATA = JSON.parse(text.split("const DATA = ")[1].split(";\\nconst MODULE")[0]);
const packed = text.split("const MODULE = \\"")[1].split("\\"")[0];
const modules = new Proxy({}, {get: () => new Proxy({}, {get: () => () => 0})});
const bytes = zlib.gunzipSync(Buffer.from(packed, "base64"));
WebAssembly.instantiate(bytes, modules).then((made) => {
  const core = made.instance.exports, rows = [], width = DATA.columns.length;
  if (core._initialize) core._initialize();
  core.init();
  while (core.tick() < DATA.ticks && !core.failure()) {
    const count = core.advance(Math.min(64, DATA.ticks - core.tick()), 1);
    const found = new Float64Array(core.memory.buffer, core.rows(), count * width);
    for (let i = 0; i < count; i++) rows.push(Array.from(found.slice(i * width, (i + 1) * width)));
  }
  const failure = core.failure() !== DATA.stopped && core.failure();
  console.log(JSON.stringify({rows, failure}));
});
"""


def driven(page: Path) -> dict[str, Any]:
    """What a page computes, before and after its first slider is moved to its end."""
    # Its policy allows its own scripts and the module, and no eval, which this test uses.
    text = page.read_text(encoding="utf-8")
    assert text.count(" 'wasm-unsafe-eval'\">") == 1
    page = page.with_name("driven.html")
    page.write_text(text.replace("'wasm-unsafe-eval'", "'unsafe-eval'", 1), encoding="utf-8")
    outer = page.with_name("outer.html")
    outer.write_text(DRIVE.format(page=page.as_uri()), encoding="utf-8")
    with tempfile.TemporaryDirectory() as profile:
        options = (*FLAGS, "--virtual-time-budget=400000", f"--user-data-dir={profile}")
        command = [browser(), *options, "--dump-dom", outer.as_uri()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    assert not [line for line in done.stderr.splitlines() if "CONSOLE" in line and "rror" in line]
    found: dict[str, Any] = json.loads(find(done.stdout, "pre")[0].text)
    return found


def columns(page: Path) -> list[str]:
    """The names of a page's columns."""
    text = page.read_text().split("const DATA = ")[1].split(";\nconst MODULE")[0]
    names: list[str] = json.loads(text)["columns"]
    return names


@pytest.mark.slow
@needs_ziglang
def test_a_page_computes_what_a_run_does(tmp_path: Path) -> None:
    graph = runtime.load("gallery/van_der_pol")
    made = export_page(graph, tmp_path, slider=["force.constants.damping=0..2"])
    said = driven(tmp_path / made.files[0])
    for key, changed in (
        ("first", graph),
        ("second", graph.set("blocks.force.constants.damping", 2.0)),
        ("third", graph),
    ):
        expected = changed.run(engine="compiled")
        t, position, velocity = map(np.array, said[key])
        assert np.array_equal(t, expected.probes["position"].t)
        assert np.array_equal(position, expected["position"])
        assert np.array_equal(velocity, expected["velocity"])
    assert said["ghost"] == said["first"]
    assert said["text"] == "2" and said["wide"] > 100 and said["label"] == "Pause"


@pytest.mark.slow
@needs_ziglang
def test_numbers_that_follow_from_a_slider_are_those_of_the_changed_graph(tmp_path: Path) -> None:
    graph = runtime.load("gallery/noise_filter").set("run.until", 2.0)
    made = export_page(graph, tmp_path, slider=["lowpass.tau=0.01..0.5"])
    said = driven(tmp_path / made.files[0])
    for key, tau in (("first", None), ("second", 0.5)):
        changed = graph if tau is None else graph.set("blocks.lowpass.tau", tau)
        result = changed.run(engine="compiled")
        names = columns(tmp_path / made.files[0])
        column = np.array(said[key][names.index("lowpass.out[0]")])
        probe = next(p for p in result.probes.values() if "lowpass.out" in p.addresses)
        rows = result.probes[probe.name].column("lowpass.out")
        np.testing.assert_allclose(column[: len(rows)], rows.ravel()[: len(column)], rtol=1e-12)


@pytest.mark.slow
@needs_ziglang
def test_titles_and_labels_are_data(tmp_path: Path) -> None:
    hostile = "<!--<script>@script@@policy@</script>"
    graph = runtime.load(
        {
            "graph": hostile,
            "run": {"dt": 0.01, "until": 0.3},
            "blocks": {"c": {"type": "Sine", "amplitude": 1.0, "frequency": 2.0}},
            "probes": {"e": {"of": ["c.out"], "label": [hostile]}},
            "plots": {"p": {"kind": "timeseries", "of": "e", "title": hostile}},
        }
    )
    page = tmp_path / export_page(graph, tmp_path).files[0]
    text = page.read_text(encoding="utf-8")
    assert text.count("<script>") == text.count("</script>") == 3 and "<!--" not in text
    policy = text.split('Content-Security-Policy" content="')[1].split('"')[0]
    for script in re.findall("<script>(.*?)</script>", text, re.DOTALL):
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in policy
    assert "unsafe-inline" not in policy.split("script-src")[1]
    data = json.loads(text.split("const DATA = ")[1].split(";\nconst MODULE")[0])
    assert data["title"] == hostile
    assert driven(page)["first"][0][0] == 0.0


@pytest.mark.parametrize(
    ("slider", "said"),
    [
        ("force=0", "expected NAME=LOW..HIGH such as gain.gain=0..2, got 'force=0'"),
        ("force.gain=2..1", "expected NAME=LOW..HIGH"),
        ("positon.initial=0..1", "did you mean 'position.initial'?"),
        ("position.initial=0..2", "which a step does not take from its parameters"),
        ("force.names=0..2", "is not a number"),
    ],
)
def test_a_slider_that_cannot_be_says_why(slider: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as error:
        export_page(runtime.load("gallery/van_der_pol"), tmp_path / "out", slider=[slider])
    assert said in str(error.value) and not (tmp_path / "out").exists()


def test_labels_lose_the_marks_of_formulas() -> None:
    assert plain(r"$e_\theta$") == "e_θ"
    assert plain("speed") == "speed"


@pytest.mark.slow
@needs_ziglang
def test_a_slider_of_an_input_is_what_a_session_writes(tmp_path: Path) -> None:
    graph = runtime.load("gallery/cart_pole_balance").set("run.until", 2.0)
    made = export_page(graph, tmp_path, slider=["force=-1..1"])
    said = driven(tmp_path / made.files[0])
    for key, force in (("first", 0.0), ("second", 1.0)):
        session = graph.session()
        session.write("force", force)
        session.run(2.0)
        angle = session.result().probes["angle"].values.ravel()
        names = columns(tmp_path / made.files[0])
        found = np.array(said[key][names.index("cart.angle[0]")])
        np.testing.assert_allclose(found, angle[: len(found)], rtol=1e-12, atol=1e-15)


@pytest.mark.slow
@needs_ziglang
def test_dragging_a_slider_changes_the_curve_to_that_of_a_run(tmp_path: Path) -> None:
    graph = runtime.load("gallery/van_der_pol")
    made = export_page(graph, tmp_path, slider=["force.constants.damping=0..2"])
    page = Driven(tmp_path / made.files[0], 1000, 900)
    over = "new Promise((go) => { const look = () => typeof core === 'object' && isOver() && "
    over += "!page.running ? go(true) : setTimeout(look, 50); look(); })"
    try:
        assert page.value(over) is True
        first = page.value("page.columns")
        edges = "(({left, right, top, bottom}) => [left, right, (top + bottom) / 2])"
        left, right, y = page.value(
            f"{edges}(document.querySelector('#slider-0').getBoundingClientRect())"
        )
        middle = 0.5 * (left + right)
        page.drag([(middle + (right - middle) * i / 8, y) for i in range(9)])
        assert page.value(over) is True
        damping = page.value("DATA.sliders[0].value")
        assert damping > 1.9
        second, ghost = page.value("page.columns"), page.value("page.ghost")
    finally:
        page.close()
    expected = graph.set("blocks.force.constants.damping", damping).run(engine="compiled")
    assert second[1] == expected["position"].tolist() != first[1]
    assert len(ghost[0]) == len(first[0])


@pytest.mark.parametrize(
    ("slider", "said"),
    [
        ("force=-20..1", "'force': expected at least -10 N, got -20"),
        ("force[0]=-1..1", "'force[0]' is no number of the input; expected force"),
    ],
)
def test_a_slider_of_an_input_stays_in_its_bounds(slider: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as error:
        export_page(runtime.load("gallery/cart_pole_balance"), tmp_path / "out", slider=[slider])
    assert said in str(error.value)


@needs_ziglang
@pytest.mark.slow
@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
@pytest.mark.parametrize("feature", FEATURES)
def test_a_feature_is_exported(feature: str, tmp_path: Path) -> None:
    graph = graph_of(feature, tmp_path)
    made = export_page(graph, tmp_path / "made")
    command = ["node", "-e", NODE, str(tmp_path / "made" / made.files[0])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    said: dict[str, Any] = json.loads(done.stdout)
    assert not said["failure"]
    rows, result = np.array(said["rows"]), graph.run(engine="compiled")
    own = {round(t / graph.network.dt): row for t, row in zip(rows[:, 0], rows[:, 1:], strict=True)}
    for t, row in zip(result.time("y"), result["y"], strict=True):
        if (k := round(t / graph.network.dt)) in own:
            np.testing.assert_allclose(own[k], np.ravel(row), rtol=1e-9, atol=1e-12)
