"""Inputs and outputs of a whole graph in an editor."""

from __future__ import annotations

from pathlib import Path

import pytest

from runtime.language import Model, diagnose, hover
from tests.runtime.language.texts import MARK, labels, marked

TEXT = """\
graph: pushed
run: {dt: 0.01, until: 1.0}
inputs:
  push: {type: Scalar, unit: N m, min: -10, max: 10, default: 2.0, doc: a push}
outputs:
  angle: {of: arm.angle, min: -4}
blocks:
  arm: {type: Pendulum}
wires:
  arm: {torque: inputs.push}
probes:
  angle: angle
"""
FILE = Path("pushed.yaml").resolve()


def at(old: str, new: str) -> tuple[Model, int]:
    assert old in TEXT
    return marked(TEXT.replace(old, new), FILE)


def test_a_graph_with_ports_is_no_part() -> None:
    model, _ = at("graph: p", f"graph: {MARK}p")
    assert model.kind == "graph"
    assert not diagnose(model)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("torque: inputs.push", "torque: ¦", {"inputs.push"}),
        ("{type: Scalar, unit", "{¦, unit", {"type", "optional"}),
        ("type: Scalar", "type: ¦", {"Scalar", "Pose"}),
        ("min: -4}", "¦}", {"min", "max", "unit", "doc"}),
        ("of: arm.angle", "of: ¦", {"arm.angle", "arm.rate"}),
        ("probes:\n  angle: angle", "probes:\n  angle: ¦", {"arm.angle"}),
    ],
)
def test_completion(old: str, new: str, expected: set[str]) -> None:
    assert expected <= set(labels(*at(old, new)))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("inputs.push", "inputs.pu¦sh", ["Scalar", "100 Hz", "push: {type: Scalar, unit: N m"]),
        ("min: -10", "m¦in: -10", ["its smallest value"]),
        ("of: arm", "o¦f: arm", ["the address of the signal"]),
        ("angle: angle", "angle: an¦gle", ["Scalar"]),
    ],
)
def test_hover(old: str, new: str, expected: list[str]) -> None:
    card = hover(*at(old, new))
    assert card is not None
    assert all(text in card.markdown for text in expected), card.markdown


def test_mistakes_are_underlined_where_they_are() -> None:
    model, _ = at("default: 2.0", f"default: 20{MARK}")
    (problem,) = diagnose(model)
    assert "expected at most the max, 10.0, got 20.0" in problem.message
