"""A plant that nobody commands is noted, and its open inputs are drawn."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import pytest

import runtime
from runtime.diagrams import diagram
from runtime.diagrams.picture import picture_of
from runtime.diagrams.stored import read_picture, stored_picture
from tests.conftest import Run

SVG = "{http://www.w3.org/2000/svg}"
LOOP: dict[str, Any] = {
    "graph": "forgotten",
    "run": {"dt": 0.01, "until": 0.1},
    "blocks": {
        "pole": {"type": "Pendulum", "angle0": 0.3},
        "pid": {"type": "PID", "kp": 5.0},
        "error": {"type": "Sum", "signs": [-1]},
    },
    "wires": {"error": {"terms": ["pole.angle"]}, "pid": {"error": "error.out"}},
    "probes": {"angle": "pole.angle"},
}
NOTE = "blocks.pole: nothing is wired to it: torque is 0 N m throughout"


def notes(**changes: Any) -> list[str]:
    return list(runtime.load({**LOOP, **changes}).network.notes)


def test_a_plant_without_a_wire_is_noted() -> None:
    assert notes() == [NOTE]
    wired = {**LOOP["wires"], "pole": {"torque": "pid.out"}}
    assert notes(wires=wired) == []
    # Its controller was removed, and with it the only wire.
    assert NOTE in notes(wires=wired, without=["pid"])


def test_validate_and_run_show_the_note(cli: Run, tmp_path: Any) -> None:
    (tmp_path / "g.yaml").write_text(runtime.load(LOOP).to_yaml())
    assert f"note: {NOTE}" in cli("validate", "g.yaml").stderr
    assert f"note: {NOTE}" in cli("run", "g.yaml", "--no-plots").stderr


def test_open_inputs_with_a_default_are_drawn() -> None:
    network = runtime.load(LOOP).network
    boxes = picture_of(network).boxes
    assert (boxes["pole"].open, boxes["pole"].inputs) == (["torque"], ["torque"])
    assert (boxes["pid"].open, boxes["pid"].inputs) == (["reset"], ["error", "reset"])
    assert boxes["error"].open == []
    root = ET.fromstring(str(diagram(network, "svg")))
    for name, ports in (("pole", ["torque"]), ("pid", ["reset"])):
        (group,) = root.findall(f".//{SVG}g[@data-name='{name}'][@data-kind='block']")
        texts = [t.text for t in group.iter(f"{SVG}text")]
        assert set(ports) <= set(texts)
        circles = [r for r in group.iter(f"{SVG}rect") if r.get("width") == "6"]
        assert len(circles) == len(ports)
    kept = read_picture(stored_picture(network) or "")
    assert kept.boxes["pid"].open == ["reset"]


@pytest.mark.parametrize("format", ["dot", "mermaid"])
def test_texts_are_still_drawn(format: str) -> None:
    assert "pole" in str(diagram(runtime.load(LOOP).network, format))
