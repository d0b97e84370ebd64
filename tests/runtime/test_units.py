"""Units that do not go together are refused; what may be meant passes."""

from __future__ import annotations

import pytest

import blocks
import runtime
from blocks.units import differ, dimension
from runtime.errors import GraphError


class Meter(blocks.Block):
    """A scalar in metres and one in radians."""

    length = blocks.Output(blocks.Scalar, unit="m")
    angle = blocks.Output(blocks.Scalar, unit="rad")
    rate = blocks.Output(blocks.Scalar, unit="1/s")
    plain = blocks.Output(blocks.Scalar)

    def output(self, state, t):
        return 1.0, 2.0, 3.0, 4.0


@pytest.mark.parametrize(
    ("one", "other", "different"),
    [
        ("m", "rad", True),
        ("m", "m", False),
        ("rad/s", "1/s", False),
        ("Hz", "1/s", False),
        ("N m", "kg m^2/s^2", False),
        ("N m", "N", True),
        ("m/s/s", "m/s^2", False),
        ("m", "km", True),
        ("deg", "rad", True),
        ("", "m", False),
        ("furlongs (UK)", "m", False),
    ],
)
def test_dimensions(one: str, other: str, different: bool) -> None:
    assert differ(one, other) is different
    assert differ(other, one) is different


def test_a_text_that_is_no_unit_has_no_dimension() -> None:
    assert dimension("a (b)") is None
    assert dimension("kg m/s^2") == {("kg", 1), ("m", 1), ("s", -2)}


def graph() -> runtime.Graph:
    made = runtime.Graph(dt=0.1, until=0.2).add("meter", Meter()).add("sum", blocks.Sum())
    return made.connect("meter.length", "sum.terms")


def refused(made: runtime.Graph) -> str:
    with pytest.raises(GraphError) as caught:
        made.check()
    [line] = str(caught.value).splitlines()
    return line


def test_terms_of_different_units_are_refused() -> None:
    assert refused(graph().connect("meter.angle", "sum.terms")) == (
        "set wires.sum.terms: wires.sum.terms[1]: expected m as 'meter.length' has, got rad from "
        "'meter.angle'; where that is meant, a Gain on this wire gives it another unit"
    )


def test_components_of_records_have_units() -> None:
    made = graph().add("plant", blocks.DifferentialDrive()).add("mux", blocks.Mux())
    made.connect("mux.out", "plant.command")
    assert made.connect("plant.pose.x", "sum.terms").check()
    assert "got rad from 'plant.pose.theta'" in refused(
        made.connect("plant.pose.theta", "sum.terms")
    )


def test_generic_blocks_hand_a_unit_on_and_a_gain_frees_it() -> None:
    """A long chain, so that nothing recurses along it."""
    made = graph()
    source = "meter.angle"
    for i in range(1500):
        made.add(f"d{i}", blocks.UnitDelay()).connect(source, f"d{i}.input")
        source = f"d{i}.out"
    assert "expected m as 'meter.length' has, got rad from 'd1499.out'" in refused(
        made.connect(source, "sum.terms")
    )


def test_a_gain_between_makes_it_meant() -> None:
    made = graph().add("arm", blocks.Gain(gain=0.3)).connect("meter.angle", "arm.input")
    assert made.connect("arm.out", "sum.terms").run(until=0.1)


def test_unknown_units_pass() -> None:
    made = graph().connect("meter.plain", "sum.terms")
    assert made.add("c", blocks.Constant(value=1)).connect("c.value", "sum.terms").check()


def test_an_input_that_declares_a_unit() -> None:
    made = graph().add("mux", blocks.Mux()).connect("meter.rate", "mux.omega").check()
    assert refused(made.connect("meter.angle", "mux.v")).startswith(
        "set wires.mux.v: wires.mux.v: expected m/s, got rad from 'meter.angle'"
    )
