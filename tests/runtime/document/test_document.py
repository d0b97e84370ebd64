"""The strict reading of YAML: scalars, places, refusals, and writing what reads back equal."""

from __future__ import annotations

import math
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from runtime.document.node import Node, dump_yaml, from_python, parse_yaml
from runtime.document.parse_errors import MAX_DEPTH
from runtime.errors import GraphError, Where

# YAML 1.2.2, 10.3.2 (core schema); the third column is what stock PyYAML (YAML 1.1) makes of it.
SCALARS: list[tuple[str, Any, Any]] = [
    ("1e-3", 0.001, "1e-3"),
    ("1E+3", 1000.0, "1E+3"),
    ("1.e5", 100000.0, "1.e5"),
    (".5", 0.5, 0.5),
    ("+12e03", 12000.0, "+12e03"),
    ("-0.0", -0.0, -0.0),
    ("010", 10, 8),
    ("0o14", 12, "0o14"),
    ("0x3A", 58, 58),
    ("0b11", "0b11", 3),
    ("1_000", "1_000", 1000),
    ("12:30", "12:30", 750),
    ("on", "on", True),
    ("no", "no", False),
    ("y", "y", "y"),
    ("true", True, True),
    ("False", False, False),
    ("null", None, None),
    ("~", None, None),
    (".inf", math.inf, math.inf),
    ("-.INF", -math.inf, -math.inf),
    ("+.inf", math.inf, math.inf),
    ("inf", "inf", "inf"),
    ("nan", "nan", "nan"),
    ("1e", "1e", "1e"),
    ("3 m", "3 m", "3 m"),
    ("'3'", "3", "3"),
    ('"true"', "true", "true"),
    ("1e-320", 1e-320, "1e-320"),
]


@pytest.mark.parametrize(("text", "value", "stock"), SCALARS, ids=[row[0] for row in SCALARS])
def test_scalars_of_the_core_schema(text: str, value: Any, stock: Any) -> None:
    read = parse_yaml(f"a: {text}", "f").plain()["a"]
    assert type(read) is type(value)
    assert read == value
    assert yaml.safe_load(f"a: {text}")["a"] == stock
    if value == 0.0:
        assert math.copysign(1.0, read) == math.copysign(1.0, value)


@pytest.mark.parametrize("text", [".nan", ".NaN", ".NAN"])
def test_nan(text: str) -> None:
    assert math.isnan(parse_yaml(text, "f").value)


def test_dates_are_texts() -> None:
    assert parse_yaml("2020-01-01", "f").value == "2020-01-01"


