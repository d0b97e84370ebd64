"""Statistics on data whose answers are printed in books."""

from __future__ import annotations

import itertools
import math
from collections.abc import Container, Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from runtime.experiments.analysis.comparison import ComparisonLine, Questions, Sample
from runtime.experiments.analysis.comparison import compare as compare_samples
from runtime.experiments.analysis.comparison_table import NARROW, comparison_table, legend
from runtime.experiments.analysis.estimates import (
    Margin,
)
from runtime.experiments.analysis.ranks import fewest, signed_rank_p, walsh_interval
from runtime.experiments.analysis.samples import slope_of
from runtime.experiments.analysis.statistics import (
    Test,
    Values,
    benjamini_hochberg,
    difference,
    estimate,
    is_same_run,
    mcnemar_test,
)
from runtime.experiments.analysis.words import half_width

# Hours of sleep gained by ten patients under two drugs (Student 1908, Biometrika 6, 1-25).
FIRST = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]
SECOND = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4]


ALL = Questions()


def compare(
    values: Mapping[str, Mapping[str, Values]],
    removed: Container[tuple[str, str]] = (),
    questions: Questions = ALL,
) -> list[ComparisonLine]:
    samples = {
        (metric, ""): {
            name: Sample(tuple(columns[metric]), is_removed=(name, metric) in removed)
            for name, columns in values.items()
        }
        for metric in values["baseline"]
    }
    return compare_samples(samples, "baseline", questions)


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


def test_signed_ranks_as_scipy_computes_them() -> None:
    apart = np.array(SECOND) - np.array(FIRST)
    found = difference(SECOND, FIRST, "ranks")
    assert found.p == pytest.approx(stats.wilcoxon(apart[apart != 0.0], method="exact").pvalue)
    rng = np.random.default_rng(5)
    for n in (6, 13, 50):
        data = rng.normal(0.2, 1.0, n)
        assert signed_rank_p(data) == pytest.approx(stats.wilcoxon(data, method="exact").pvalue)
    many = rng.normal(0.1, 1.0, 300)
    assert signed_rank_p(many) == pytest.approx(
        stats.wilcoxon(many, method="asymptotic", correction=False).pvalue, rel=1e-6
    )


@given(st.lists(st.integers(-4, 4), min_size=1, max_size=9))
def test_the_p_value_of_ranks_counts_all_patterns_of_signs(sizes: list[int]) -> None:
    """Sizes of 4 are infinite: they share the largest rank; differences of 0 are left out."""
    data = np.array([math.copysign(math.inf, v) if abs(v) == 4 else float(v) for v in sizes])
    ranks = stats.rankdata(np.abs(data[data != 0.0]))
    total = abs(float(ranks @ np.sign(data[data != 0.0])))
    signs = np.array(list(itertools.product((-1, 1), repeat=len(ranks))))
    expected = float(np.mean(np.abs(signs @ ranks) >= total - 1e-9)) if len(ranks) else 1.0
    assert signed_rank_p(data) == pytest.approx(expected)


def test_the_interval_of_ranks_holds_what_the_test_does_not_reject() -> None:
    data = np.array([0.3, 1.9, -0.4, 2.2, 1.1, 0.7, 3.9, 1.6])
    centre, low, high = walsh_interval(data, 0.05)
    assert low < centre < high
    for end, inside in ((low, 1.0), (high, -1.0)):
        assert signed_rank_p(data - (end + 1e-6 * inside)) > 0.05
        assert signed_rank_p(data - (end - 1e-6 * inside)) <= 0.05
    assert math.isnan(walsh_interval(data[:5], 0.05)[1])  # 2 / 2^5 is above 0.05


