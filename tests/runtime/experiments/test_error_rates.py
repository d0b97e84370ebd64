"""The tests and intervals that tables print err as rarely as docs/experiments.md says."""

from __future__ import annotations

import math

import pytest

from tests.runtime.experiments.error_rates import BEGIN, DOCS, END, tables

FALSE_ALARM = 8.0  # %; five, and three standard errors of a thousand draws, for discrete counts
COVERED = 90.0  # %


def _cells(text: str) -> dict[tuple[str, str, bool], list[float]]:
    """The cells of both tables by their first two columns; the second table has intervals."""
    found, is_interval = {}, False
    for line in text.splitlines():
        is_interval |= line.startswith("| intervals")
        name, test, *cells = [part.strip() for part in line.strip("| ").split("|")] + [""] * 2
        if any(cell.replace(".", "").isdigit() for cell in cells):
            numbers = [math.nan if c == "–" else float(c) for c in cells if c]
            found[name, test, is_interval] = numbers
    return found


def check_choices(
    rows: dict[str, list[float]], every: dict[tuple[str, str, bool], list[float]]
) -> None:
    """Nominal values of contests, tunings, margins and fits, with three standard errors."""
    for (name, where, _), numbers in every.items():
        if name.startswith("equal") and name.endswith("called different"):
            assert max(numbers) <= 7.0, name
        if name == "equal: the interval covers":
            assert all(math.isnan(n) or 93.0 <= n <= 97.5 for n in numbers), where
        if name == "a fit":
            assert 93.0 <= numbers[0] <= 97.5, where
    assert max(rows["tune: called better"]) < 2.5 + 1.5
    assert max(rows["10 % more: larger"] + rows["10 % more: negligible"]) < 2.5 + 1.5
    # More tunings find more, also where some of them fail.
    for name, numbers in rows.items():
        if name.startswith("half the error"):
            assert numbers == sorted(numbers) and numbers[-1] > 45.0, name
    assert min(rows["equal: different by conditions alone"]) > 30.0


@pytest.mark.slow
def test_error_rates_and_coverage_are_those_of_the_document() -> None:
    computed = _cells("\n".join(tables()))
    document = DOCS.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]
    printed = _cells(document)
    assert computed.keys() == printed.keys()
    for key, numbers in computed.items():
        assert numbers == pytest.approx(printed[key], abs=0.5, nan_ok=True), key
        _, test, is_interval = key
        if "auto" not in test:
            continue
        if is_interval:
            assert all(math.isnan(n) or n > COVERED for n in numbers), key
        else:
            assert max(numbers) < FALSE_ALARM, key
    check_choices({name: numbers for (name, _, _), numbers in computed.items()}, computed)
    # What the rules are for: pooled runs and the surviving seeds alone mislead.
    assert min(computed["n conditions of 5 seeds, all runs pooled", "`t`", False]) > 20.0
    assert max(computed["n conditions of 5 seeds, as `tune` does", "`t`", False]) < FALSE_ALARM
    assert max(computed["fails with hard seeds: better as tested", "`auto`", False]) < 1.0
