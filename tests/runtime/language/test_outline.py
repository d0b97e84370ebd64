"""Outline, folding, formatting, inlay hints and lenses."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from runtime.document import parse_yaml
from runtime.language import Model, Span, apply_edits, folds, format_edits, hints, lenses, outline
from tests.runtime.language.texts import CASE_C, GRAPHS, SURROUNDINGS

# A busy machine generates slowly.
RELAXED = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])


def model_of(text: str, path: Path = CASE_C) -> Model:
    return Model(text, path, SURROUNDINGS)


@pytest.fixture(scope="module")
def case_c() -> Model:
    return model_of(CASE_C.read_text(encoding="utf-8"))


def test_the_outline_has_sections_with_their_entries(case_c: Model) -> None:
    symbols = {symbol.name: symbol for symbol in outline(case_c)}
    assert list(symbols)[:5] == ["graph", "run", "params", "world", "blocks"]
    blocks = {symbol.name: symbol for symbol in symbols["blocks"].inner}
    assert blocks["lqr"].detail == "LQR"
    assert blocks["lqr"].kind == "block"
    assert blocks["adaptive"].kind == "part"
    source = case_c.text.source
    assert source[slice(*blocks["lqr"].span)].endswith("v_r: $v_r, dt: 0.05}")
    for symbol in symbols.values():
        assert symbol.span.start <= symbol.name_span.start <= symbol.name_span.end
        for inner in symbol.inner:
            assert symbol.span.start <= inner.span.start <= inner.span.end <= symbol.span.end


def test_sections_parts_and_comments_fold(case_c: Model) -> None:
    lines = case_c.text.source.splitlines()
    found = {
        lines[first].strip(): (lines[last].strip(), kind) for first, last, kind in folds(case_c)
    }
    assert found["wires:"][0].startswith("plant: {command: fault.actual}")
    assert found["adaptive:"][1] is False
    assert found[lines[0]] == (lines[5], True)


@pytest.mark.parametrize("path", sorted(GRAPHS.rglob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_files_are_formatted(path: Path) -> None:
    assert format_edits(model_of(path.read_text(encoding="utf-8"), path)) == []


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("a: {x:   1,y: [1,2 ,3] }   # c", "a: {x: 1, y: [1, 2, 3]}    # c\n"),
        ("b:\n  x:   {a: 1}\n  long: {b: 1}\n", "b:\n  x: {a: 1}\n  long: {b: 1}\n"),
        (
            "b:\n  x:    {a: 1}\n  yy:   {b: 1}\n  longer: {b: 1}\n",
            "b:\n  x:      {a: 1}\n  yy:     {b: 1}\n  longer: {b: 1}\n",
        ),
        ("a: 'x  y'   \nb: 1  \n", "a: 'x  y'\nb: 1\n"),
        ("t: |\n  a   \n  b\n", "t: |\n  a   \n  b\n"),
        ("a: {x: , y: 1}\n", "a: {x: , y: 1}\n"),
        ("a: {x: 1\n", "a: {x: 1\n"),
        ("a: &n {x:   1}\nb: *n\n", "a: &n {x:   1}\nb: *n\n"),
    ],
)
def test_formatting(before: str, after: str) -> None:
    assert apply_edits(before, format_edits(model_of(before))) == after


@RELAXED
@given(
    st.lists(
        st.sampled_from(["{", "}", "[", "]", ", ", ": ", "a", "b1", "'q'", " ", "\n  ", "# c\n"]),
        max_size=25,
    )
)
def test_formatting_keeps_what_a_text_means(pieces: list[str]) -> None:
    text = "x: {k: v}\ny: " + "".join(pieces)
    model = model_of(text)
    result = apply_edits(text, format_edits(model))
    if not model.syntax:
        assert parse_yaml(result, "").plain() == parse_yaml(text, "").plain()
        again = model_of(result)
        assert apply_edits(result, format_edits(again)) == result


def test_hints_at_wires_and_params(case_c: Model) -> None:
    source = case_c.text.source
    found = {}
    for hint in hints(case_c, Span(0, len(source))):
        word = source[: hint.offset].split()[-1].strip("{[")
        found[word] = hint.label
    assert found["error.state"] == ": TrackingState, 20 Hz"
    assert found["fitter.path"] == ": Path(150), 10 Hz"
    assert found["$v_r"] == " = 0.2"
    blocks = source.index("blocks:")
    assert all(hint.offset <= blocks for hint in hints(case_c, Span(0, blocks)))


def test_lenses(case_c: Model) -> None:
    found = lenses(case_c)
    assert [lens.command for lens in found[:2]] == ["run", "diagram"]
    assert "adaptive" in {lens.block for lens in found if lens.command == "compare"}
    assert lenses(model_of("room: []\n", GRAPHS / "worlds" / "x.yaml")) == []
    assert lenses(model_of("[# x\ngraph: a\nblocks: {}\n", GRAPHS / "x.yaml")) == []