REFUSED = {
    "": "f: the file is empty",
    "# only a comment\n": "f: the file is empty",
    "a: 1\n---\nb: 2\n": "f:2:1: a second document; expected one per file",
    "a: 1\nb: {a: 1, a: 2}\na: 3\n": (
        "f:2:11: b.a: duplicate key, first in line 2; keep one\n"
        "f:3:1: a: duplicate key, first in line 1; keep one"
    ),
    "a: !!float 1\nb: !x [1]\n": (
        "f:1:4: a: tag '!!float': a graph contains plain data only; remove it\n"
        "f:2:4: b: tag '!x': a graph contains plain data only; remove it"
    ),
    "!!str a: 1": "f:1:1: tag '!!str': a graph contains plain data only; remove it",
    "a: {<<: {b: 1}}": (
        "f:1:5: a: YAML 1.2 has no merge keys; write the entries out, or use extends"
    ),
    "? [a]\n: 1\n": "f:1:3: a key must be a string",
    "? \n: 1\n": "f:1:2: a key must be a string",
    "a: [1, 1e400]": "f:1:8: a[1]: 1e400 is too large for a float; infinity is written .inf",
    "a: 1e-400": "f:1:4: a: 1e-400 is too small for a float; write 0 if that is intended",
    "a: " + "9" * 5000: (
        f"f:1:4: a: {'9' * 40} is too large for a float; infinity is written .inf"
    ),
    "a: 1" + "0" * 309: (
        f"f:1:4: a: 1{'0' * 39} is too large for a float; infinity is written .inf"
    ),
    "a: {type:Sum}": "f:1:5: a: a space is missing after the colon: type: Sum",
    "a: *b": "f:1:4: a: alias '*b' is not defined above",
    "a: &b [1, *b]": "f:1:11: a[1]: alias '*b' refers to itself",
    "\ta: 1": "f:1:1: not valid YAML: a tab; indent with spaces",
    "a:\n  b: 1\n\tc: 2\n": "f:3:1: not valid YAML: a tab; indent with spaces",
    "a: @b": "f:1:4: not valid YAML: a string cannot begin with @; put it in quotes",
    "a: 'b\nc: 1\n": "f:1:4: not valid YAML: the quote that opens here is never closed",
    "a: {b: 1\nc: 2\n": "f:1:4: not valid YAML: this '{' is not closed",
    "a: [1, 2\nc: 2\n": "f:1:4: not valid YAML: this '[' is not closed",
    "a: {b: 1 c: 2}": (
        "f:1:11: not valid YAML: expected ',' or '}'; a string that contains ': ' needs quotes: "
        'b: "1 c: 2"'
    ),
    "a: {u: b.out[0]}": "f:1:13: not valid YAML: inside of braces, a string with brackets needs "
    'quotes: "b.out[0]"',
    "a: {f: 2*u[0] + u[1], c: 1}": "f:1:11: not valid YAML: inside of braces, a string with "
    'brackets needs quotes: "2*u[0] + u[1]"',
    "a: b: c": "f:1:5: not valid YAML: a string that contains ': ' needs quotes: a: \"b: c\"",
    "a:\n  b c\n  d: e": (
        "f:3:4: not valid YAML: an unexpected ':'; quote a string that contains ': ', or check the "
        "indentation"
    ),
    "a:\n  b: 1\n c: 2\n": (
        "f:3:2: not valid YAML: this does not fit the lines above; check its indentation, and the "
        "quotes before it"
    ),
    "a: 1\n-b\nc: 1\n": (
        "f:2:1: not valid YAML: this line has no ': '; write 'key: value', or '- ' before an item "
        "of a list"
    ),
    "a: x\x07y": "f:1:5: character U+0007 is not allowed; remove it",
    "é: 1\nb: \0": "f:2:4: character U+0000 is not allowed; remove it",
    "a: \udcff": "f:1:4: character U+DCFF is not allowed; remove it",
}


@pytest.mark.parametrize(("text", "message"), REFUSED.items(), ids=[repr(t)[:30] for t in REFUSED])
def test_refusals_name_the_place(text: str, message: str) -> None:
    with pytest.raises(GraphError) as caught:
        parse_yaml(text, "f")
    assert str(caught.value) == message


def test_what_was_wrong_before_a_syntax_error_is_told_too() -> None:
    with pytest.raises(GraphError) as caught:
        parse_yaml("a: 1\na: 2\nb: 1e999\nc: [", "f")
    assert [(p.where.line, p.where.column) for p in caught.value.problems] == [
        (2, 1),
        (3, 4),
        (4, 5),
    ]


def test_every_node_knows_its_place() -> None:
    root = parse_yaml("# title\na:\n  é: {x: [1, two]}\nb: &n 3\nc: *n\n", "f")

    def place(node: Node | None, key: bool = False) -> tuple[int, int]:
        assert node is not None
        where = node.key if key else node.where
        assert where.file == "f"
        return where.line, where.column

    inner = root.value["a"].value["é"]
    assert place(root) == (2, 1)
    assert place(root.get("a"), key=True) == (2, 1)
    assert place(inner, key=True) == (3, 3)
    assert place(inner) == (3, 6)
    assert place(inner.get("x")) == (3, 10)
    assert place(inner.get("x").value[1]) == (3, 14)
    assert place(root.get("c")) == (5, 4)
    assert root.plain() == {"a": {"é": {"x": [1, "two"]}}, "b": 3, "c": 3}


