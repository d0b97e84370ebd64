"""Changes of a graph as edits of its text: comments stay, and the text says the new graph."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import blocks
from runtime.document import parse_scalar, parse_yaml, same
from runtime.errors import SpikeblocksError, UsageError
from runtime.graph import Graph
from runtime.language import (
    Model,
    delete_block,
    place_of,
    why_not,
    write_document,
    write_entries,
)
from runtime.language.items import YamlItem
from tests.runtime.language.texts import GRAPHS, SURROUNDINGS

TEXT = """# a loop
graph: small   # its title
run: {dt: 0.01, until: 2.0}
params:
  k: 2.0   # tuned by hand
blocks:
  # the source
  u: {type: Sine, amplitude: 1.0}   # one hertz
  g: {type: Gain, gain: $k}
  n: {type: WhiteNoise, density: 0.1}
  s: {type: Sum}
  x:
    type: Integrator
    initial: 1.0    # metres
wires:
  g: {input: u.out}
  s: {terms: [g.out, n.out]}   # both
  x: {input: s.out}
probes:
  x: x.out   # the state
  both: {of: [s.out, n.out]}
plots:
  one: {kind: timeseries, of: [x, both]}
"""
PATHS = sorted([*GRAPHS.glob("*.yaml"), *(GRAPHS / "gallery").rglob("*.yaml")])


def model_of(text: str, path: Path = GRAPHS / "small.yaml") -> Model:
    return Model(text, path, SURROUNDINGS)


def graph_of(model: Model) -> Graph:
    return Graph.of_document(model.document, model.path, True)


def lines_that_differ(text: str) -> list[str]:
    old, new = TEXT.splitlines(), text.splitlines()
    return [line for line in new if line not in old]


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("x.initial", 3.0, ["    initial: 3.0    # metres"]),
        ("params.k", 3.0, ["  k: 3.0   # tuned by hand"]),
        ("u.amplitude", 0.5, ["  u: {type: Sine, amplitude: 0.5}   # one hertz"]),
        ("u.frequency", 2.0, ["  u: {type: Sine, amplitude: 1.0, frequency: 2.0}   # one hertz"]),
        ("run.seed", 3, ["run: {dt: 0.01, until: 2.0, seed: 3}"]),
    ],
)
def test_a_value_changes_one_line(path: str, value: float, expected: list[str]) -> None:
    model = model_of(TEXT)
    new = graph_of(model).set(path, value).document
    assert lines_that_differ(write_document(model, new)) == expected


def test_a_name_leads_to_where_its_value_is_written() -> None:
    assert place_of(model_of(TEXT).document, "blocks.g.gain") == "params.k"
    assert place_of(model_of(TEXT).document, "blocks.x.initial") == "blocks.x.initial"


def test_wires_blocks_and_removals() -> None:
    model = model_of(TEXT)
    graph = graph_of(model)
    wired = write_document(model, graph.wire("s.terms", ["u.out", "n.out"]).document)
    assert lines_that_differ(wired) == ["  s: {terms: [u.out, n.out]}   # both"]
    added = graph.add("more", blocks.Gain(gain=2.0))
    text = write_document(model, added.connect("x.out", "more.input").document)
    assert lines_that_differ(text) == [
        "  more: {type: Gain, gain: 2.0}",
        "  more: {input: x.out}",
    ]
    removed = write_document(model, graph.without("n").document)
    assert lines_that_differ(removed) == ["without: [n]"]
    assert "# the source" in removed and not why_not(model, removed)
    again = write_document(model_of(removed), graph_of(model_of(removed)).bypass("g").document)
    assert lines_that_differ(again) == ["without: [n]", "bypass: [g]"]
    assert write_document(model_of(removed), model.document) == TEXT
    replaced = write_document(model, graph.replace("g", "DeadZone").document)
    assert "tuned by hand" not in replaced or "k:" in replaced
    assert "# one hertz" in replaced


def test_a_block_is_deleted_with_what_mentions_it() -> None:
    model = model_of(TEXT)
    text = write_document(model, delete_block(model.document, "n"))
    assert lines_that_differ(text) == ["  s: {terms: [g.out]}   # both", "  both: {of: [s.out]}"]
    assert not why_not(model, text)
    text = write_document(model, delete_block(model.document, "x"))
    assert "x" not in Model(text, model.path, SURROUNDINGS).document.get("probes").value
    assert "kind: timeseries, of: [both]" in text


def test_why_a_block_cannot_be_left_out() -> None:
    model = model_of(TEXT)
    reason = why_not(model, write_document(model, graph_of(model).without("u").document))
    assert "g.input" in reason and "not connected" in reason
    assert "unknown parameter" in why_not(model, TEXT.replace("amplitude", "amplitud"))


def test_what_another_file_says_is_overlaid(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(TEXT, encoding="utf-8")
    model = model_of("extends: base.yaml\n# mine\n", tmp_path / "own.yaml")
    graph = graph_of(model)
    text = write_document(model, graph.set("x.initial", 2.0).document)
    assert text == "extends: base.yaml\n# mine\nblocks:\n  x: {initial: 2.0}\n"
    text = write_document(model, delete_block(graph.document, "n"))
    assert "# mine" in text and same(
        model_of(text, model.path).document, delete_block(graph.document, "n")
    )


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_every_block_of_a_shipped_graph_can_be_changed_in_its_text(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    model = model_of(text, path)
    graph = graph_of(model)
    comments = [line.partition("# ")[2] for line in text.splitlines() if "# " in line]
    for name in graph.names:
        for change in (graph.without, graph.bypass):
            try:
                new = change(name).document
            except SpikeblocksError:
                continue
            after = write_document(model, new)
            assert same(model_of(after, path).document, new)
            assert [each for each in comments if each in after] == comments
        after = write_document(model, delete_block(model.document, name))
        assert same(model_of(after, path).document, delete_block(model.document, name))


def test_what_only_another_file_can_say_is_refused(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(TEXT, encoding="utf-8")
    model = model_of("extends: base.yaml\n", tmp_path / "own.yaml")
    entries = graph_of(model).document.get("blocks")
    untyped = entries.get("g").with_item("type", None)
    changed = model.document.with_item("blocks", entries.with_item("g", untyped))
    with pytest.raises(UsageError, match="another file"):
        write_document(model, changed)


@pytest.mark.parametrize("path", PATHS[::9], ids=lambda path: path.stem)
def test_a_number_is_replaced_where_it_is_written(path: Path) -> None:
    """Of each number of a file only its own characters change, and the file then says the new."""
    model = Model(path.read_text("utf-8"), path, SURROUNDINGS)
    for names, item in numbers(model.root, ()):
        text = write_entries(model, {names: 0.125})
        before, after = model.text.source[: item.start], model.text.source[item.end :]
        assert text == f"{before}0.125{after}"
        assert yaml_at(text, names) == 0.125


def numbers(item: YamlItem, names: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], YamlItem]]:
    is_plain = item.kind == "scalar" and not item.quoted
    if is_plain and type(parse_scalar(item.value)) in (int, float):
        yield names, item
    for i, inner in enumerate(item.items):
        yield from numbers(inner, (*names, str(i) if item.kind == "list" else inner.key))


def yaml_at(text: str, names: tuple[str, ...]) -> Any:
    value: Any = parse_yaml(text, "test").plain()
    for name in names:
        value = value[int(name)] if isinstance(value, list) else value[name]
    return value
