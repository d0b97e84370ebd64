"""Contests: what tunings, conditions and seeds say of two contestants together."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from runtime.experiments.analysis.comparison import ComparisonLine, Questions, correct
from runtime.experiments.analysis.crossed import Contestant, crossed_difference
from runtime.experiments.tuning import agreement


def draws(seed: int, *shape: int) -> tuple[Contestant, Contestant]:
    rng = np.random.default_rng(seed)
    return Contestant(rng.normal(5.0, 1.0, shape), True), Contestant(
        rng.normal(5.0, 1.0, shape), True
    )


@given(st.integers(0, 999), st.integers(3, 9))
def test_of_given_controllers_it_is_the_paired_t_test_over_conditions(seed: int, n: int) -> None:
    a, b = (Contestant(one.values, is_tuned=False) for one in draws(seed, 1, n, 1))
    found = crossed_difference(a, b, is_skewed=False)
    known = stats.ttest_rel(a.values.ravel(), b.values.ravel())
    ends = known.confidence_interval()
    assert (found.p, found.low, found.high) == pytest.approx((known.pvalue, *ends))
    own = stats.ttest_1samp(a.values.ravel(), 0.0).confidence_interval()
    assert (a.estimate().low, a.estimate().high) == pytest.approx(tuple(own))


@given(st.integers(0, 999), st.integers(2, 6), st.integers(2, 6))
def test_where_only_tunings_differ_it_is_welchs_test(seed: int, few: int, many: int) -> None:
    """Under each of four conditions with each of two seeds the tunings have the same values."""
    rng = np.random.default_rng(seed)
    a, b = (rng.normal(size=(n, 1, 1)) + np.zeros((n, 4, 2)) for n in (few, many))
    found = crossed_difference(Contestant(a, True), Contestant(b, True), is_skewed=False)
    known = stats.ttest_ind(a[:, 0, 0], b[:, 0, 0], equal_var=False)
    ends = known.confidence_interval()
    assert (found.p, found.low, found.high) == pytest.approx((known.pvalue, *ends))


@given(st.integers(0, 999))
def test_exchanged_contestants_have_the_opposite_difference(seed: int) -> None:
    a, b = draws(seed, 3, 5, 2)
    for is_skewed in (False, True):
        for margin in (0.0, "10%"):
            one = crossed_difference(a, b, is_skewed, margin)
            other = crossed_difference(b, a, is_skewed, margin)
            assert one.p == pytest.approx(other.p) and one.is_negligible == other.is_negligible
            if is_skewed:
                assert (1.0 + one.low) * (1.0 + other.high) == pytest.approx(1.0)
            else:
                assert one.low == pytest.approx(-other.high)


def test_of_one_tuning_each_only_these_controllers_are_told_apart() -> None:
    a, b = draws(0, 1, 8, 2)
    a = Contestant(a.values + 5.0, True)
    found = crossed_difference(a, b)
    line = ComparisonLine("a", "e", 8, a.estimate(), found, reference="b")
    [line] = correct([line], Questions())
    assert line.verdict == "these controllers" and line.has_significant_difference is None
    facts = line.to_dict()["difference"]
    assert facts["p"] is facts["p_adjusted"] is facts["distinguishable"] is None
    assert facts["p_of_these"] < 0.001
    given = crossed_difference(Contestant(a.values, False), Contestant(b.values, False))
    assert not given.is_of_these


def test_a_graph_that_no_seed_changes_is_measured_once_however_often_it_is_tuned() -> None:
    a, b = (np.full((3, 1, 10), x) + np.arange(3.0)[:, None, None] for x in (0.0, 5.0))
    found = crossed_difference(Contestant(a, True, True), Contestant(b, True, True))
    assert (found.n, found.pairs, found.mean) == (1, 1, -5.0) and math.isnan(found.p)
    assert found.is_same and Contestant(a, True, True).estimate().n == 1


def test_a_tuning_that_failed_is_bad_and_not_infinite() -> None:
    a, b = draws(3, 5, 8, 2)
    values = a.values.copy()
    values[2] = math.inf
    failing = Contestant(values, True)
    own = failing.estimate()
    assert (own.n, own.never) == (8, 0) and math.isfinite(own.mean)
    found = crossed_difference(failing, b, is_skewed=False)
    # Each of its runs has the worst value of both contestants in its condition.
    both = np.concatenate([np.delete(values, 2, 0), b.values])
    capped = np.where(np.isinf(values), both.max(axis=(0, 2))[:, None], values)
    assert found.mean == pytest.approx(float(capped.mean() - b.values.mean()))
    assert math.isfinite(found.low) and math.isfinite(found.high)
    # Where more is better, the worst is the smallest.
    mirrored = crossed_difference(Contestant(-values, True), Contestant(-b.values, True), False)
    assert mirrored.mean == pytest.approx(-found.mean)
    # All runs failed: worse than all others, although no value of theirs says by how much.
    gone = Contestant(np.full((5, 8, 2), math.inf), True)
    assert gone.estimate().never == 8 and crossed_difference(gone, b).p < 0.01
    assert crossed_difference(gone, gone).is_equal


def test_tunings_that_failed_are_counted_beside_the_agreement_of_the_others() -> None:
    def facts(*scores: float | None) -> dict[str, object]:
        own = [{"metrics": {"e": score}, "values": {"p": 1.0}} for score in scores]
        return {"metrics": ["e"], "contestants": {"PID": own}}

    assert list(agreement(facts(1.0, 2.0))) == ["PID: e of 2 tunings from 1 to 2, a ratio of 2"]
    for bad in (None, math.nan, math.inf):
        [found] = agreement(facts(1.0, bad, 2.0))
        assert found.startswith("PID: e of 2 of 3 tunings from 1 to 2, a ratio of 2; 1 without a")
    [found] = agreement(facts(None, None))
    assert found.startswith("PID: e of none of 2 tunings; 2 without a value")
