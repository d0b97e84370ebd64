"""Units that do not go together are refused; what may be meant passes."""

from __future__ import annotations

import math

import pytest

import blocks
import runtime
from blocks.core.signals import differ, dimension
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
        "'meter.angle'; if that is intended, a Gain on this wire gives it another unit"
    )


def test_components_of_records_have_units() -> None:
    made = graph().add("plant", blocks.DifferentialDrive()).add("mux", blocks.Mux())
    made = made.connect("mux.out", "plant.command")
    assert made.connect("plant.pose.x", "sum.terms").check()
    assert "got rad from 'plant.pose.theta'" in refused(
        made.connect("plant.pose.theta", "sum.terms")
    )


def test_generic_blocks_hand_a_unit_on_and_a_gain_frees_it() -> None:
    """A long chain, so that nothing recurses along it."""
    made = graph()
    source = "meter.angle"
    for i in range(1500):
        made = made.add(f"d{i}", blocks.UnitDelay()).connect(source, f"d{i}.input")
        source = f"d{i}.out"
    assert "expected m as 'meter.length' has, got rad from 'd1499.out'" in refused(
        made.connect(source, "sum.terms")
    )


def test_a_unit_is_handed_on_whatever_the_order_of_the_text() -> None:
    """From the consumer to the source, so that each block comes before the one that it follows."""
    made = graph()
    for i in reversed(range(5)):
        made = made.add(f"d{i}", blocks.UnitDelay())
    made = made.connect("d4.out", "sum.terms")
    for i in reversed(range(1, 5)):
        made = made.connect(f"d{i - 1}.out", f"d{i}.input")
    made = made.connect("meter.angle", "d0.input")
    assert "expected m as 'meter.length' has, got rad from 'd4.out'" in refused(made)


def test_a_gain_between_makes_it_meant() -> None:
    made = graph().add("arm", blocks.Gain(gain=0.3)).connect("meter.angle", "arm.input")
    assert made.connect("arm.out", "sum.terms").run(until=0.1)


def test_unknown_units_pass() -> None:
    made = graph().connect("meter.plain", "sum.terms")
    assert made.add("c", blocks.Constant(value=1)).connect("c.value", "sum.terms").check()


def test_an_input_that_declares_a_unit_says_so_in_a_note() -> None:
    """Refused it is not: a controller that takes its gain as 1 is a block like any other."""
    made = graph().add("mux", blocks.Mux()).connect("meter.rate", "mux.omega")
    assert made.run().notes == []
    assert made.connect("meter.angle", "mux.v").run().notes == [
        "wires.mux.v: expected m/s, got rad from 'meter.angle'; if that is intended, a Gain on "
        "this wire gives it another unit"
    ]


def turned(*pose: object) -> runtime.Graph:
    plain = {
        "run": {"dt": 0.1, "until": 0.1},
        "blocks": {
            "go": {"type": "Constant", "value": [0, 0], "signal": "Twist"},
            "plant": {"type": "DifferentialDrive", "x0": list(pose)},
        },
        "wires": {"plant": {"command": "go.value"}},
        "probes": {"pose": "plant.pose"},
    }
    return runtime.load(plain)


@pytest.mark.parametrize(
    ("text", "degrees"), [("90deg", 90.0), ("-22.5 deg", -22.5), ("1e1deg", 10.0)]
)
def test_degrees_may_be_written_where_radians_are_asked_for(text: str, degrees: float) -> None:
    result = turned(0, 1.5, text).run()
    assert result["pose"][0].tolist() == [0.0, 1.5, math.radians(degrees)]
    assert result.notes == []


@pytest.mark.parametrize("pose", [("90deg", 0, 0), (0, 0, "90 degrees"), (0, 0, "90deg/s")])
def test_degrees_are_read_strictly(pose: tuple[object, ...]) -> None:
    message = "blocks.plant.x0: expected an array of 3 numbers in m, m, rad, got "
    assert refused(turned(*pose)).startswith(message)


def test_rates_and_options_of_plots_take_degrees() -> None:
    assert blocks.Saturator(omega_max="90deg/s").omega_max == math.pi / 2
    with pytest.raises(blocks.ParameterError):
        blocks.Saturator(omega_max="90deg")
    plain = runtime.load("wall_following").set("plots.scans", None).to_dict()
    entry = {"kind": "scans", "of": ["plant.pose", "lidar.scan"], "angles": ["-90deg", "90deg"]}
    made = runtime.load({**plain, "plots": {"seen": entry}}).program().observation
    assert made.plots[0].options["angles"] == [-math.pi / 2, math.pi / 2]


def test_an_angle_of_more_than_a_turn_is_noted() -> None:
    message = "blocks.plant.x0: 90 rad is 5156.6 degrees; if degrees are intended, write 90deg"
    graph = turned(0, 90, 90)
    assert graph.run().notes == [message]
    assert graph.run().manifest["notes"] == [message]
    assert turned(90, 90, 6.28).run().notes == []
    assert turned(0, 0, "720deg").run().notes == []


def test_a_turn_rate_of_many_turns_is_noted() -> None:
    graph = runtime.load("starters/adaptive").set("blocks.limit.omega_max", 60)
    message = "60 rad/s is 3437.7 degrees/s; if degrees are intended, write 60deg/s"
    assert graph.network.notes == (f"blocks.limit.omega_max: {message}",)
    assert graph.set("blocks.limit.omega_max", "60deg/s").network.notes == ()
    fast = {"type": "SecondOrder", "natural_frequency": 60, "damping": 0.5}
    source = {"type": "Sine"}
    graph = runtime.load(
        {
            "graph": "fast",
            "run": {"dt": 0.001, "until": 0.1},
            "blocks": {"wave": source, "filter": fast},
            "wires": {"filter": {"input": "wave.out"}},
        }
    )
    assert graph.network.notes == ()
