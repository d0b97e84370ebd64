"""Components of vectors with names and units: in wires, probes, metrics and linearizations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import runtime

PLANT = {
    "type": "DynamicSystem",
    "states": {"x": "m", "vx": "m/s"},
    "derivative": ["vx", "-4*x"],
    "initial": [1, 0],
}


def graph(wires: dict[str, Any] | None = None, **blocks: Any) -> dict[str, Any]:
    return {
        "run": {"dt": 0.01, "until": 0.5},
        "types": {"Body": {"x": "m", "v": "m/s"}},
        "blocks": {"plant": PLANT, **blocks},
        "wires": wires or {},
        "probes": {"p": "plant.out", "v": "plant.out.vx", "both": "plant.out[0:2]"},
        "metrics": {"speed": {"kind": "rms", "of": "plant.out.vx"}},
    }


def test_probes_and_metrics_have_names_and_units() -> None:
    result = runtime.load(graph()).run(engine="python")
    assert result.probes["p"].labels == ("plant.out.x", "plant.out.vx")
    assert result.probes["p"].units == result.probes["both"].units == ("m", "m/s")
    assert result.probes["v"].units == ("m/s",)
    np.testing.assert_array_equal(result.probes["v"].values, result.probes["p"].values[:, 1])
    speed = np.sqrt(np.mean(result.probes["v"].values ** 2))
    assert result.metrics["speed"] == pytest.approx(speed)


def test_names_pass_through_blocks_that_keep_the_type() -> None:
    blocks = {"lag": {"type": "Delay", "delay": 0.1}, "of": {"type": "Gain", "gain": 2}}
    text = graph({"lag": {"input": "plant.out"}, "of": {"input": "lag.out.vx"}}, **blocks)
    text["probes"] |= {"late": "lag.out", "of": "of.out"}
    result = runtime.load(text).run(engine="python")
    assert result.probes["late"].labels == ("lag.out.x", "lag.out.vx")
    np.testing.assert_array_equal(
        result.probes["of"].values, 2 * result.probes["late"].values[:, 1]
    )


def test_a_linearization_has_the_names() -> None:
    found = runtime.load(graph()).linearize(outputs=["plant.out"])
    assert found.states == ("plant.x.x", "plant.x.vx")
    assert found.outputs == ("plant.out.x", "plant.out.vx")
    np.testing.assert_allclose(found.a, [[0, 1], [-4, 0]], atol=1e-9)


def test_a_type_of_its_own_is_a_record() -> None:
    body = {"type": "Function", "names": ["x", "v"], "expression": ["x", "v"], "signal": "Body"}
    text = graph({"body": {"u": "plant.out"}}, body=body)
    text["probes"]["body"] = "body.out"
    result = runtime.load(text).run(engine="python")
    assert result.probes["body"].labels == ("body.out.x", "body.out.v")
    assert result.probes["body"].kinds == ("Body",) * len(result.probes["body"].kinds)


FORCE = {"type": "Function", "expression": ["t", "2*t"], "signal": {"height": "m", "push": "N"}}


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        (["plant.out.x", "plant.out.vx"], "expected m as 'plant.out.x' has, got m/s"),
        (["plant.out.vx", "force.out.push"], "expected m/s as 'plant.out.vx' has, got N"),
        (["plant.out.x", "force.out.height"], ""),
        (["plant.out.y"], "Vector(2) 'plant.out' has no component 'y'; its components: x, vx"),
    ],
)
def test_units_that_differ_are_refused(terms: list[str], message: str) -> None:
    loaded = runtime.load(graph({"s": {"terms": terms}}, s={"type": "Sum"}, force=FORCE))
    if not message:
        loaded.check()
        return
    with pytest.raises(runtime.GraphError) as caught:
        loaded.check()
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("types", "part"),
    [
        ({"Pose": {"x": "m"}}, "'Pose' is a type of the library"),
        ({"2d": {"x": "m"}}, "'2d' is not a name for a type"),
        ({"Body": ["x"]}, "expected components with their units"),
        ({"Body": {"x": 3}}, "expected"),
    ],
)
def test_wrong_types_are_refused(types: dict[str, Any], part: str) -> None:
    with pytest.raises(runtime.GraphError, match=part):
        runtime.load({**graph(), "types": types}).check()
