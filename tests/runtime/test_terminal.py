from __future__ import annotations

import math

import pytest

from runtime.terminal import duration, number, short, table


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (12.34567, "12.35"),
        (123456.0, "1.235e+05"),
        (math.inf, "inf"),
        (math.nan, "-"),
        (None, "-"),
    ],
)
def test_a_number_has_four_significant_digits(value: float | None, text: str) -> None:
    assert number(value) == text


def test_a_number_shows_its_sign_where_that_is_asked_for() -> None:
    assert [number(value, "+") for value in (2.5, -2.5, None)] == ["+2.5", "-2.5", "-"]


def test_long_numbers_of_a_table_are_shortened() -> None:
    cells = ["0.8333333333333333", "1.1666666666666667e-05", "0.5", "12345678", "slow 0.83333333"]
    assert list(map(short, cells)) == ["0.833333", "1.16667e-05", "0.5", "12345678", cells[4]]


def test_columns_are_aligned_to_the_left_or_to_the_right() -> None:
    rows = [["name", "value", "note"], ["a", "10", ""], ["longer", "5", "x"]]
    assert table(rows, right=[1]).split("\n") == [
        "  name    value  note",
        "  a          10",
        "  longer      5  x",
    ]


def test_a_row_of_one_cell_is_a_heading_within_the_table() -> None:
    rows = [["", "mean"], ["a long heading"], ["x", "1"]]
    assert table(rows, right=[1], indent="").split("\n") == [
        "                mean",
        "a long heading",
        "x                  1",
    ]


def test_a_table_without_rows_is_empty() -> None:
    assert table([]) == ""


@pytest.mark.parametrize(
    ("seconds", "text"), [(41.6, "42 s"), (190.0, "3 min 10 s"), (7500.0, "2 h 5 min")]
)
def test_durations_are_in_whole_units(seconds: float, text: str) -> None:
    assert duration(seconds) == text