def test_what_auto_takes() -> None:
    normal = [1.1, 0.8, 1.3, 0.9, 1.0, 1.2]
    assert difference(normal, [1.0] * 6).scale == "t"
    assert difference([*normal[:5], math.inf], [1.0] * 6).scale == "ranks"
    times = [1.0, 1.1, 1.3, 1.2, 40.0, 1.4]
    assert difference(times, normal).scale == "log ranks"
    assert difference([-each for each in times], normal).scale == "ranks"
    assert difference(times[:4], normal[:4]).scale == "t"  # too few to judge
    assert difference(times[:4], normal[:4], is_skewed=True).scale == "log ranks"
    doubled = difference([2.0 * each for each in times], times)
    assert doubled.mean == pytest.approx(1.0) and doubled.p == pytest.approx(2 / 2**6)
    assert difference([1.0 + 1e-12] * 6, [1.0] * 6).is_equal


def test_a_variant_that_fails_on_the_hard_seeds_is_not_better() -> None:
    """It lowers the error wherever it survives, and fails where the baseline's is largest."""
    rng = np.random.default_rng(2)
    base = np.sort(rng.uniform(1.0, 2.0, 10))
    own = [*(base[:7] - 0.3).tolist(), math.inf, math.inf, math.inf]
    found = difference(own, base.tolist())
    assert found.p > 0.05 and (found.n, found.pairs) == (7, 10)
    # The interval is of all pairs: it does not exclude that a run typically fails.
    assert found.low == pytest.approx(-0.3) and found.high == math.inf
    assert found.is_too_small and found.against == 3
    assert difference(own[:7], base[:7].tolist()).p == pytest.approx(2 / 2**7)


def test_a_margin_says_what_is_too_small_to_count() -> None:
    rng = np.random.default_rng(0)
    base = rng.normal(10.0, 1.0, 20)
    small = base + 0.01 + rng.normal(0.0, 0.002, 20)
    large = base + 0.5 + rng.normal(0.0, 0.05, 20)
    values = {
        "baseline": {"e": base.tolist()},
        "a": {"e": small.tolist()},
        "b": {"e": large.tolist()},
    }
    plain = {line.variant: line.verdict for line in compare(values)}
    assert plain == {"baseline": "", "a": "yes", "b": "yes"}
    for margin in (0.1, "1%"):
        lines = compare(values, questions=Questions(margins={"e": margin}))
        assert {line.variant: line.verdict for line in lines} == {
            "baseline": "",
            "a": "negligible",
            "b": "yes",
        }


@given(st.integers(0, 200), st.sampled_from(["t", "ranks", "auto"]))
def test_a_share_as_margin_is_the_same_from_both_sides(seed: int, test: Test) -> None:
    """Half as much is as far from equal as twice as much."""
    rng = np.random.default_rng(seed)
    first, second = np.exp(rng.normal(0.0, 0.3, (2, 14)) + rng.normal(0.0, 1.0, 14)).tolist()
    share = Margin.of("25%")
    one, other = (
        difference(first, second, test, margin=share),
        difference(second, first, test, margin=share),
    )
    assert one.is_negligible == other.is_negligible
    assert one.p == pytest.approx(other.p, rel=1e-6)
    if one.scale == "log ranks":
        assert 1.0 + one.mean == pytest.approx(1.0 / (1.0 + other.mean))
        inside = 1.0 + one.low >= 1.0 / 1.25 and one.high <= 0.25
        assert one.is_negligible == inside


def test_a_difference_as_large_as_its_share_is_seldom_negligible() -> None:
    """Of these values the mean is 2.7 times the median: its share is not that of a ratio."""
    rng = np.random.default_rng(4)
    share, found = Margin.of("10%"), {"t": 0, "auto": 0}
    for _ in range(400):
        base = np.exp(rng.normal(0.0, 1.4, 20))
        own = 1.1 * base * np.exp(rng.normal(0.0, 0.02, 20))
        for test in found:
            found[test] += difference(own.tolist(), base.tolist(), test, margin=share).is_negligible
    assert max(found.values()) < 24  # 2.5 % of 400 are 10, with a standard deviation of 3.1


