"""Differences of documents: merged over the old one, each gives the new one."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.document import changed_paths, difference, from_python, merge, read_graph

KEYS = st.sampled_from(["blocks", "plots", "world", "type", "kind", "part", "a", "b", "wires"])
SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(-2, 2), st.sampled_from([0.0, 1.0, 2.5, "Gain", "Sine"])
)
TREES = st.dictionaries(
    KEYS,
    st.recursive(
        SCALARS,
        lambda inner: st.one_of(
            st.lists(inner, max_size=2), st.dictionaries(KEYS, inner, max_size=4)
        ),
        max_leaves=12,
    ),
    max_size=5,
)


def exact(value: Any) -> Any:
    """A value in which 1, 1.0 and True differ, and the order of entries does not count."""
    if isinstance(value, dict):
        return {key: exact(item) for key, item in value.items()}
    return [*map(exact, value)] if isinstance(value, list) else (type(value).__name__, value)


@given(TREES, TREES)
def test_merged_over_the_old_document_it_gives_the_new_one(old: Any, new: Any) -> None:
    one, other = from_python(old), from_python(new)
    try:
        found = difference(one, other)
    except ValueError:
        return
    assert exact(merge(one, found).plain()) == exact(new)


@given(TREES, TREES)
def test_what_a_merge_makes_is_found_again(old: Any, top: Any) -> None:
    one = from_python(old)
    new = merge(one, from_python(top))
    try:
        found = difference(one, new)
    except ValueError as error:  # a null that stood where nothing was to be deleted
        assert "null" in str(error) or "type" in str(error)
        return
    assert exact(merge(one, found).plain()) == exact(new.plain())


@given(TREES)
def test_nothing_is_changed_by_the_same_document(tree: Any) -> None:
    assert difference(from_python(tree), from_python(tree)).plain() == {}


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ({"a": 1}, {"a": 1.0}, {"a": 1.0}),
        ({"a": {"b": 1, "c": 2}}, {"a": {"b": 1}}, {"a": {"c": None}}),
        (
            {"blocks": {"a": {"type": "Gain", "gain": 1}}},
            {"blocks": {"a": {"type": "Sine", "gain": 1}}},
            {"blocks": {"a": {"type": "Sine", "gain": 1}}},
        ),
        ({"world": {"room": [1]}}, {"world": {"room": [2]}}, {"world": {"room": [2]}}),
    ],
)
def test_it_has_no_more_than_what_changes(old: Any, new: Any, expected: Any) -> None:
    assert exact(difference(from_python(old), from_python(new)).plain()) == exact(expected)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({"a": 1}, {"a": None}),
        ({"blocks": {"a": {"type": "Gain"}}}, {"blocks": {"a": {"gain": 1}}}),
    ],
)
def test_what_no_merge_makes_is_refused(old: Any, new: Any) -> None:
    with pytest.raises(ValueError, match="'a'"):
        difference(from_python(old), from_python(new))


def test_paths_of_a_change() -> None:
    old, new = read_graph("line_actuator_failure")[0], read_graph("sine_estimation_error")[0]
    for path, node in changed_paths(difference(old, new)):
        entry: Any = new
        for name in path:
            entry = entry.get(name) if entry is not None else None
        assert (entry is None) == (node.value is None)
