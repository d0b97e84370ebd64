"""Kinds of messages and fixes: data beside the sentences, in Python, in JSON and in the docs."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

import runtime
from blocks.core import ParameterError
from blocks.messages import KINDS, Message, Note, Replace, as_message
from runtime.errors import GraphError
from runtime.language import Model, diagnose
from tests.runtime.language.texts import SURROUNDINGS

ROOT = Path(__file__).parent.parent.parent.parent
WRONG = """graph: wrong
run: {dt: 0.01, until: 1.0}
blocks:
  a: {type: Constant, value: 1.0}
  k: {type: Gain, gian: 2.0}
wires:
  k: {input: a.value}
"""


def test_a_kind_is_one_of_the_list() -> None:
    with pytest.raises(ValueError, match="'mistake' is not a kind"):
        Message("wrong", "mistake")


def test_every_kind_is_used_and_documented() -> None:
    page = (ROOT / "docs" / "editors.md").read_text(encoding="utf-8")
    folders = (ROOT / "blocks", ROOT / "runtime")
    files = [path for folder in folders for path in folder.rglob("*.py")]
    source = "".join(p.read_text(encoding="utf-8") for p in files if p.name != "messages.py")
    for kind, about in KINDS.items():
        assert f"| `{kind}` | {about} |" in page
        assert f'"{kind}"' in source or kind in ("invalid-value", "run")


def test_a_message_is_a_string_that_keeps_its_kind() -> None:
    message = Message("no 'a'", "unknown-name", [Replace("b", "a")])
    assert message == "no 'a'"
    assert message.within("x: ").fixes == (Replace("b", "a"),)
    assert as_message(message) is message
    assert as_message("wrong").kind == "invalid-value"
    copy = pickle.loads(pickle.dumps(message))
    assert (copy, copy.kind, copy.fixes) == (message, message.kind, message.fixes)
    note = pickle.loads(pickle.dumps(Note("is large", "maybe-degrees", "blocks.a.x", "a")))
    assert note == "blocks.a.x: is large"
    assert (note.text, note.address, note.block) == ("is large", "blocks.a.x", "a")


def test_a_parameter_has_the_same_message_in_python_and_in_a_graph(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(WRONG, encoding="utf-8")
    with pytest.raises(GraphError) as of_graph:
        runtime.load(path).check()
    [problem] = of_graph.value.problems
    with pytest.raises(ParameterError) as of_class:
        from blocks.generic import Gain

        Gain(gian=2.0)
    message = as_message(of_class.value.problems[0][1])
    assert (problem.text, problem.kind, problem.fixes) == (message, message.kind, message.fixes)
    assert problem.kind == "unknown-parameter"
    assert problem.fixes == (Replace("gain", "gian"),)


@pytest.mark.parametrize("verb", ["run", "explain", "validate"])
def test_json_has_kinds_and_fixes(
    cli: Callable[..., CompletedProcess[str]], verb: str, tmp_path: Path
) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(WRONG, encoding="utf-8")
    done = cli(verb, str(path), "--json")
    assert done.returncode == 2
    printed = json.loads(done.stdout)
    problems = printed["problems"] if verb != "validate" else printed["diagnostics"][str(path)]
    fix = {"action": "replace", "new": "gain", "old": "gian", "title": ""}
    assert [each["kind"] for each in problems] == ["unknown-parameter"]
    assert problems[0]["fixes"] == [fix]
    assert problems[0]["message"] == "unknown parameter, did you mean 'gain'?"


def test_notes_of_a_run_are_data_in_json(
    cli: Callable[..., CompletedProcess[str]], tmp_path: Path
) -> None:
    path = tmp_path / "right.yaml"
    text = WRONG.replace("gian", "gain").replace("until: 1.0", "until: 1.0, solver: rk4")
    path.write_text(text.replace("graph: wrong", "graph: right"), encoding="utf-8")
    done = cli("run", str(path), "--json", "--out", str(tmp_path / "runs"))
    printed = json.loads(done.stdout)
    [found] = printed["messages"]
    assert printed["notes"] == [found["message"]]
    assert (found["kind"], found["address"]) == ("not-used", "run.solver")


def test_a_note_of_a_block_is_at_the_block() -> None:
    text = WRONG.replace("gian", "gain").replace(
        "a: {type: Constant, value: 1.0}", "a: {type: Pulse, period: 0.1, width: 0.001}"
    )
    model = Model(text.replace("a.value", "a.out"), ROOT / "pulse.yaml", SURROUNDINGS)
    found = diagnose(model)
    assert [each.kind for each in found] == ["short-pulse"]
    assert model.text.source[found[0].span.start : found[0].span.end] == "a"