def test_crlf_and_marks_of_documents_are_fine() -> None:
    assert parse_yaml("---\r\na: 1\r\nb:\r\n- 2\r\n...\r\n", "f").plain() == {"a": 1, "b": [2]}


@pytest.mark.parametrize("opening", ["[", "{a: "])
def test_nesting_is_bounded(opening: str) -> None:
    with pytest.raises(GraphError, match=f"nested more than {MAX_DEPTH} deep"):
        parse_yaml(opening * 100_000, "f")


def test_aliases_that_explode_are_refused() -> None:
    text = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 9)
    )
    with pytest.raises(GraphError, match="aliases expand to more than 250000 values"):
        parse_yaml(text, "f")


SCALAR = (
    st.none()
    | st.booleans()
    | st.integers(-(10**300), 10**300)
    | st.floats(allow_nan=False)
    | st.text()
    | st.sampled_from([row[0] for row in SCALARS])
    | st.sampled_from(["<<", "=", "1e400", "- a", "a: b", "# x", "&a", "*a", "!x", "%", "@", "---"])
    | st.sampled_from(
        ["\n", "\t", " a", "a ", "\u2028", "\x85", "\ufeff", "\x00", "\x1b", "?", "'"]
    )
)
KEY = st.text() | st.sampled_from(["<<", "", "null", "on", "1", "a.b", "k: v", "x" * 2000])
PLAIN = st.recursive(
    SCALAR,
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(KEY, inner, max_size=5),
    max_leaves=20,
)


@given(PLAIN)
def test_what_is_written_reads_back_equal(value: Any) -> None:
    assert parse_yaml(dump_yaml(value), "f").plain() == value
    assert from_python(value).plain() == value


@given(st.dictionaries(st.from_regex(r"[a-z]{1,8}", fullmatch=True), PLAIN))
def test_others_read_numbers_and_texts_alike(value: dict[str, Any]) -> None:
    """What we write means the same to a YAML 1.1 reader, so that other tools can use it."""
    assert yaml.safe_load(dump_yaml(value)) == value


@given(st.text())
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        parse_yaml(text, "f")
    except GraphError as error:
        assert error.problems
        assert all(problem.where.file == "f" for problem in error.problems)


PYTHON = {
    "object": (object(), "a.b: expected a number, string, list or mapping, got object"),
    "key": ({1: 2}, "a.b: expected a string as key, got 1"),
    "too large": (10**400, "a.b: too large for a float; infinity is written .inf"),
    "surrogate": ("\ud800", "a.b: a string with a lone surrogate, which is not a character"),
}


@pytest.mark.parametrize("case", PYTHON.values(), ids=PYTHON.keys())
def test_python_values_that_no_yaml_can_hold(case: tuple[Any, str]) -> None:
    with pytest.raises(GraphError) as caught:
        from_python({"a": {"b": case[0]}})
    assert str(caught.value) == case[1]


def test_python_values_that_contain_themselves() -> None:
    endless: list[Any] = []
    endless.append(endless)
    with pytest.raises(GraphError, match=f"nested more than {MAX_DEPTH} deep"):
        from_python({"a": endless})


def test_arrays_become_lists() -> None:
    np = pytest.importorskip("numpy")
    node = from_python({"a": np.array([1.5, 2.0]), "b": np.int64(3), "c": (1, 2)}, Where("set"))
    assert node.plain() == {"a": [1.5, 2.0], "b": 3, "c": [1, 2]}
    assert node.value["a"].value[0].where == Where("set")


@pytest.mark.parametrize("line_break", ["\n", "\r", "\r\n", "\x85", "\u2028"])
def test_every_line_break_of_yaml_counts(line_break: str) -> None:
    with pytest.raises(GraphError) as caught:
        parse_yaml(f"a: 1{line_break}b: \0", "g.yaml")
    [problem] = caught.value.problems
    assert (problem.where.line, problem.where.column) == (2, 4)
