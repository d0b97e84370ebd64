"""Hover cards and signatures."""

from __future__ import annotations

import pytest

from runtime.language import Model, Surroundings, hover, signature
from tests.runtime.language.texts import GRAPHS, edited


def card(old: str, new: str) -> str:
    model, offset = edited(old, new)
    found = hover(model, offset)
    return "" if found is None else found.markdown


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        (
            "  lqr: {type",
            "  l¦qr: {type",
            ["## LQR", "─▶ [ LQR ] ─▶ command", "`q`", "TrackingState"],
        ),
        ("type: LQR", "type: LQ¦R", ["## LQR"]),
        ("omega_max: 1.5", "omega¦_max: 1.5", ["largest turn rate", "above 0 rad/s"]),
        ("v_r: $v_r, dt", "v_r: $v¦_r, dt", ["**$v_r** = `0.2`"]),
        (
            "lqr: {error: error.state",
            "lqr: {error: error.st¦ate",
            ["TrackingState, 20 Hz, x m, y m", "wall_following.yaml:18", "error: {type: Tracking"],
        ),
        ("lqr: {error: err", "lqr: {er¦ror: err", ["**lqr.error**: TrackingState"]),
        (
            "  adaptive:\n",
            "  adap¦tive:\n",
            ["A part", "`speed_input`", "`command` | Twist", "`leak`"],
        ),
        ("kind: map", "kind: m¦ap", ["the world, the trajectory"]),
        ("    distance: $d", "    dist¦ance: $d", ["a number above 0 m"]),
        ("until: 130", "un¦til: 130", ["length of the run"]),
        ("of: [pose,", "of: [po¦se,", ["a probe of {of: plant.pose, every: 50}"]),
        ("adaptive_snn.yaml", "adaptive_s¦nn.yaml", ["parts/adaptive_snn.yaml"]),
    ],
)
def test_cards(old: str, new: str, parts: list[str]) -> None:
    text = card(old, new)
    for part in parts:
        assert part in text


def test_nothing_to_say() -> None:
    assert card("# A robot", "# A ro¦bot") == ""
    assert card("until: 130", "until: 1¦30") == ""


def test_a_list_in_place_of_sections() -> None:
    model = Model("[blocks, wires]\n", GRAPHS / "list.yaml", Surroundings())
    assert all(hover(model, offset) is None for offset in range(16))


def test_inside_a_structured_parameter() -> None:
    old = "blocks:\n"
    new = "blocks:\n  e: {type: Ensemble, neuron: {type: LIF, tau_¦rc: 0.02}}\n"
    assert "membrane" in card(old, new)
    assert "a number above 0 s, default 0.02" in card(old, new)


def test_inside_a_part() -> None:
    model, offset = edited("leak: $leak", "leak: $le¦ak", GRAPHS / "parts" / "adaptive_snn.yaml")
    found = hover(model, offset)
    assert found is not None
    assert found.markdown == "**$leak** = `0.0`"


def test_signatures() -> None:
    model, offset = edited("lqr: {error: error", "lqr: {error: ¦error")
    found = signature(model, offset)
    assert found is not None
    assert found.label == "lqr(error: TrackingState, reference: Pose)"
    assert found.active == 0
    model, offset = edited("speed_error: error", "speed_error: ¦error")
    found = signature(model, offset)
    assert found is not None
    assert found.label.startswith("adaptive(speed_input: Scalar, speed_error: Scalar")
    assert found.active == 1
    model, offset = edited("type: Saturator, omega_max: 1.5", "type: Saturator, omega_max: ¦1.5")
    found = signature(model, offset)
    assert found is not None
    assert found.label == "Saturator(omega_max)"
