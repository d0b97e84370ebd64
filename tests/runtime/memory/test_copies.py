"""Objects of every kind: put back in place after any change, and copied without a common part."""

from __future__ import annotations

import functools
import types
from collections import OrderedDict, defaultdict, deque
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.errors import NotCopiedError
from runtime.memory import Copier, Record, alike

NOWHERE = np.zeros(0)


class Plain:
    """Attributes in a dictionary."""

    def __init__(self, value: Any) -> None:
        self.value = value


class Slots:
    """Attributes in slots, one of them without a value."""

    __slots__ = ("unset", "value")

    def __init__(self, value: Any) -> None:
        self.value = value


class Named(dict):  # type: ignore[type-arg]
    """A dictionary with attributes."""


def closure(value: Any) -> Any:
    def get() -> Any:
        nonlocal value
        return value

    return get


def named(value: Any) -> Named:
    made = Named(a=value)
    made.name = [value]  # type: ignore[attr-defined]
    return made


leaves = st.one_of(st.floats(), st.integers(), st.text(max_size=3), st.none(), st.booleans())
arrays = st.lists(st.floats(), min_size=2, max_size=4).map(np.array)
views = arrays.map(lambda a: [a[:1], a[::-1], a])
generators = st.integers(0, 9).map(np.random.default_rng)


def around(inner: Any) -> Any:
    lists = st.lists(inner, max_size=3)
    return st.one_of(
        *(lists, lists.map(tuple), lists.map(deque), st.dictionaries(st.text(max_size=2), inner)),
        *(inner.map(Plain), inner.map(Slots), inner.map(closure), inner.map(named)),
        *(inner.map(lambda v: OrderedDict(a=v)), inner.map(lambda v: defaultdict(list, a=v))),
        *(inner.map(lambda v: functools.partial(Plain, v)), inner.map(lambda v: [v].append)),
        inner.map(lambda v: [v, v, {"again": v}]),
    )


objects = st.recursive(st.one_of(leaves, arrays, views, generators), around, max_leaves=8)


def disturb(record: Record) -> None:
    """Change everything that a record has found."""
    for value, _, _ in list(record.found.values()):
        if isinstance(value, (list, deque)):
            value.append("changed")
        elif isinstance(value, dict):
            value["changed"] = value
        elif isinstance(value, types.CellType):
            value.cell_contents = "changed"
        elif isinstance(value, np.random.Generator):
            value.random()
        elif isinstance(value, Slots):
            value.value = value.unset = "changed"  # type: ignore[attr-defined]
    for owner, _ in record.arrays.values():
        owner += 1.0


@given(objects)
def test_what_is_changed_is_put_back_twice(value: Any) -> None:
    before = Copier(None)(value)
    assert alike(value, before)
    record = Record({}, NOWHERE)
    record.add(value, "here")
    for _ in range(2):
        disturb(record)
        record.restore()
        assert alike(value, before)
        assert not any(map(record.has_changed, [*record.found, *record.arrays]))


@pytest.mark.parametrize("changed", [False, True])
def test_an_array_that_became_read_only_is_put_back(changed: bool) -> None:
    """A block may return an array that it keeps: from then on it is read-only."""
    kept = np.arange(3.0)
    record = Record({}, NOWHERE)
    record.add({"kept": kept}, "here")
    kept += 1.0 * changed
    kept.setflags(write=False)
    record.restore()
    assert kept.tolist() == [0.0, 1.0, 2.0]


@given(objects)
def test_a_copy_has_nothing_in_common_with_the_original(value: Any) -> None:
    made, again = Copier(None)(value), Copier(None)(value)
    record = Record({}, NOWHERE)
    record.add(value, "here")
    disturb(record)
    assert alike(made, again)
    copied = Record({}, NOWHERE)
    copied.add(made, "here")
    assert not copied.found.keys() & record.found.keys()
    assert not copied.arrays.keys() & record.arrays.keys()


def test_what_is_shared_is_shared_in_the_copy() -> None:
    array, items = np.arange(4.0), [1.0]
    one = {"a": items, "b": (items, [array, array[1:3]]), "add": items.append}
    one["self"] = one
    made = Copier(None)(one)
    made["add"](2.0)
    made["b"][1][0][1] = 9.0
    assert made["self"] is made and made["b"][0] is made["a"] == [1.0, 2.0]
    assert made["b"][1][1][0] == 9.0 and array[1] == 1.0 and items == [1.0]


def test_a_function_that_refers_to_itself_is_copied_once() -> None:
    def outer() -> Any:
        def down(k: int) -> Any:
            return down if k == 0 else down(k - 1)

        return down

    made = Copier(None)(outer())
    assert made(3) is made


@pytest.mark.parametrize(
    "value",
    [
        (k for k in range(3)),
        iter([1, 2]),
        enumerate([1]),
        map(abs, [1]),
        [zip([1], [2], strict=True)],
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_has_a_position_is_refused(value: Any) -> None:
    with pytest.raises(
        NotCopiedError, match=r"cannot be copied \(\w+: nobody can read where it is"
    ):
        Copier(None)(value)
    with pytest.raises(NotCopiedError, match="keeps in here what cannot be copied"):
        Record({}, NOWHERE).add(value, "here")
