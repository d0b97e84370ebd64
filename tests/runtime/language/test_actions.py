"""Code actions: each suggestion that a message makes, applied, removes the problem."""

from __future__ import annotations

from pathlib import Path

import pytest

from runtime.language import Action, Model, Span, actions, apply_edits, diagnose
from tests.runtime.language.texts import CASE_C, SURROUNDINGS, edited

SMALL = """graph: small
blocks:
  a: {type: Constant, value: 1.0}
  b: {type: Gain, gain: 2.0}
  c: {type: Sum}
wires:
  b: {input: a.value}
  c: {terms: [b.out]}
"""


def done(model: Model, action: Action) -> Model:
    text = apply_edits(model.text.source, [(edit.span, edit.new) for edit in action.edits])
    return Model(text, model.path, model.surroundings)


def fixes(model: Model) -> list[Action]:
    found = diagnose(model)[0]
    return [action for action in actions(model, found.span) if action.fixes is not None]


@pytest.mark.parametrize(
    ("old", "new", "title"),
    [
        ("q: [10", "Q: [10", "Replace by 'q'"),
        ("type: LQR,", "type: LQRR,", "Replace by 'LQR'"),
        ("error: {pose: plant.pose", "error: {pose: plant.pos", "Replace by 'pose'"),
        ("error: {pose: plant.pose", "error: {pose: plnt.pose", "Replace by 'plant'"),
        ("lqr: {error: error.state", "lqr: {eror: error.state", "Replace by 'error'"),
        ("  lqr: {error: error.state, reference: match.reference}", "", "Wire 'lqr.error' to"),
        ("lqr: {error: error.state, ", "lqr: {", "Wire 'lqr.error' to error.state"),
        ("kind: map", "kind: mop", "Replace by 'map'"),
        ("seed: 0", "sed: 0", "Replace by 'seed'"),
        ("metrics:", "metrisc:", "Replace by 'metrics'"),
        ("$v_r, dt: 0.05}\n  fitter", "$v_rr, dt: 0.05}\n  fitter", "Replace by 'v_r'"),
        ("title: Scan and fitted", "title: Scan: and fitted", "Put quotes around it"),
        ("  limit: {type", "  limit:{type", ""),
        ("radius: 1.0", "radius:1.0", ""),
        ("beams: 360, sigma: 0.01, dt: 0.1", "beams: 360, dt: 0.1001", "Replace by 0.1"),
        ("params: {v_r: 0.2, ", "params: {v_r: 0.2, unused: 3, ", "Remove 'unused'"),
        ("x0: [0, 0, 0]", "x0: [0, 0, 90]", "Write 90deg"),
        ("worlds/paper_room", "worlds/paper_rom", "Replace by"),
    ],
)
def test_an_action_removes_the_problem(old: str, new: str, title: str) -> None:
    model, _ = edited(old, new)
    found = fixes(model)
    if not title:
        assert diagnose(model)
        return
    chosen = next(action for action in found if action.title.startswith(title))
    before, after = diagnose(model), diagnose(done(model, chosen))
    wrong = {each.message for each in after}
    assert before[0].message not in wrong
    assert len(after) < len(before) or not after


def test_a_loop_is_broken_by_a_delay(tmp_path: Path) -> None:
    text = SMALL.replace("terms: [b.out]", "terms: [b.out, c.out, a.value]")
    model = Model(text, tmp_path / "loop.yaml", SURROUNDINGS)
    [action] = fixes(model)
    assert action.title == "Put a UnitDelay between c.out and c.terms[1]"
    after = done(model, action)
    assert diagnose(after) == []
    assert "c_delay: {type: UnitDelay}" in after.text.source
    assert "terms: [b.out, c_delay.out, a.value]" in after.text.source


def test_every_wire_of_a_loop_is_offered() -> None:
    model, _ = edited("search: {input: explore.command}", "search: {input: sighted.out}")
    titles = [action.title for action in fixes(model)]
    assert len(titles) == 2
    for action in fixes(model):
        assert diagnose(done(model, action)) == []


def test_wires_of_a_block_that_is_gone_are_deleted(tmp_path: Path) -> None:
    text = SMALL.replace("  b: {type: Gain, gain: 2.0}\n", "").replace("[b.out]", "[a.value]")
    model = Model(text, tmp_path / "gone.yaml", SURROUNDINGS)
    [action] = [action for action in fixes(model) if action.title.startswith("Delete")]
    assert diagnose(done(model, action)) == []


def test_a_block_that_something_needs_is_bypassed_instead() -> None:
    model, _ = edited("probes:", "without: [limit]\nprobes:")
    action = next(a for a in fixes(model) if a.title == "Bypass 'limit' instead")
    after = done(model, action)
    assert "bypass: [limit]" in after.text.source
    assert [each for each in diagnose(after) if each.severity == "error"] == []


@pytest.mark.parametrize(
    "written", ["", "without: [lidar]\n", "without: lidar\n", "without:\n- c\n"]
)
def test_a_block_is_left_out(written: str) -> None:
    text = CASE_C.read_text(encoding="utf-8").replace("probes:\n", f"{written}probes:\n")
    model = Model(text, CASE_C, SURROUNDINGS)
    offset = text.index("  adaptive:\n") + 3
    found = [a for a in actions(model, Span(offset, offset)) if a.fixes is None]
    assert [a.title for a in found] == ["Leave out 'adaptive' (without)"]
    after = done(model, found[0])
    names = after.tree.get("without")
    assert names is not None
    assert "adaptive" in str(names.plain())