def test_failures_of_a_metric_without_direction_are_not_ranked() -> None:
    own = Sample((None, *FIRST[1:]), failed=1, is_unranked=True)
    base = Sample(tuple(SECOND))
    lines = compare_samples({("x", ""): {"baseline": base, "a": own}}, "baseline", ALL)
    assert lines[1].verdict == "failures not ranked" and lines[1].difference is not None
    assert math.isnan(lines[1].difference.mean) and math.isnan(lines[1].p_adjusted)
    assert "no direction" in legend(lines) and max(map(len, legend(lines).splitlines())) <= 100


def test_a_trend_through_runs_that_failed_is_the_limit_of_ever_larger_values() -> None:
    places, worst = [0.0, 1.0, 2.0, 5.0], math.inf
    for values in itertools.product((1.0, 2.5, worst), repeat=4):
        known = np.array(values)
        large = np.polyfit(places, np.where(np.isinf(known), 1e9, known), 1)[0]
        found = slope_of(places, values)
        if found is None:
            assert np.isinf(known).all()
        elif math.isinf(found):
            assert np.sign(found) == np.sign(large) and abs(large) > 1e6
        else:
            assert found == pytest.approx(large, abs=1e-6)
    assert slope_of(places, [1.0, None, 2.0, 3.0]) is None


def test_only_primary_metrics_that_can_differ_are_counted() -> None:
    """The p value of the one that matters is corrected for itself alone."""
    values = {
        "baseline": {"gain": FIRST, "same": FIRST, "other": FIRST},
        "drug": {"gain": SECOND, "same": FIRST, "other": SECOND},
    }
    lines = {line.metric: line for line in compare(values) if line.variant == "drug"}
    assert lines["same"].verdict == "equal" and math.isnan(lines["same"].p_adjusted)
    assert lines["gain"].p_adjusted == pytest.approx(0.002833, abs=5e-7)  # of two equal ones
    asked = Questions(primary=["gain"])
    lines = {line.metric: line for line in compare(values, questions=asked) if line.difference}
    assert lines["gain"].verdict == "yes" and lines["other"].verdict == "-"
    assert lines["other"].difference is not None and lines["other"].difference.low > 0.0


def test_contrasts_compare_variants_with_each_other() -> None:
    values = {"baseline": {"gain": FIRST}, "a": {"gain": FIRST}, "b": {"gain": SECOND}}
    lines = compare(values, questions=Questions(contrasts=[("b", "a")]))
    assert [line.title for line in lines] == ["baseline", "a", "b", "b - a"]
    assert lines[3].difference is not None and lines[3].difference.mean == pytest.approx(1.58)


def test_only_seeds_that_have_both_values_are_paired() -> None:
    holes = [*SECOND, None, 5.0]
    found = difference(holes, [*FIRST, 3.0, None])
    assert found == difference(SECOND, FIRST)


def test_too_few_and_too_equal() -> None:
    assert estimate([]).n == 0 and math.isnan(estimate([]).mean)
    assert estimate([3.0]).mean == 3.0 and math.isnan(estimate([3.0]).low)
    same = difference([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])
    assert same.mean == 0.0 and same.is_equal and math.isnan(same.p)
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
    for test in (mcnemar_test, lambda a, b: difference(a, b, "ranks").p):
        assert test(enough, [None if test is mcnemar_test else 0.0] * needed) < level
        assert test(less, [None if test is mcnemar_test else 0.0] * (needed - 1)) >= level
    assert fewest(0.05) == 6


def test_runs_that_failed_raise_the_number_of_pairs_that_are_needed() -> None:
    """Against n - 1 finite differences of the other sign, an infinite one has rank n."""
    for pairs in range(2, 14):
        finite = -np.arange(1.0, pairs)
        p = stats.wilcoxon(np.append(finite, 1000.0), method="exact").pvalue
        found = difference([*finite.tolist(), math.inf], [0.0] * pairs)
        assert found.p == pytest.approx(p)
        assert found.is_too_small == (p >= 0.05) == (pairs < found.needed)
    assert [fewest(0.05, against) for against in range(4)] == [6, 12, 17, 22]
    # With it on their side, six pairs are enough.
    assert difference([*(-finite).tolist()[:5], math.inf], [0.0] * 6).needed == 6


