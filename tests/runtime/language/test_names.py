"""Definitions, references and renames across files."""

from __future__ import annotations

from pathlib import Path

import pytest

from runtime.errors import UsageError
from runtime.graph import load
from runtime.language import (
    Model,
    Place,
    Project,
    apply_edits,
    definition,
    diagnose,
    references,
    rename,
    rename_span,
)
from tests.runtime.language.texts import CASE_C, GRAPHS, MARK, SURROUNDINGS


@pytest.fixture(scope="module")
def shipped() -> Project:
    paths = sorted(GRAPHS.rglob("*.yaml"))
    return Project(Model(p.read_text(encoding="utf-8"), p, SURROUNDINGS) for p in paths)


SHARING_LQR = {
    *("wall_following.yaml", "walls.yaml", "walls_robust.yaml", "robust.yaml"),
    *("line_actuator_failure.yaml", "line.yaml", "line_robust.yaml"),
    *("sine_estimation_error.yaml", "sine.yaml", "sine_robust.yaml"),
}


def at(project: Project, path: Path, marked: str) -> tuple[Model, int]:
    model = project.models[path.resolve()]
    return model, model.text.source.index(marked.replace(MARK, "")) + marked.index(MARK)


def shown(project: Project, places: list[Place]) -> list[str]:
    """Each place as file:line:name."""
    found = []
    for place in places:
        model = project.models[place.path.resolve()]
        line, _ = model.text.position(place.span.start)
        name = model.text.source[place.span.start : place.span.end]
        found.append(f"{place.path.name}:{line + 1}:{name}")
    return found


@pytest.mark.parametrize(
    ("marked", "expected"),
    [
        ("error: err¦or.state", ["wall_following.yaml:18:error"]),
        ("error: error.st¦ate", ["wall_following.yaml:18:error"]),
        ("v_r: $v¦_r", ["wall_following.yaml:10:v_r"]),
        ("of: [po¦se,", ["wall_following.yaml:57:pose"]),
        ("rate¦_v:", ["adaptive_snn.yaml:9:rate_v"]),
        ("turn_in¦put:", ["adaptive_snn.yaml:20:turn_input"]),
        ("adaptive.comma¦nd]", ["adaptive_snn.yaml:25:command"]),
        ("parts/adaptive_s¦nn.yaml", ["adaptive_snn.yaml:1:"]),
        ("worlds/paper¦_room.yaml", ["paper_room.yaml:1:"]),
    ],
)
def test_definitions(shipped: Project, marked: str, expected: list[str]) -> None:
    model, offset = at(shipped, CASE_C, marked)
    assert shown(shipped, definition(model, offset, shipped)) == expected


def test_a_type_is_defined_by_its_python_class(shipped: Project) -> None:
    path = GRAPHS / "starters" / "own_block.yaml"
    model, offset = at(shipped, path, "type: Back¦lash")
    [place] = definition(model, offset, shipped)
    text = place.path.read_text(encoding="utf-8")
    assert place.path.name == "own_block.py"
    assert text[: place.span.start].endswith("class ")
    assert text[place.span.start : place.span.end] == "Backlash"


def test_a_block_of_the_graph_below_is_defined_there(shipped: Project) -> None:
    path = GRAPHS / "gallery" / "zero_order_hold.yaml"
    model, offset = at(shipped, path, "input: ga¦in.out")
    [place] = definition(model, offset, shipped)
    assert place.path.name == "step_feedback.yaml"


def test_references_reach_experiments_overlays_and_parts(shipped: Project) -> None:
    model, offset = at(shipped, CASE_C, "  lq¦r: {type")
    files = {place.path.name for place in references(model, offset, shipped)}
    # An overlay of all three cases, rules/robust.yaml, names the block as well.
    assert files == SHARING_LQR
    part = GRAPHS / "parts" / "adaptive_snn.yaml"
    model, offset = at(shipped, part, "command: jo¦in.out")
    assert (
        shown(shipped, references(model, offset, shipped))
        == [
            "adaptive_snn.yaml:25:join",
            "adaptive_snn.yaml:48:join",
            "adaptive_snn.yaml:53:join",
        ]
        or len(references(model, offset, shipped)) == 3
    )


def after(project: Project, marked: str, new: str, path: Path = CASE_C) -> dict[Path, str]:
    model, offset = at(project, path, marked)
    edits = rename(model, offset, new, project)
    return {
        file: apply_edits(project.models[file.resolve()].text.source, changes)
        for file, changes in edits.items()
    }


@pytest.mark.parametrize(
    ("marked", "new"),
    [("  lq¦r: {type", "steering"), ("fau¦lt.actual", "broken"), ("rate_¦v:", "speed_rate")],
)
@pytest.mark.slow
def test_a_renamed_graph_still_has_no_problems(shipped: Project, marked: str, new: str) -> None:
    """Every file that shares the name is edited, and none of them has a problem afterwards."""
    texts = after(shipped, marked, new)
    unsaved = {path.resolve(): text for path, text in texts.items()}
    surroundings = type(SURROUNDINGS)(unsaved, modules=True)
    assert len(texts) > 1 or marked.startswith("fau")
    for path, text in texts.items():
        found = diagnose(Model(text, path, surroundings))
        assert [each.message for each in found if each.severity == "error"] == [], path


