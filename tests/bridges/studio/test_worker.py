"""The worker: what is done by hand replays bit for bit, back and forth, and after a kill."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.graph import open_session
from spikeblocks.studio import worker as module
from tests.bridges.studio.frames import GRAPHS, Local

SMALL = """graph: small
run: {dt: 0.01, until: 5.0, seed: 3}
blocks:
  u: {type: Sine, amplitude: 1.0}
  n: {type: WhiteNoise, density: 0.1}
  g: {type: Gain, gain: 2.0}
  s: {type: Sum}
  x: {type: Integrator}
wires:
  g: {input: u.out}
  s: {terms: [g.out, n.out]}
  x: {input: s.out}
probes: {x: x.out, s: s.out}
plots: {all: {kind: timeseries, of: [x, s]}}
"""


def small() -> Local:
    return Local(text=SMALL).begin()


def recorded(local: Local) -> dict[str, Any]:
    assert local.session is not None
    return {name: rows for name, (_, rows) in local.session.rows(0).items()}


def equal(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(np.array_equal(one[name], other[name]) for name in one)


def test_a_page_has_what_was_recorded() -> None:
    local = small()
    for ticks in (1, 30, 100):
        local.on_step(ticks)
    local.read()
    assert local.page.head["tick"] == 131
    for name, rows in recorded(local).items():
        assert np.array_equal(local.page.rows[name][:, 0], rows.astype("<f4"))
    assert local.page.all("views")[0]["plots"][0]["kind"] == "time"


def test_going_back_and_on_has_the_bits_of_an_uninterrupted_run() -> None:
    local = small()
    local.on_step(400)
    end = recorded(local)
    for tick in (399, 210, 7, 0):
        local.on_goto(tick)
        assert local.session is not None and local.session.tick == tick
        local.on_step(400 - tick)
        assert equal(recorded(local), end)
    local.read()
    assert np.array_equal(local.page.rows["x"][:, 0], end["x"].astype("<f4"))


def test_going_back_keeps_the_changes_before_and_drops_those_after() -> None:
    local, other = small(), small()
    local.on_step(100)
    local.on_set("blocks.g.gain", 3.0)
    local.on_step(101)
    local.on_set("blocks.g.gain", 9.0)
    local.on_step(100)
    local.on_goto(150)
    other.on_step(100)
    other.on_set("blocks.g.gain", 3.0)
    other.on_step(50)
    assert equal(recorded(local), recorded(other))
    local.on_step(100)
    other.on_step(100)
    assert equal(recorded(local), recorded(other))
    assert local.session is not None and len(local.session.log) == 1


def test_the_text_is_followed_while_it_runs() -> None:
    local = small()
    local.on_step(100)
    local.edit(SMALL.replace("gain: 2.0", "gain: 4.0"))
    became = local.page.all("became")[-1]
    assert became["numbers"] == ["blocks.g.gain"] and local.page.head["tick"] == 100
    added = SMALL.replace("wires:", "  y: {type: Gain, gain: 1.0}\nwires:\n  y: {input: x.out}")
    local.edit(added.replace("{x: x.out", "{y: y.out, x: x.out"))
    assert local.page.all("became")[-1]["begun"] == ["y"]
    assert local.session is not None and local.session.tick == 100
    local.edit("graph: [")
    assert "flow sequence" in local.page.all("refused")[-1]["text"] or local.page.all("refused")
    local.on_step(10)
    assert local.session.tick == 110


def test_what_was_done_is_computed_again(tmp_path: Path) -> None:
    local = small()
    local.on_step(50)
    local.on_set("blocks.n.density", 0.2)
    local.on_step(20)
    local.edit(SMALL.replace("  x: {type: Integrator}", "  x: {type: Integrator, initial: 1.0}"))
    local.on_step(50)
    local.on_save(str(tmp_path / "s"))
    again = open_session(tmp_path / "s")
    assert equal(recorded(local), {n: rows for n, (_, rows) in again.rows(0).items()})


def test_a_new_process_comes_to_the_same_state() -> None:
    local = small()
    local.on_step(60)
    local.on_set("blocks.g.gain", 5.0)
    local.on_step(60)
    log: list[Any] = []
    local.read()
    for each in local.page.all("log"):
        log[each["first"] :] = each["changes"]
    other = Local(text=SMALL).begin(log=tuple(log), tick=120)
    assert other.session is not None and other.session.tick == 120
    assert equal(recorded(local), recorded(other))


def test_a_failure_is_told_and_an_edit_repairs_it() -> None:
    failing = SMALL.replace(
        "{type: Gain, gain: 2.0}", "{type: Function, expression: sqrt(0.5 - t)}"
    )
    failing = failing.replace("g: {input: u.out}", "g: {u: u.out}")
    local = Local(text=failing).begin()
    local.on_step(200)
    local.read()
    assert "g" in local.page.all("failed")[-1]["text"] and local.page.all("state")[-1]["failed"]
    assert local.session is not None
    at = local.session.tick
    local.edit(failing.replace("sqrt(0.5 - t)", "sqrt(abs(0.5 - t))"))
    assert local.session.tick == at and not local.page.all("state")[-1]["failed"]
    local.on_step(10)
    assert local.session.tick == at + 10


def test_snapshots_are_thinned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SNAPSHOTS", 10)
    local = small()
    for _ in range(500):
        local.on_step(1)
    ticks = [each.carried.tick for each in local.snapshots]
    assert len(ticks) <= 11 and ticks[0] == 0 and ticks == sorted(ticks)
    assert max(np.diff(ticks)) <= 2 * local.interval


def test_values_of_a_block_are_shown() -> None:
    local = small()
    local.on_step(10)
    local.on_watch(["x.out", "nothing.here"])
    local.read()
    assert local.session is not None
    assert local.page.head["values"] == {"x.out": [local.session.read("x.out")]}


def test_speed_is_time_of_the_graph_per_time_of_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr("spikeblocks.studio.worker.time.monotonic", lambda: clock[0])
    local = small()
    local.on_play(2.0)
    for _ in range(100):
        clock[0] += 0.01
        while local.session is not None and local._due(local.session) > local.session.tick:
            local.advance()
    assert local.session is not None and local.session.tick == 200
    local.on_play(float("inf"))
    while local.playing:
        local.advance()
    assert local.session.tick == 500
    local.on_play(1.0)
    assert not local.playing


QUICK = ["line_actuator_failure", "gallery/van_der_pol", "starters/adaptive"]


@pytest.mark.parametrize("name", QUICK)
def test_shipped_graphs_are_shown(name: str) -> None:
    shown(name)


NAMES = sorted(
    str(path.relative_to(GRAPHS).with_suffix(""))
    for folder in ("", "gallery", "starters")
    for path in (GRAPHS / folder).glob("**/*.yaml" if folder else "*.yaml")
)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_graph_is_shown(name: str) -> None:
    shown(name)


def shown(name: str) -> None:
    local = Local(name).begin()
    assert local.session is not None
    ticks = min(300, local.session.graph.network.ticks)
    local.on_step(ticks)
    local.on_goto(ticks // 2)
    local.on_step(ticks - ticks // 2)
    local.read()
    assert not local.page.all("failed"), name
    if local.session.stopped:  # by run.stop, where a run of the command line stops, too
        ticks = runtime.load(name).run().manifest["ticks"]
    assert local.page.head["tick"] == ticks
    views = local.page.all("views")[-1]
    assert views["plots"] or views["left_out"]
    for plot in views["plots"]:
        curves = [c for chart in plot.get("charts", []) for c in chart["curves"]]
        curves += [p[axis] for p in plot.get("pairs", []) for axis in ("x", "y")]
        for curve in curves:
            assert curve["column"] < views["streams"][curve["probe"]]["width"]
    end = runtime.load(name).session().step(ticks)
    for stream, kept in local.page.rows.items():
        if views["streams"][stream]["mode"] == "rows":
            rows = end.rows(0)[stream][1].astype("<f4").reshape(-1, kept.shape[1])
            step = round(
                views["streams"][stream]["step"]
                / (end._engine.recorder.probes[stream].every * views["dt"])
            )
            assert np.array_equal(kept, rows[::step][: len(kept)], equal_nan=True)


def test_a_step_of_time_that_changes_is_refused() -> None:
    local = small()
    local.on_step(3)
    local.edit(SMALL.replace("dt: 0.01", "dt: 0.02"))
    assert "run.dt" in local.page.all("refused")[-1]["text"]