def test_two_pairs_are_no_yes() -> None:
    values = {"baseline": {"e": [1.0, 2.0]}, "a": {"e": [2.0, 3.000001]}}
    [line] = [line for line in compare(values) if line.difference]
    assert line.verdict == "too few pairs" and line.difference is not None
    assert math.isnan(line.difference.p) and math.isnan(line.difference.low)
    [line] = [x for x in compare(values, questions=Questions(margins={"e": 9.0})) if x.difference]
    assert line.verdict == "too few pairs"


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


def terminal_text(lines: list[ComparisonLine], never: Mapping[str, str] | None = None) -> str:
    return comparison_table(lines, {}, never).select(*NARROW).text("")


def test_a_table_of_what_never_settles() -> None:
    values = {
        "baseline": {"settled": [3.0, 3.1, 3.3]},
        "never": {"settled": [math.inf] * 3},
        "once": {"settled": [math.inf, 3.2, 3.4]},
    }
    lines = compare(values, questions=Questions(ends={"settled": (0.0, math.inf)}))
    text = terminal_text(lines, {"settled": "never settled"})
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
        "pairs",
    ]
    assert "too few pairs to test (6 needed)" in legend(lines)
    assert max(map(len, f"{text}\n{legend(lines)}".splitlines())) <= 100
    six = {name: {"settled": found["settled"] * 2} for name, found in values.items()}
    tested = {line.variant: line for line in compare(six)}
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
    lines = compare(values, {("cut", "gain")})
    found = {(line.variant, line.metric): line for line in lines}
    assert found["baseline", "gain"].difference is None
    assert found["second", "gain"].has_significant_difference is True
    # Only what can differ is corrected: the p values 0.002833, and 2 / 2^9 of nine lost values.
    assert found["second", "gain"].p_adjusted == pytest.approx(2 / 2**9)
    lost = found["second", "settled"]
    assert lost.own.n == 1 and lost.has_significant_difference is None
    assert lost.has_significant_presence
    assert (
        found["cut", "gain"].is_removed and found["cut", "gain"].has_significant_difference is None
    )
    assert found["same", "gain"].has_significant_difference is None
    text = terminal_text(lines)
    assert "1/10" in text and "yes, in seeds" in text and "removed" in text and "equal" in text
    facts = lost.to_dict()
    assert facts["n"] == 1 and facts["low"] is None
    assert facts["difference"]["distinguishable"] is None
    assert facts["difference"]["p_presence"] < 0.05


def test_a_difference_over_some_of_the_seeds_says_so() -> None:
    values = {"baseline": {"rms": [1.0, None, 3.0, 4.0]}, "v": {"rms": [2.0, 2.0, None, 5.0]}}
    lines = compare(values)
    shown = terminal_text(lines)
    # Both have three of four seeds, and only two of these together.
    assert [line.difference.n for line in lines if line.difference is not None] == [2]
    assert shown.count("3/4") == 2
    assert max(map(len, f"{shown}\n{legend(lines)}".splitlines())) <= 80
    assert "+1 (2/4)" in shown
    assert "n/N: n of N seeds have a value (of a difference: both)" in legend(lines)


def test_half_of_an_interval_is_shown_where_it_is_symmetric() -> None:
    symmetric = estimate(FIRST)
    half = float(half_width(symmetric))
    assert half == pytest.approx(0.5 * (symmetric.high - symmetric.low), rel=0.05)
    skewed = replace(symmetric, high=symmetric.high + 1.0)
    assert half_width(skewed).startswith("[")
    assert half_width(estimate([1.0])) == "-"