def test_a_rename_edits_wires_probes_plots_metrics_and_removals(tmp_path: Path) -> None:
    text = """graph: all
blocks:
  a: {type: Constant, value: 1.0}
  b¦: {type: Gain, gain: 2.0}
  c: {type: Sum}
wires:
  b: {input: a.value}
  c: {terms: [b.out, "b.out"]}
without: [b]
bypass: b
probes: {p: b.out, q: {of: [b.out, c.out]}}
plots: {x: {kind: timeseries, of: [b.out, p]}}
metrics: {m: {kind: mean_abs, of: b.out}}
"""
    offset = text.index(MARK)
    model = Model(text.replace(MARK, ""), tmp_path / "all.yaml", SURROUNDINGS)
    edits = rename(model, offset, "twice", Project([model]))
    [changes] = edits.values()
    result = apply_edits(model.text.source, changes)
    assert result == text.replace(MARK, "").replace("b.out", "twice.out").replace(
        "  b: ", "  twice: "
    ).replace("[b]", "[twice]").replace("bypass: b", "bypass: twice")


def test_an_own_type_is_renamed_in_python_and_in_every_graph(shipped: Project) -> None:
    path = GRAPHS / "starters" / "own_block.yaml"
    model, offset = at(shipped, path, "type: Back¦lash")
    edits = rename(model, offset, "Play", shipped)
    assert {file.name for file in edits} == {"own_block.py", "own_block.yaml"}


@pytest.mark.parametrize(
    ("marked", "new", "message"),
    [
        ("  lq¦r: {type", "error", "there is a block 'error' already"),
        ("  lq¦r: {type", "a.b", "is not a name for a block"),
        ("  lq¦r: {type", "inputs", "is reserved"),
        ("type: LQ¦R", "Mine", "a type of the library"),
        ("# A ro¦bot", "x", "nothing to rename"),
    ],
)
def test_what_cannot_be_renamed(shipped: Project, marked: str, new: str, message: str) -> None:
    model, offset = at(shipped, CASE_C, marked)
    with pytest.raises(UsageError, match=message):
        rename(model, offset, new, shipped)


def test_files_outside_the_folder_are_not_renamed(shipped: Project, tmp_path: Path) -> None:
    text = "extends: wall_following\ngraph: mine\nblocks: {lqr: {q: [1, 1, 1]}}\n"
    model = Model(text, tmp_path / "mine.yaml", SURROUNDINGS)
    project = Project([model])
    offset = text.index("lqr")
    assert rename_span(model, offset) is not None
    with pytest.raises(UsageError, match="not in this folder"):
        rename(model, offset, "steering", project, [model.path])


OVERLAID = """graph: g
run: {dt: 0.1, until: 1.0}
blocks:
  a: {type: Constant, value: 1.0}
  fau¦lt: {type: Gain, gain: 2.0}
wires: {fault: {input: a.value}}
"""
OVERLAY = "blocks: {fault: {gain: 3.0}, lag: {type: UnitDelay}}\nwires: {lag: {input: fault.out}}\n"
BETTER = OVERLAY.replace("fault", "broken")


@pytest.mark.parametrize(
    ("others", "is_edited"),
    [
        ({}, True),
        ({"other": OVERLAID.replace("graph: g", "graph: h")}, False),
        ({"other": OVERLAID, "e": "graph: g\nvariants: {v: {with: lag}}\n"}, True),
        ({"e": "graph: g\nvary: {fault.gain: 1..2}\nwith: [lag]\n"}, True),
    ],
    ids=["the only graph", "two graphs", "an experiment's variant", "an experiment"],
)
def test_an_overlay_is_renamed_with_the_graph_that_it_belongs_to(
    others: dict[str, str], is_edited: bool, tmp_path: Path
) -> None:
    texts = {"g": OVERLAID, "lag": OVERLAY, **others}
    offset = OVERLAID.index(MARK)
    models = {}
    for name, text in texts.items():
        path = tmp_path / f"{name}.yaml"
        path.write_text(text.replace(MARK, ""), encoding="utf-8")
        models[name] = Model(text.replace(MARK, ""), path, SURROUNDINGS)
    edits = rename(models["g"], offset, "broken", Project(models.values()))
    changed = {
        path.stem: apply_edits(models[path.stem].text.source, made) for path, made in edits.items()
    }
    assert ("lag" in changed) == is_edited
    if is_edited:
        assert changed["lag"] == BETTER
        for name, text in changed.items():
            (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
        load(tmp_path / "g.yaml").overlay(tmp_path / "lag.yaml").check()
    assert "other" not in changed


def test_files_that_name_each_other_in_a_circle(tmp_path: Path) -> None:
    one = Model("extends: two.yaml\nblocks: {a: {}}\n", tmp_path / "one.yaml", SURROUNDINGS)
    two = Model("extends: one.yaml\nblocks: {a: {}}\n", tmp_path / "two.yaml", SURROUNDINGS)
    for model in (one, two):
        model.path.write_text(model.text.source, encoding="utf-8")
    project = Project([one, two])
    offset = one.text.source.index("a: {}")
    assert {place.path.name for place in references(one, offset, project)} <= {
        "one.yaml",
        "two.yaml",
    }
    definition(one, offset, project)
