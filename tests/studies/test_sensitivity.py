"""Claims over gains: the intervals of shares, and the page's rows."""

from __future__ import annotations

import random

import pytest
from scipy import stats

from tests.studies import __main__ as page
from tests.studies import sensitivity


@pytest.mark.parametrize(("held", "runs"), [(0, 20), (1, 20), (13, 20), (20, 20), (2, 3)])
def test_intervals_of_shares_are_wilsons(held: int, runs: int) -> None:
    expected = stats.binomtest(held, runs).proportion_ci(method="wilson")
    assert sensitivity.wilson(held, runs) == pytest.approx(tuple(expected), abs=1e-7)


def test_settings_are_drawn_inside_their_ranges_and_again_the_same() -> None:
    first = [sensitivity.drawn(random.Random(3)) for _ in range(2)]
    assert first[0] == first[1]
    rng = random.Random(4)
    one = first[0]
    for _ in range(200):
        one = sensitivity.near(one, rng)
        for name, (low, high) in sensitivity.RANGES.items():
            assert low <= getattr(one, name) <= high
        assert abs(one.bias) <= sensitivity.BIAS
        assert one.dt * 1000 == pytest.approx(round(one.dt * 1000))


@pytest.mark.slow
def test_a_row_of_the_page_is_what_the_runs_say(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensitivity, "GAINS", (0.3,))
    ((q, *cells),) = sensitivity.gain_rows()
    assert f"| {' | '.join((q, *cells))} |" in page.PAGE.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_search_counts_the_claims_that_hold() -> None:
    said = " ".join(sensitivity.searched(number=6, steps=5).split())
    assert "6 settings were drawn at random, and 5 more around the best ones" in said
    assert "None was found." in said
