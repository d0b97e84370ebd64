"""Diagnostics: the problems of ``validate``, each on the text that it is about."""

from __future__ import annotations

from pathlib import Path

import pytest

from runtime.errors import GraphError
from runtime.graph import Graph, load
from runtime.language import Diagnostic, Model, Surroundings, diagnose
from tests.runtime.language.texts import CASE_C, GRAPHS, SURROUNDINGS, chain, edited


def underlined(model: Model, found: Diagnostic) -> str:
    return model.text.source[found.span.start : found.span.end]


@pytest.mark.parametrize("path", sorted(GRAPHS.rglob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_files_have_no_problems(path: Path) -> None:
    model = Model(path.read_text(encoding="utf-8"), path, SURROUNDINGS)
    assert [found for found in diagnose(model) if found.severity == "error"] == []


@pytest.mark.parametrize(
    ("old", "new", "where", "message"),
    [
        ("q: [10", "Q: [10", "Q", "unknown parameter, did you mean 'q'?"),
        ("type: LQR,", "type: LQRR,", "LQRR", "no block type 'LQRR', did you mean 'LQR'?"),
        ("error: {pose: plant.pose", "error: {pose: plant.pos", "plant.pos", "no output 'pos'"),
        ("lqr: {error: error.state, ", "lqr: {", "lqr", "input 'lqr.error' (TrackingState) is not"),
        ("omega_max: 1.5", "omega_max: -1", "-1", "a number above 0 rad/s"),
        ("{rate_v: 1.0e-8", "{rate_w: 1.0e-8", "rate_w", "has no param 'rate_w', did you"),
        ("kind: map", "kind: mop", "mop", "did you mean 'map'?"),
        ("seed: 0", "sed: 0", "sed", "unknown key, did you mean 'seed'?"),
        ("worlds/paper_room", "worlds/paper_rom", "worlds/paper_rom.yaml", "no such world"),
        ("title: Scan and", "title: Scan: and", ":", "a string that contains ': ' needs quotes"),
        ("search: {input: explore.command}", "search: {input: sighted.out}", "s", "algebraic loop"),
    ],
)
def test_a_problem_is_underlined(old: str, new: str, where: str, message: str) -> None:
    model, _ = edited(old, new)
    found = diagnose(model)
    assert found[0].severity == "error"
    assert message in found[0].message
    assert underlined(model, found[0]).startswith(where)


@pytest.mark.parametrize(
    ("old", "new"),
    [("q: [10", "Q: [10"), ("type: Sum, dt: 0.01", "type: Sun, dt: 1"), ("of: errors", "of: eror")],
)
def test_problems_are_those_of_validate(old: str, new: str, tmp_path: Path) -> None:
    text = CASE_C.read_text(encoding="utf-8").replace(old, new, 1)
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(GraphError) as error:
        load(path).check()
    assert Model(text, path, SURROUNDINGS).problems == error.value.problems


def test_a_problem_in_another_file_is_shown_where_that_file_is_named(tmp_path: Path) -> None:
    base = tmp_path / "base.yaml"
    base.write_text("blocks:\n  a: {type: Constant, valeu: 2}\n", encoding="utf-8")
    text = "extends: base.yaml\ngraph: top\n"
    model = Model(text, tmp_path / "top.yaml", SURROUNDINGS)
    found = diagnose(model)
    assert underlined(model, found[0]) == "base.yaml"
    assert "base.yaml:2:23: unknown parameter, did you mean 'value'?" in found[0].message
    assert found[0].related[0].where.line == 2


def test_an_unsaved_text_takes_the_place_of_its_file(tmp_path: Path) -> None:
    base = tmp_path / "base.yaml"
    base.write_text("blocks:\n  a: {type: Gian}\n", encoding="utf-8")
    top = "extends: base.yaml\ngraph: top\nblocks: {b: {type: Constant, value: 1}}\n"
    text = "blocks:\n  a: {type: Gain, gain: 2}\nwires:\n  a: {input: b.value}\n"
    unsaved = {base.resolve(): text}
    assert diagnose(Model(top, tmp_path / "top.yaml", SURROUNDINGS)) != []
    assert diagnose(Model(top, tmp_path / "top.yaml", Surroundings(unsaved))) == []


def test_notes_are_warnings_at_their_parameter() -> None:
    model, _ = edited("x0: [0, 0, 0]", "x0: [0, 0, 90]")
    found = diagnose(model)
    assert [each.severity for each in found] == ["warning"]
    assert "write 90deg" in found[0].message
    assert model.text.source[found[0].span.start :].startswith("[0, 0, 90]")


def test_an_overlay_may_name_what_the_graph_below_has() -> None:
    path = GRAPHS / "conditions" / "lag.yaml"
    model, _ = edited("tau: 0.1", "tua: 0.1", path)
    found = diagnose(model)
    assert any("unknown parameter, did you mean 'tau'?" in each.message for each in found)
    assert not any("there is no block" in each.message for each in found)


def test_experiments_parts_and_worlds_are_checked() -> None:
    for path, old, new, message in [
        (
            "experiments/walls.yaml",
            "  PID:\n    replace: {lqr: PathPID}",
            "  PID:\n    replase: {lqr: PathPID}",
            "re",
        ),
        ("experiments/walls.yaml", "lqr.q: [113.8", "lqr.qq: [113.8", "'q'"),
        ("parts/adaptive_snn.yaml", "v: snn_v.output", "v: snn_v.outptu", "'output'"),
        ("parts/adaptive_snn.yaml", "leak: $leak", "leek: $leak", "'leak'"),
        ("worlds/paper_room.yaml", "[0.3, -1.5, 0.5]", "[0.3, -1.5, -0.5]", "above 0 m"),
    ]:
        model, _ = edited(old, new, GRAPHS / path)
        found = diagnose(model)
        assert found, (path, new)
        assert message in found[0].message


def test_an_edit_of_an_experiment_checks_the_graphs_that_it_touches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was right is not checked again, and every text has the problems that it has alone."""
    graph = tmp_path / "g.yaml"
    graph.write_text(
        "run: {dt: 0.1, until: 1.0}\n"
        "blocks: {a: {type: Constant, value: 1.0}, b: {type: Gain, gain: 2.0}}\n"
        "wires: {b: {input: a.value}}\n"
    )
    text = (
        "experiment: e\ngraph: g.yaml\nvary: {b.gain: [1.0, 2.0], a.value: 0.1..0.9:3}\n"
        "variants:\n  more: {set: {b.gain: 3.0}}\n  other: {set: {a.value: 3.0}}\n"
    )
    shared, checks = Surroundings(), []
    check = Graph.check
    monkeypatch.setattr(Graph, "check", lambda graph: checks.append(graph) or check(graph))

    def problems(text: str, surroundings: Surroundings) -> list[str]:
        return [str(each) for each in diagnose(Model(text, tmp_path / "e.yaml", surroundings))]

    counts = []
    for edited_text, wrong in [
        (text, 0),
        (text + "# a comment\n", 0),
        (text.replace("[1.0, 2.0]", "[1.0, 7.0]"), 0),
        (text.replace("[1.0, 2.0]", "[1.0, '7']"), 1),
        (text.replace("more: {set: {b.gain", "more: {set: {b.gian"), 1),
        (text.replace("\nvary", "\n\nvary"), 0),
    ]:
        checks.clear()
        found = problems(edited_text, shared)
        counts.append(len(checks))
        assert found == problems(edited_text, Surroundings())
        assert len(found) == wrong
    assert counts[:3] == [8, 1, 2]  # the baseline, its 5 values, 2 variants; the baseline; a value
    graph.write_text(graph.read_text().replace("gain: 2.0", "gian: 2.0"))
    assert problems(text, shared) == problems(text, Surroundings()) != []


def test_two_thousand_blocks(tmp_path: Path) -> None:
    text = chain(2000)
    assert diagnose(Model(text, tmp_path / "big.yaml", SURROUNDINGS)) == []
    wrong = text.replace("b777: {type: Gain, gain", "b777: {type: Gain, gian")
    found = diagnose(Model(wrong, tmp_path / "big.yaml", SURROUNDINGS))
    assert [each.address for each in found] == ["blocks.b777.gian"]


def test_a_text_without_anything_has_a_problem() -> None:
    for text in ("", "\n", "# only a comment\n", "- a\n", "42", "\x00", "a: &x *x"):
        assert diagnose(Model(text, CASE_C, SURROUNDINGS)), text


def test_of_a_text_with_too_many_entries_no_tree_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    from runtime.language import model as module

    monkeypatch.setattr(module, "GRAPH_VALUES", 1000)
    for text in ("a: [" + "[]," * 2000 + "0]\n", "".join(f"k{i}:\n" for i in range(2000))):
        model = Model(text, Path("large.yaml"), SURROUNDINGS)
        assert model.root.items == []
        assert underlined(model, diagnose(model)[-1])


def test_a_part_is_checked_by_itself(tmp_path: Path) -> None:
    """Its inputs have a signal from outside; what is wrong has the names that the file uses."""
    part = (
        "inputs: {a: Scalar, b: {type: Scalar, optional: true}}\noutputs: {out: s.out}\n"
        "blocks: {s: {type: Sum}, g: {type: Gain, gain: 2.0}}\n"
        "wires: {s: {terms: [g.out, inputs.b]}, g: {input: inputs.a}}\n"
    )
    path = tmp_path / "p.yaml"
    assert diagnose(Model(part, path, SURROUNDINGS)) == []
    for old, new, message in [
        ("inputs.a}", "inputs.aa}", "'inputs.aa' is not an input of this part, did you mean 'a'?"),
        ("out: s.out", "out: z.out", "there is no block 'z'; inputs of the part: inputs.a, input"),
        ("g: {input: inputs.a}", "g: {input: s.out}", "algebraic loop: "),
        ("a: Scalar,", "a: Pose,", "expected Scalar"),
        (
            ", g: {input: inputs.a}",
            "",
            "input 'g.input' (Scalar) is not connected; outputs of that type",
        ),
    ]:
        changed = part.replace(old, new)
        assert changed != part
        found = diagnose(Model(changed, path, SURROUNDINGS))
        assert any(message in each.message for each in found), (new, found)
        assert not any("p." in each.message for each in found)
