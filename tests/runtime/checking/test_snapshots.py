"""Snapshots: equal for equal bits, different after any change."""

from __future__ import annotations

import copy
import itertools
import math
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.checking.bench import snapshot

leaves = st.one_of(st.floats(), st.integers(), st.text(), st.booleans(), st.none(), st.binary())
values = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.lists(inner), st.dictionaries(st.text(), inner), st.tuples(inner, inner)
    ),
)


class Thing:
    def __init__(self) -> None:
        self.parts = [1.0, {"a": np.zeros(2)}]


@given(values)
def test_a_copy_has_the_same_snapshot(value: Any) -> None:
    assert snapshot(copy.deepcopy(value)) == snapshot(value)
    hash(snapshot(value))


@given(values, values)
def test_equal_snapshots_are_equal_values(a: Any, b: Any) -> None:
    if snapshot(a) == snapshot(b):
        assert repr(a) == repr(b)


@pytest.mark.parametrize(
    ("value", "change"),
    [
        (np.zeros((2, 3)), lambda a: a.__setitem__((1, 2), 5e-324)),
        (np.array([1, 2]), lambda a: a.__setitem__(0, 3)),
        ([1.0, [2.0]], lambda a: a[1].append(3.0)),
        ({"a": {"b": 1}}, lambda a: a["a"].update(b=2)),
        ({1, 2}, lambda a: a.add(3)),
        (deque([1]), lambda a: a.append(2)),
        (bytearray(b"x"), lambda a: a.append(1)),
        (Thing(), lambda a: a.parts[1]["a"].fill(1.0)),
        (Thing(), lambda a: setattr(a, "new", 0)),
        (np.random.default_rng(0), lambda a: a.random()),
        (np.random.RandomState(0), lambda a: a.random_sample()),
        (np.random.SeedSequence(0), lambda a: a.spawn(1)),
        (itertools.count(), next),
        ([math.nan], lambda a: a.__setitem__(0, 1.0)),
        ([0.0], lambda a: a.__setitem__(0, -0.0)),
        ([1], lambda a: a.__setitem__(0, 1.0)),
        ([1], lambda a: a.__setitem__(0, True)),
    ],
)
def test_a_change_is_seen(value: Any, change: Callable[[Any], Any]) -> None:
    before = snapshot(value)
    assert snapshot(value) == before
    change(value)
    assert snapshot(value) != before


def test_functions_count_as_themselves() -> None:
    thing = Thing()
    thing.call = thing.__init__  # type: ignore[attr-defined, misc]
    assert snapshot(thing) == snapshot(thing)
    assert snapshot(math.sin) == snapshot(math.sin) != snapshot(math.cos)


def test_cycles_end() -> None:
    ring: list[Any] = [1.0]
    ring.append(ring)
    before = snapshot(ring)
    ring[0] = 2.0
    assert snapshot(ring) != before


def test_an_array_knows_its_shape_and_kind() -> None:
    zeros = [np.zeros(4), np.zeros((2, 2)), np.zeros(4, dtype=np.int64), np.zeros(8, np.float32)]
    assert len({snapshot(array) for array in zeros}) == 4
    assert snapshot(np.float32(1.0)) != snapshot(1.0) != snapshot(np.float64(1.0))
