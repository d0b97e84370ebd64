"""Statistics on data whose answers are printed in books."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.experiments.analysis.comparison import (
    compare,
    comparison_table,
    legend,
)
from runtime.experiments.analysis.statistics import (
    benjamini_hochberg,
    difference,
    estimate,
    fewest,
    is_same_run,
    mcnemar_test,
)
from runtime.experiments.analysis.words import half_width

# Hours of sleep gained by ten patients under two drugs (Student 1908, Biometrika 6, 1-25).
FIRST = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]
SECOND = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4]


def test_paired_t_on_students_own_data() -> None:
    found = difference(SECOND, FIRST)
    assert found.n == 10
    assert found.mean == pytest.approx(1.58)
    assert found.p == pytest.approx(0.002833, abs=5e-7)
    assert (found.low, found.high) == pytest.approx((0.7001142, 2.4598858), abs=5e-8)


def test_the_interval_of_a_mean() -> None:
    # n = 4, s = sqrt(5/3): half a width is t(0.975, 3) s / 2 with t = 3.1824463.
    found = estimate([1.0, 2.0, 3.0, 4.0])
    half = 3.1824463 * math.sqrt(5.0 / 3.0) / 2.0
    assert (found.mean, found.low, found.high) == pytest.approx((2.5, 2.5 - half, 2.5 + half))


def test_a_bootstrap_and_its_permutations() -> None:
    found = difference(SECOND, FIRST, "bootstrap")
    # Nine patients slept longer and one as long: of 2^10 ways to flip signs, only those that
    # flip none of the nine, or all of them, are as extreme.
    assert found.p == pytest.approx(4 / 2**10)
    assert found.mean == pytest.approx(1.58)
    assert 0.7 < found.low < 1.3 and 2.0 < found.high < 3.2
    assert difference(SECOND, FIRST, "bootstrap") == found


def test_only_seeds_that_have_both_values_are_paired() -> None:
    holes = [*SECOND, None, 5.0]
    found = difference(holes, [*FIRST, 3.0, None])
    assert found == difference(SECOND, FIRST)


def test_too_few_and_too_equal() -> None:
    assert estimate([]).n == 0 and math.isnan(estimate([]).mean)
    assert estimate([3.0]).mean == 3.0 and math.isnan(estimate([3.0]).low)
    same = difference([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])
    assert (same.mean, same.p) == (0.0, 1.0)
    # Equal values tell nothing about their scatter: no interval, and only signs can be tested.
    assert math.isnan(same.low) and math.isnan(same.high)
    shifted = difference([1.1, 2.1, 3.1], [1.0, 2.0, 3.0])
    assert shifted.mean == pytest.approx(0.1) and math.isnan(shifted.low)
    assert shifted.p == pytest.approx(2 / 2**3) and shifted.is_too_small
    assert math.isnan(difference([1.0], [2.0]).p)


@pytest.mark.parametrize("level", [0.5, 0.05, 0.01, 1e-4])
def test_the_fewest_pairs_that_an_exact_test_needs(level: float) -> None:
    needed = fewest(level)
    enough, less = ([1.0] * n for n in (needed, needed - 1))
    for test in (mcnemar_test, lambda a, b: difference(a, b, "bootstrap").p):
        assert test(enough, [None if test is mcnemar_test else 0.0] * needed) < level
        assert test(less, [None if test is mcnemar_test else 0.0] * (needed - 1)) >= level
    assert fewest() == 6


@given(st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=1, max_size=9))
def test_the_sign_test_counts_what_is_never_reached_as_worst(
    pairs: list[tuple[int, int]],
) -> None:
    """Values above 2 stand for infinity; p is that of all 2^n patterns of signs."""
    a, b = ([math.inf if v > 2 else float(v) for v in side] for side in zip(*pairs, strict=True))
    if all(map(math.isfinite, (*a, *b))):
        a[0] = math.inf
    found = difference(a, b)
    signs = [(x > y) - (x < y) for x, y in zip(a, b, strict=True)]
    size, total = len([s for s in signs if s]), abs(sum(signs))
    extreme = sum(abs(sum(p)) >= total for p in itertools.product((-1, 1), repeat=size))
    if len(pairs) > 1:
        assert found.p == pytest.approx(extreme / 2**size)
        assert found.pairs == len(pairs) and found.needed == 6
    finite = [x - y for x, y in zip(a, b, strict=True) if math.isfinite(x) and math.isfinite(y)]
    assert found.n == len(finite)
    assert found.n == 0 or found.mean == pytest.approx(np.mean(finite))


def test_one_run_repeated_is_one() -> None:
    found = estimate([3.89] * 20, is_same=True)
    assert (found.n, found.mean) == (1, 3.89) and math.isnan(found.low)
    apart = difference([3.89] * 20, [5.0] * 20, is_same=True)
    assert (apart.n, apart.pairs) == (1, 1) and math.isnan(apart.p) and not apart.is_too_small
    assert is_same_run(["ab", "ab"]) and not is_same_run(["ab", "cd"])
    assert not is_same_run(["ab"]) and not is_same_run(["", ""])


def test_an_interval_ends_where_the_quantity_does_and_covers_as_often() -> None:
    """The mean of exponential times is positive: cutting at 0 loses none of the coverage."""
    found = estimate([1.0, 16.0], ends=(0.0, math.inf))
    whole = estimate([1.0, 16.0])
    assert whole.low < -80.0 and (found.low, found.high) == (0.0, whole.high)
    rng = np.random.default_rng(3)
    for sample in rng.exponential(size=(300, 3)):
        cut, uncut = estimate(sample.tolist(), ends=(0.0, math.inf)), estimate(sample.tolist())
        assert (cut.low <= 1.0 <= cut.high) == (uncut.low <= 1.0 <= uncut.high)


def test_a_table_of_what_never_settles() -> None:
    values = {
        "baseline": {"settled": [3.0, 3.1, 3.3]},
        "never": {"settled": [math.inf] * 3},
        "once": {"settled": [math.inf, 3.2, 3.4]},
    }
    lines = compare(values, "baseline", ends={"settled": (0.0, math.inf)})
    text = comparison_table(lines, {}, {"settled": "never settled"})
    [never] = [line for line in text.splitlines() if line.startswith("  never ")]
    assert never.split() == [
        "never",
        "0/3",
        "never",
        "settled",
        "-",
        "-",
        "-",
        "too",
        "few",
        "seeds",
    ]
    assert "too few seeds to test (6 needed)" in legend(lines, "t")
    assert max(map(len, f"{text}\n{legend(lines, 't')}".splitlines())) <= 100
    six = {name: {"settled": found["settled"] * 2} for name, found in values.items()}
    tested = {line.variant: line for line in compare(six, "baseline")}
    assert tested["never"].verdict == "yes"
    assert tested["never"].difference is not None
    assert tested["never"].difference.p == pytest.approx(2 / 2**6)


def test_benjamini_and_hochbergs_own_example() -> None:
    # The 15 p values of their paper (1995, J. R. Statist. Soc. B 57, section 4.1): four are
    # rejected at 0.05, where Bonferroni rejects three.
    p = [
        *(0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459),
        *(0.3240, 0.4262, 0.5719, 0.6528, 0.7590, 1.0000),
    ]
    corrected = benjamini_hochberg(p)
    assert sum(value < 0.05 for value in corrected) == 4
    assert corrected[3] == pytest.approx(0.0095 * 15 / 4)
    with_hole = benjamini_hochberg([p[0], math.nan, *p[1:]])
    assert math.isnan(with_hole[1])
    assert with_hole[:1] + with_hole[2:] == corrected


def test_mcnemars_exact_test() -> None:
    # Six seeds have lost their value, none has gained one: 2 / 2^6.
    baseline = [1.0] * 10
    values = [None] * 6 + [1.0] * 4
    assert mcnemar_test(values, baseline) == pytest.approx(2 / 2**6)
    assert mcnemar_test(baseline, baseline) == 1.0


def test_false_alarms_are_as_rare_as_promised() -> None:
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(400, 2, 12))
    p = [difference(a.tolist(), b.tolist()).p for a, b in noise]
    # Binomial(400, 0.05): mean 20, standard deviation 4.4.
    assert 5 < sum(value < 0.05 for value in p) < 36


def test_a_table_with_all_that_can_happen() -> None:
    values = {
        "baseline": {"gain": FIRST, "settled": [1.0] * 10},
        "second": {"gain": SECOND, "settled": [None] * 9 + [1.0]},
        "cut": {"gain": [None] * 10, "settled": [1.0] * 10},
        "same": {"gain": FIRST, "settled": [1.0] * 10},
    }
    lines = compare(values, "baseline", removed={("cut", "gain")})
    found = {(line.variant, line.metric): line for line in lines}
    assert found["baseline", "gain"].difference is None
    assert found["second", "gain"].has_significant_difference is True
    # Five p values are corrected together; 0.002833 is the smallest but one.
    assert found["second", "gain"].p_adjusted == pytest.approx(0.002833 * 4 / 1, rel=0.6)
    lost = found["second", "settled"]
    assert lost.own.n == 1 and lost.has_significant_difference is None
    assert lost.has_significant_presence
    assert (
        found["cut", "gain"].is_removed and found["cut", "gain"].has_significant_difference is None
    )
    assert found["same", "gain"].has_significant_difference is False
    text = comparison_table(lines)
    assert "1/10" in text and "yes, in seeds" in text and "removed" in text and "equal" in text
    facts = lost.to_dict()
    assert facts["n"] == 1 and facts["low"] is None
    assert facts["difference"]["distinguishable"] is None
    assert facts["difference"]["p_presence"] < 0.05


def test_a_difference_over_some_of_the_seeds_says_so() -> None:
    values = {"baseline": {"rms": [1.0, None, 3.0, 4.0]}, "v": {"rms": [2.0, 2.0, None, 5.0]}}
    lines = compare(values, "baseline")
    shown = comparison_table(lines)
    # Both have three of four seeds, and only two of these together.
    assert [line.difference.n for line in lines if line.difference is not None] == [2]
    assert shown.count("3/4") == 2
    assert max(map(len, f"{shown}\n{legend(lines, 't')}".splitlines())) <= 80
    assert "+1 (2/4)" in shown
    assert "n/N: n of N seeds have a value (of a difference: both)" in legend(lines, "t")


def test_half_of_an_interval_is_shown_where_it_is_symmetric() -> None:
    symmetric = estimate(FIRST, "t")
    half = float(half_width(symmetric))
    assert half == pytest.approx(0.5 * (symmetric.high - symmetric.low), rel=0.05)
    skewed = replace(symmetric, high=symmetric.high + 1.0)
    assert half_width(skewed).startswith("[")
    assert half_width(estimate([1.0], "t")) == "-"
