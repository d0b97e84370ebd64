"""A table shows the same rows on a terminal, on a page, in a notebook, in JSON and in pandas."""

from __future__ import annotations

import math

import pytest

from runtime.tables import (
    Cell,
    Column,
    Html,
    Table,
    element,
    interval_cell,
    join,
    number_cell,
    text,
)
from tests.browser import find, rows

COLUMNS = (
    Column("variant"),
    Column("mean", "number", unit="m"),
    Column("95 % interval", key="interval"),
    Column("note", "long"),
)
TABLE = Table(
    COLUMNS,
    title="two <variants>",
    notes=["a & b"],
    groups={
        "error": [
            ["base", number_cell(0.123456), interval_cell(-1.0, 2.0), ""],
            ["<soft>", number_cell(-2.0, note="2/3"), interval_cell(math.nan, math.nan), "x"],
        ]
    },
)


def test_text_is_escaped_and_markup_is_not() -> None:
    made = element("p", "<a> & 'b'", element("b", '"c"'), class_="x", aria_label='"><script>')
    assert made == (
        '<p class="x" aria-label="&quot;&gt;&lt;script&gt;">'
        "&lt;a&gt; &amp; &#x27;b&#x27;<b>&quot;c&quot;</b></p>"
    )
    assert join("<", Html("<br>"), "a\x00\u202eb") == "&lt;<br>a\ufffd\ufffdb"
    assert text("a\n\tb\u202f1") == "a\n\tb\u202f1"


def test_a_terminal_has_aligned_columns() -> None:
    assert TABLE.text("").split("\n") == [
        "variant   mean [m]  95 % interval  note",
        "error",
        "  base      0.1235  [-1, 2]",
        "  <soft>  -2 (2/3)  -              x",
    ]
    assert str(TABLE) == f"two <variants>\n{TABLE.text()}\na & b"


def test_titles_that_are_all_empty_are_no_line() -> None:
    assert Table.of(["", ""], [["x", 1.0], ["y", None]]).text("") == "x  1\ny  -"


def test_a_page_has_the_exact_values_in_tooltips() -> None:
    page = TABLE.html("both")
    assert rows(page, "both") == [
        ["error"],
        ["base", "0.1235", "[−1, 2]", ""],
        ["<soft>", "−2 2/3", "–", "x"],
    ]
    titles = [each.attributes.get("title") for each in find(page, "span")]
    assert titles == ["0.123456", "[-1.0, 2.0]", "-2.0", None, "no value"]
    assert [each.text for each in find(page, "td", class_="number")] == ["0.1235", "−2 2/3"]
    assert len(find(page, "td", class_="wrap")) == 2


def test_a_tone_is_shown_on_a_page_alone() -> None:
    made = Table.of(["a", "b"], [["x", Cell("yes", tone="strong")], ["y", Cell("0", tone="bad")]])
    assert made.text("") == "a  b\nx  yes\ny  0"
    page = made.html("tones")
    assert [each.text for each in find(page, "strong")] == ["yes"]
    assert [each.text for each in find(page, "span", class_="bad")] == ["0"]


def test_a_notebook_needs_no_style_sheet() -> None:
    shown = TABLE.notebook()
    assert shown.startswith("<b>two &lt;variants&gt;</b><table>")
    assert shown.endswith("</table><div>a &amp; b</div>")
    sides = [each.attributes["style"].rpartition(" ")[2] for each in find(shown, "td")]
    assert sides == ["left", "right", "left", "left"] * 2
    assert Table.of([], []).notebook() == ""


def test_plain_values_are_exact() -> None:
    first, second = TABLE.records()
    assert first == {"variant": "base", "mean": 0.123456, "interval": [-1.0, 2.0], "note": ""}
    assert second["mean"] == -2.0 and second["interval"] is None


def test_columns_are_selected_and_appended() -> None:
    chosen = TABLE.select("variant", "interval").text("")
    assert chosen.split("\n")[2:] == ["  base    [-1, 2]", "  <soft>  -"]
    longer = Table.of(["a"], [["x"], ["y"]]).append("n", [1, 2], "number")
    assert longer.text("") == "a  n\nx  1\ny  2"


def test_a_data_frame_has_units_and_gaps() -> None:
    pytest.importorskip("pandas")
    columns = [Column("name"), Column("mean", "number", unit="m")]
    frame = Table(columns, [["a", 1.5], ["b", None]]).dataframe()
    assert list(frame.columns) == ["name", "mean"] and frame.attrs["units"] == {"mean": "m"}
    assert frame["mean"][0] == 1.5 and math.isnan(frame["mean"][1])
