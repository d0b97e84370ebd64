"""The tolerant scan: as the strict reader where a text parses, and useful where not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from runtime.document import Node, dump_yaml, parse_scalar, parse_yaml
from runtime.errors import Where
from runtime.language.cursor import cursor_at
from runtime.language.items import YamlItem
from runtime.language.scan import scan
from runtime.language.text import SourceText
from tests.runtime.language.texts import GRAPHS, MARK

# A busy machine generates slowly.
RELAXED = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])


def plain(item: YamlItem) -> Any:
    if item.kind == "map":
        return {inner.key: plain(inner) for inner in item.items}
    if item.kind == "list":
        return [plain(inner) for inner in item.items]
    if item.kind == "empty":
        return None
    return item.value if item.quoted else parse_scalar(item.value)


def places(text: SourceText, item: YamlItem, node: Node) -> None:
    """Keys and scalars stand where the strict reader says."""
    if item.kind == "map":
        for inner in item.items:
            found = node.get(inner.key)
            assert found is not None
            assert text.at(found.key) == inner.key_start
            if inner.kind == "scalar" or inner.flow:
                assert text.at(found.where) == inner.start
            places(text, inner, found)
    elif item.kind == "list":
        for inner, found in zip(item.items, node.value, strict=True):
            places(text, inner, found)


@pytest.mark.parametrize("path", sorted(GRAPHS.rglob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_graphs_scan_as_they_parse(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    root, node = scan(source), parse_yaml(source, str(path))
    assert plain(root) == node.plain()
    places(SourceText(source), root, node)


VALUES = st.sampled_from(
    [
        None,
        1,
        -0.5,
        "",
        "a: b",
        "x, y",
        "#",
        "'",
        '"',
        "\\",
        "{",
        [1, {"b": "#"}],
        {"k": ["-", "é🙂"]},
    ]
)
KEYS = st.from_regex("[a-z][a-z0-9_ ]{0,8}[a-z]", fullmatch=True)


@RELAXED
@given(st.dictionaries(KEYS, VALUES, max_size=5))
def test_what_the_writer_writes_scans_as_it_parses(value: dict[str, Any]) -> None:
    text = dump_yaml(value)
    assert plain(scan(text)) == parse_yaml(text, "x").plain() if value else True


@RELAXED
@given(st.text(alphabet=st.sampled_from("ab:-,{}[]'\"#&*|>% \n\r\t\x85é🙂0."), max_size=60))
def test_any_text_scans(source: str) -> None:
    root = scan(source)
    for item in root.walk():
        assert 0 <= item.start <= item.end <= len(source)
        assert item.key_start <= item.key_end <= len(source)


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("a: {x: S\n  b: {y: 1}", {"a": {"x": "S", "b": {"y": 1}}}),
        ("blocks:\n  a: {x: S\n  b: {y: 1}", {"blocks": {"a": {"x": "S"}, "b": {"y": 1}}}),
        ("a: [1, {b: , c", {"a": [1, {"b": None, "c": None}]}),
        ("a:\n  b: 'open\n  c: 2", {"a": {"b": "open", "c": 2}}),
        ("a:\n  typ\nb: 1", {"a": {"typ": None}, "b": 1}),
        ("a: ]\nb: 1", {"a": "]", "b": 1}),
        ("a:\n- 1\n- x: 2\n  y: 3\nb: 1", {"a": [1, {"x": 2, "y": 3}], "b": 1}),
        ("a: |\n  b: {\n  c\nd: 1", {"a": "b: {\n  c", "d": 1}),
        ("{a: 1, b: [x", {"a": 1, "b": ["x"]}),
    ],
)
def test_broken_texts_keep_what_can_be_seen(source: str, expected: Any) -> None:
    assert plain(scan(source)) == expected


@pytest.mark.parametrize(
    ("source", "role", "path", "prefix"),
    [
        ("¦", "key", (), ""),
        ("gr¦", "key", (), "gr"),
        ("run: {dt: ¦", "value", ("run", "dt"), ""),
        ("run: {dt: 1, ¦}", "key", ("run",), ""),
        ("run: {dt: 1, s¦}", "key", ("run",), "s"),
        ("blocks:\n  a: {type: S¦um}", "value", ("blocks", "a", "type"), "S"),
        ("blocks:\n  a:\n    ¦", "key", ("blocks", "a"), ""),
        ("blocks:\n  a: {type: S}\n  ¦\nwires:", "key", ("blocks",), ""),
        ("wires:\n  a: {t: [x.y, ¦\n  b: {}", "value", ("wires", "a", "t", "[]"), ""),
        ("wires:\n  a: {e: ¦\n  b: {t: 1}", "value", ("wires", "a", "e"), ""),
        ("probes:\n  p:\n    - x¦", "value", ("probes", "p", "[]"), "x"),
        ("p:\n  - a: 1\n    ¦", "key", ("p", "[]"), ""),
    ],
)
def test_the_cursor_knows_what_is_written(
    source: str, role: str, path: tuple[str, ...], prefix: str
) -> None:
    offset = source.index(MARK)
    text = SourceText(source.replace(MARK, ""))
    cursor = cursor_at(text, scan(text.source), offset)
    assert cursor is not None
    assert (cursor.role, cursor.path, cursor.prefix) == (role, path, prefix)


@pytest.mark.parametrize("source", ["# com¦", "a: 1   # no¦te", "a: {b: 1}  # ¦"])
def test_there_is_nothing_to_write_in_a_comment(source: str) -> None:
    text = SourceText(source.replace(MARK, ""))
    assert cursor_at(text, scan(text.source), source.index(MARK)) is None


@RELAXED
@given(st.text(alphabet="ab\n\r🙂é\x85\u2028", max_size=30), st.integers(0, 30))
def test_positions_of_editors_round_trip(source: str, offset: int) -> None:
    text = SourceText(source)
    offset = min(offset, len(source))
    line, units = text.position(offset)
    before = source[text.starts[line] : offset]
    assert units == len(before.encode("utf-16-le")) // 2
    inside = offset <= text.line_span(line).end
    assert text.offset(line, units) == (offset if inside else text.line_span(line).end)


def test_positions_of_messages_count_the_lines_of_yaml() -> None:
    text = SourceText("a: 1\u2028b: 2\nc: 3")
    assert text.at(Where("", 2, 1)) == 5
    assert text.at(Where("", 3, 1)) == 10
    assert text.where(10, "f") == Where("f", 3, 1)
