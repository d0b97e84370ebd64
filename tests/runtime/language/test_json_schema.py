"""The JSON Schema: current, valid for every shipped file, and strict about names and bounds."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from blocks import NeuronModel
from docs.describe import schema_file
from runtime.document import dump_yaml, parse_yaml
from runtime.language import json_schema
from tests.conftest import Run
from tests.runtime.language.texts import CASE_C, GRAPHS

KINDS: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "boolean": (bool,),
    "null": (type(None),),
    "integer": (int,),
    "number": (int, float),
}


def is_valid(schema: dict[str, Any], value: Any, whole: dict[str, Any]) -> bool:
    """Whether a value has a schema, as far as the keywords that ours uses."""
    if "$ref" in schema:
        return is_valid(whole["definitions"][schema["$ref"].rsplit("/")[-1]], value, whole)
    kinds = schema.get("type", [])
    kinds = [kinds] if isinstance(kinds, str) else kinds
    numeric = isinstance(value, (int, float)) and not isinstance(value, bool)
    fits = [
        isinstance(value, KINDS[k]) and (k == "boolean" or not isinstance(value, bool))
        for k in kinds
    ]
    tests = [
        not kinds or any(fits),
        "const" not in schema or value == schema["const"],
        "enum" not in schema or value in schema["enum"],
        not numeric or value >= schema.get("minimum", value),
        not numeric or value <= schema.get("maximum", value),
        not numeric or "exclusiveMinimum" not in schema or value > schema["exclusiveMinimum"],
        not numeric or "exclusiveMaximum" not in schema or value < schema["exclusiveMaximum"],
        "pattern" not in schema
        or (isinstance(value, str) and re.search(schema["pattern"], value) is not None),
        "anyOf" not in schema or any(is_valid(s, value, whole) for s in schema["anyOf"]),
        all(is_valid(s, value, whole) for s in schema.get("allOf", [])),
        "not" not in schema or not is_valid(schema["not"], value, whole),
    ]
    if "if" in schema and is_valid(schema["if"], value, whole):
        tests.append(is_valid(schema.get("then", {}), value, whole))
    return all(tests) and is_valid_inside(schema, value, whole)


def is_valid_inside(schema: dict[str, Any], value: Any, whole: dict[str, Any]) -> bool:
    if isinstance(value, list):
        return all(is_valid(schema.get("items", {}), item, whole) for item in value)
    if not isinstance(value, dict):
        return True
    if not set(schema.get("required", ())) <= value.keys():
        return False
    known, others = schema.get("properties", {}), schema.get("additionalProperties", {})
    for key, item in value.items():
        inner = known.get(key, others)
        if inner is False or not is_valid(inner, item, whole):
            return False
    return True


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return json_schema()


def checked(text: str, schema: dict[str, Any] | None = None) -> bool:
    whole = schema or json_schema()
    return is_valid(whole, parse_yaml(text, "x").plain(), whole)


def test_the_committed_schema_is_current() -> None:
    text = (GRAPHS / "schema.json").read_text(encoding="utf-8")
    assert text == schema_file(), "run: python -m docs.describe"


@pytest.mark.parametrize("path", sorted(GRAPHS.rglob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_files_are_valid_and_name_their_schema(path: Path, schema: dict[str, Any]) -> None:
    text = path.read_text(encoding="utf-8")
    assert checked(text, schema)
    header = re.match(r"# yaml-language-server: \$schema=(\S+)\n", text)
    assert header is not None, f"begin {path} with '# yaml-language-server: $schema=...'"
    assert (path.parent / header[1]).resolve() == GRAPHS / "schema.json"


MISTAKES = (
    ("graph: wall", "grahp: wall"),
    ("seed: 0", "sed: 0"),
    ("q: [10", "Q: [10"),
    ("omega_max: 1.5", "omega_max: -1.5"),
    ("omega_max: 1.5", "omega_max: fast"),
    ("fit: control_points", "fit: nothing"),
    ("kind: map", "kind: mop"),
    ("    engaged: explore.engaged\n    distance: $d\n    title", "    engagde: x\n    title"),
    ("of: plant.pose, every: 50", "of: plant.pose, evry: 50"),
    ("wires:\n", "wires: 3\nx:\n"),
)


@pytest.mark.parametrize(("old", "new"), MISTAKES)
def test_mistakes_are_not_valid(old: str, new: str) -> None:
    text = CASE_C.read_text(encoding="utf-8")
    assert old in text
    assert not checked(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("omega_max: 1.5", "omega_max: $v_r"),
        ("omega_max: 1.5", "omega_max: 30deg/s"),
        ("type: Saturator, omega_max", "type: Mine, module: own.py, whatever"),
        ("  limit: {type", "  gone: null\n  limit: {type"),
    ],
)
def test_what_a_graph_may_also_say_is_valid(old: str, new: str) -> None:
    assert checked(CASE_C.read_text(encoding="utf-8").replace(old, new, 1))


@pytest.mark.slow
def test_the_command_prints_it(cli: Run) -> None:
    assert json.loads(cli("schema").stdout) == json_schema()


@pytest.mark.slow
def test_a_copy_does_not_name_a_schema_that_is_not_beside_it(cli: Run, tmp_path: Path) -> None:
    assert cli("new", "mine.yaml").returncode == 0
    assert "$schema" not in (tmp_path / "mine.yaml").read_text(encoding="utf-8")


def test_metrics_and_plots_of_files_are_accepted() -> None:
    assert checked("metrics: {m: {kind: mine, module: mine.py, of: a.x, percent: 9}}")
    assert checked("plots: {p: {kind: mine, module: mine.py, of: a.x, colour: red}}")
    assert not checked("plots: {p: {kind: mine, of: a.x}}")
    assert checked("metrics: {m: {kind: rms, of: a.x}}")
    assert not checked("metrics: {m: {kind: rms, of: a.x, percent: 9}}")


def test_neuron_models_of_files_and_packages_are_accepted() -> None:
    text = "blocks: {{a: {{type: Ensemble, neurons: 9, neuron: {}}}}}"
    assert checked(text.format("{type: Mine, module: mine.py, tau: 1}"))
    assert checked(text.format("{type: offered, tau: 1}"))
    assert checked(text.format("{type: LIF, tau_rc: 0.01}"))
    assert not checked(text.format("{type: LIF, tau: 1}"))


def test_each_member_of_a_family_has_its_own_parameters() -> None:
    """Whatever the schema accepts of a member's parameters, the member accepts, and no others."""
    members = NeuronModel.members.values()
    values = {key: each.default for other in members for key, each in other.declared.items()}
    for name, member in NeuronModel.members.items():
        for key, value in values.items():
            written = {"type": name, key: value}
            graph = {"blocks": {"a": {"type": "Ensemble", "neurons": 9, "neuron": written}}}
            assert checked(dump_yaml(graph)) == (key in member.declared), written
    text = "blocks: {{a: {{type: Ensemble, neurons: 9, neuron: {}}}}}"
    assert checked(text.format("{tau_rc: 0.01}"))  # an entry that is merged into another one
    assert not checked(text.format("{type: LIF, tau_rc: -1}"))
    rule = "blocks: {{d: {{type: Decoder, learning: {}}}}}"
    assert checked(rule.format("{rule: pes, learning_rate: 1e-4}"))
    assert not checked(rule.format("{rule: pes, alpha: 1e-4}"))


def test_our_walk_agrees_with_jsonschema(schema: dict[str, Any]) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft7Validator(schema)
    validator.check_schema(schema)
    whole = CASE_C.read_text(encoding="utf-8")
    texts = [whole, *(whole.replace(old, new, 1) for old, new in MISTAKES)]
    texts += [
        f"blocks: {{a: {{type: Ensemble, neurons: 9, neuron: {{type: {name}, {key}: 0.5}}}}}}"
        for name in NeuronModel.members
        for key in ("tau_rc", "inc_n", "amplitude", "spikes")
    ]
    for text in texts:
        value = parse_yaml(text, "x").plain()
        assert validator.is_valid(value) == is_valid(schema, value, schema), text
