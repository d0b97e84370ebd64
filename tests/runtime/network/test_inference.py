"""Types that generic blocks take from their wires, and lengths of arrays."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from runtime.errors import GraphError

TYPES = {
    "Scalar": 1.0,
    "Pose": [1.0, 2.0, 3.0],
    "Twist": [1.0, 2.0],
    "Vector(2)": [1.0, 2.0],
    "Vector(3)": [1.0, 2.0, 3.0],
}


def constant(kind: str) -> dict[str, Any]:
    return {"type": "Constant", "value": TYPES[kind], "signal": kind.partition("(")[0]}


def types(plain: dict[str, Any]) -> dict[str, str]:
    network = runtime.load(plain).network
    return {f"{block}.{port}": str(kind) for (block, port), kind in network.types.items()}


@pytest.mark.parametrize("kind", TYPES)
def test_types_flow_forwards(kind: str) -> None:
    found = types(
        {
            "blocks": {
                "c": constant(kind),
                "g": {"type": "Gain", "gain": 2},
                "s": {"type": "Sum"},
                "d": {"type": "UnitDelay"},
            },
            "wires": {
                "g": {"input": "c.value"},
                "s": {"terms": ["g.out", "d.out"]},
                "d": {"input": "s.out"},
            },
        }
    )
    assert set(found.values()) == {kind}
    assert len(found) == 7


def test_types_flow_backwards() -> None:
    """The plant alone is typed: what stands before it, in a loop, takes the type from its input."""
    found = types(
        {
            "blocks": {
                "plant": {"type": "DifferentialDrive"},
                "s": {"type": "Sum"},
                "d": {"type": "UnitDelay"},
            },
            "wires": {
                "plant": {"command": "s.out"},
                "s": {"terms": ["d.out"]},
                "d": {"input": "s.out"},
            },
        }
    )
    generic = [kind for port, kind in found.items() if port.split(".")[0] in "sd"]
    assert generic == ["Twist"] * 4


ENSEMBLE: dict[str, Any] = {"type": "AdaptiveEnsemble", "neurons": 3}


@pytest.mark.parametrize(
    ("wired", "error", "expected"),
    [
        ("Scalar", "Scalar", ("Vector(1)", "Vector(1)", "Vector(1)")),
        ("Vector(3)", "Vector(2)", ("Vector(3)", "Vector(2)", "Vector(2)")),
        ("Vector(2)", "Scalar", ("Vector(2)", "Vector(1)", "Vector(1)")),
    ],
)
def test_lengths_come_from_what_is_wired(
    wired: str, error: str, expected: tuple[str, str, str]
) -> None:
    found = types(
        {
            "blocks": {"e": ENSEMBLE, "a": constant(wired), "b": constant(error)},
            "wires": {"e": {"input": "a.value", "error": "b.value"}},
        }
    )
    assert (found["e.input"], found["e.error"], found["e.output"]) == expected


def test_lengths_come_from_parameters() -> None:
    found = types(
        {
            "blocks": {
                "t": {"type": "LinePath", "samples": 7},
                "m": {"type": "MatchingPoint"},
                "p": {"type": "DifferentialDrive"},
            },
            "wires": {
                "m": {"path": "t.path", "pose": "p.pose"},
                "p": {"command": "m.feedforward"},
            },
        }
    )
    assert found["t.path"] == found["m.path"] == "Path(7)"


def test_a_scalar_and_a_vector_of_one_join_in_both_directions() -> None:
    graph = runtime.load(
        {
            "run": {"dt": 0.001, "until": 0.02},
            "blocks": {
                "c": constant("Scalar"),
                "e": {**ENSEMBLE, "learning_rate": 100.0, "tau_syn": 0.001},
                "s": {"type": "Sum"},
                "mux": {"type": "Mux"},
            },
            "wires": {
                "e": {"input": "c.value", "error": "c.value"},
                "s": {"terms": ["c.value", "e.output"]},
                "mux": {"v": "e.output", "omega": "s.out"},
            },
            "probes": {"e": "e.output", "mux": "mux.out"},
        }
    )
    result = graph.run()
    assert result["e"].any()
    assert np.array_equal(result["mux"][:, 0], result["e"].ravel())
    assert np.array_equal(result["mux"][:, 1], 1.0 + result["e"].ravel())


def test_components_are_scalars() -> None:
    found = types(
        {
            "blocks": {
                "c": constant("Pose"),
                "v": constant("Vector(2)"),
                "g": {"type": "Gain", "gain": 1},
                "h": {"type": "Gain", "gain": 1},
            },
            "wires": {"g": {"input": "c.value.theta"}, "h": {"input": "v.value.1"}},
        }
    )
    assert found["g.out"] == found["h.out"] == "Scalar"


@given(st.data())
def test_any_order_of_the_text_gives_the_same_types(data: st.DataObject) -> None:
    """A random tree of generic blocks grown from one typed constant has that type everywhere."""
    kind = data.draw(st.sampled_from(sorted(TYPES)))
    count = data.draw(st.integers(1, 12))
    blocks: dict[str, Any] = {"c": constant(kind)}
    wires: dict[str, Any] = {}
    for i in range(count):
        source = data.draw(st.sampled_from(["c.value", *(f"b{k}.out" for k in range(i))]))
        what = data.draw(st.sampled_from(["Gain", "UnitDelay", "Sum"]))
        blocks[f"b{i}"] = {"type": what, **({"gain": 1} if what == "Gain" else {})}
        wires[f"b{i}"] = {"terms" if what == "Sum" else "input": source}
    order = random.Random(data.draw(st.integers(0, 99)))
    plain = {
        "blocks": dict(order.sample(sorted(blocks.items()), len(blocks))),
        "wires": dict(order.sample(sorted(wires.items()), len(wires))),
    }
    found = types(plain)
    assert set(found.values()) == {kind}
    assert len(found) == 1 + 2 * count


def wrong(plain: dict[str, Any]) -> list[str]:
    with pytest.raises(GraphError) as caught:
        runtime.load(plain).check()
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize("at", range(4))
def test_the_odd_one_of_several_terms_is_told_wherever_it_stands(at: int) -> None:
    terms = ["a.value", "b.value", "c.value"]
    terms.insert(at, "odd.value")
    blocks = {name: constant("Twist") for name in "abc"}
    plain = {
        "blocks": {**blocks, "odd": constant("Pose"), "s": {"type": "Sum"}},
        "wires": {"s": {"terms": terms}},
    }
    assert wrong(plain) == [
        f"wires.s.terms[{at}]: expected Twist (as 'a.value' is), got Pose from 'odd.value'"
    ]


def test_a_clash_far_away_is_told_at_the_odd_wire() -> None:
    """Two consumers want a Twist, through two generic blocks; one producer gives a Pose."""
    plain = {
        "blocks": {
            "odd": constant("Pose"),
            "g": {"type": "Gain", "gain": 1},
            "d": {"type": "UnitDelay"},
            "p": {"type": "DifferentialDrive"},
            "q": {"type": "DifferentialDrive"},
        },
        "wires": {
            "g": {"input": "odd.value"},
            "d": {"input": "g.out"},
            "p": {"command": "d.out"},
            "q": {"command": "g.out"},
        },
    }
    assert wrong(plain) == [
        "wires.g.input: expected Twist (as 'p.command' is), got Pose from 'odd.value'"
    ]


CLASHES = {
    "lengths": (
        {"v": constant("Vector(2)"), "w": constant("Vector(3)"), "s": {"type": "Sum"}},
        {"s": {"terms": ["v.value", "w.value"]}},
        ["wires.s.terms[1]: expected Vector(2) (as 'v.value' is), got Vector(3) from 'w.value'"],
    ),
    "an array for a scalar": (
        {"v": constant("Vector(2)"), "m": {"type": "Mux"}},
        {"m": {"v": "v.value"}},
        ["wires.m.v: expected Scalar, got Vector(2) from 'v.value'"],
    ),
    "a record for a scalar": (
        {"c": constant("Twist"), "m": {"type": "Mux"}},
        {"m": {"v": "c.value"}},
        [
            "wires.m.v: expected Scalar, got Twist from 'c.value'; one of its components fits: "
            "c.value.v, c.value.omega"
        ],
    ),
    "a record for an array of open length": (
        {"c": constant("Pose"), "e": ENSEMBLE},
        {"e": {"input": "c.value", "error": "c.value.x"}},
        ["wires.e.input: expected Vector(d), got Pose from 'c.value'"],
    ),
    "component of a scalar": (
        {"c": constant("Scalar"), "m": {"type": "Mux"}},
        {"m": {"v": "c.value.x"}},
        ["wires.m.v: Scalar 'c.value' has no component 'x'; it is a scalar"],
    ),
    "components of a vector": (
        {"c": constant("Vector(2)"), "m": {"type": "Mux"}, "n": {"type": "Mux"}},
        {"m": {"v": "c.value.2", "omega": "c.value.²"}, "n": {"v": "c.value.01"}},
        [
            f"wires.{port}: Vector(2) 'c.value' has no component '{name}'; its components: 0 to 1"
            for port, name in (("m.omega", "²"), ("m.v", "2"), ("n.v", "01"))
        ],
    ),
    "component of a table": (
        {"c": {"type": "LinePath", "samples": 5}, "m": {"type": "Mux"}},
        {"m": {"v": "c.path.x"}},
        [
            "wires.m.v: Path(5) 'c.path' has no component 'x'; only records and vectors have "
            "components"
        ],
    ),
    "nothing typed": (
        {"g": {"type": "Gain", "gain": 1}, "d": {"type": "UnitDelay"}, "s": {"type": "Sum"}},
        {"g": {"input": "d.out"}, "d": {"input": "g.out"}},
        [
            "blocks.d: the signal type of 'd.input' is open; wire a typed signal to it, or write "
            "its type, as in 'signal: Scalar'",
            "blocks.g: the signal type of 'g.input' is open; wire a typed signal to it, or write "
            "its type, as in 'signal: Scalar'",
            "blocks.s: the signal type of 's.terms' is open; wire a typed signal to it, or write "
            "its type, as in 'signal: Scalar'",
        ],
    ),
    "a block that cannot be made": (
        {
            "c": {"type": "Constant", "value": [1, 2], "signal": "Scalar"},
            "g": {"type": "Gain", "gain": 1},
        },
        {"g": {"input": "c.value"}},
        ["blocks.c.value: expected a number for Scalar, got [1.0, 2.0]"],
    ),
}


@pytest.mark.parametrize("case", CLASHES.values(), ids=CLASHES.keys())
def test_clashes(case: tuple[dict[str, Any], dict[str, Any], list[str]]) -> None:
    blocks, wires, messages = case
    assert wrong({"blocks": blocks, "wires": wires}) == messages


def part(inputs: dict[str, Any], inner: str = "inputs.x") -> dict[str, Any]:
    return {
        "inputs": inputs,
        "outputs": {"y": "g.out"},
        "blocks": {"g": {"type": "Gain", "gain": 1}},
        "wires": {"g": {"input": inner}},
    }


PARTS = {
    "typed": ({"x": "Twist"}, "inputs.x", "c.value", None),
    "open": ({"x": None}, "inputs.x", "c.value", None),
    "component inside": ({"x": "Twist"}, "inputs.x.v", "c.value", "Scalar"),
    "component outside": ({"x": "Scalar"}, "inputs.x", "c.value.omega", "Scalar"),
    "component of an open one": ({"x": None}, "inputs.x.v", "c.value", "Scalar"),
}


@pytest.mark.parametrize("case", PARTS.values(), ids=PARTS.keys())
def test_types_pass_through_parts(case: tuple[dict[str, Any], str, str, str | None]) -> None:
    inputs, inner, outer, kind = case
    found = types(
        {
            "blocks": {"c": constant("Twist"), "p": part(inputs, inner)},
            "wires": {"p": {"x": outer}},
        }
    )
    assert found["p.g.out"] == (kind or "Twist")


def test_a_part_within_a_part_keeps_the_component() -> None:
    outer = {
        "inputs": {"z": "Twist"},
        "outputs": {"y": "p.y"},
        "blocks": {"p": part({"x": None})},
        "wires": {"p": {"x": "inputs.z.omega"}},
    }
    found = types(
        {"blocks": {"c": constant("Twist"), "o": outer}, "wires": {"o": {"z": "c.value"}}}
    )
    assert found["o.p.g.out"] == "Scalar"


def test_what_a_part_declares_holds_on_both_sides() -> None:
    """Outside, the wire is wrong; inside, the declared type is what everything else relies on."""
    plain = {
        "blocks": {
            "c": constant("Pose"),
            "p": part({"x": "Twist"}),
            "plant": {"type": "DifferentialDrive"},
        },
        "wires": {"p": {"x": "c.value"}, "plant": {"command": "p.y"}},
    }
    assert wrong(plain) == ["wires.p.x: expected Twist, got Pose from 'c.value'"]
