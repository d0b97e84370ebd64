"""A table: columns, rows, groups of rows and notes; printed as lines, as markup, as plain values.

A cell is a string, a number (four digits; None and NaN are a dash), or a :class:`Cell`, which is
written by one function for all printers::

    Cell("0.21", 0.2134, note="2/3")    0.21 (2/3) on a terminal; on a page, 0.2134 in its tooltip
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from blocks.core import FloatArray, MissingPackageError, require
from runtime import terminal
from runtime.errors import MissingExtraError
from runtime.tables.markup import Html, element, join, scrolling

if TYPE_CHECKING:
    from pandas import DataFrame

NO_VALUE = "-"
EXTRA = "dataframes"
PADDING = "padding: 2px 8px; text-align:"  # of a cell in a notebook, which has no style of ours
Kind = Literal["text", "number", "long"]


@dataclass(frozen=True)
class Column:
    """One column.

    Parameters
    ----------
    title : above it; '' for none.
    kind : numbers are aligned right; long text wraps on a page.
    unit : of its numbers.
    key : its name in plain values; the title by default.
    """

    title: str
    kind: Kind = "text"
    unit: str = ""
    key: str = ""

    @property
    def name(self) -> str:
        """What it is called in plain values."""
        return self.key or self.title

    @property
    def heading(self) -> str:
        """The title with the unit, if it has one."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


@dataclass(frozen=True)
class Cell:
    """A value as it is written.

    Parameters
    ----------
    text : what is shown.
    value : the exact value, or the ends of an interval; on a page it is the tooltip.
    note : what follows, such as how many runs have a value.
    tone : how a page shows it.
    """

    text: str
    value: object = None
    note: str = ""
    tone: Literal["", "bad", "strong"] = ""

    def __str__(self) -> str:
        return f"{self.text} ({self.note})" if self.note else self.text


Row: TypeAlias = Sequence[object]


def number_cell(value: float | None, sign: str = "", unit: str = "", note: str = "") -> Cell:
    """A number in four digits, with its unit; a dash if there is none."""
    shown = terminal.number(value, sign)
    return Cell(NO_VALUE) if shown == NO_VALUE else Cell(f"{shown} {unit}".rstrip(), value, note)


def interval_cell(low: float, high: float, sign: str = "") -> Cell:
    """The ends of an interval; a dash if there is none."""
    if math.isnan(low) or math.isnan(high):
        return Cell(NO_VALUE)
    return Cell(f"[{terminal.number(low, sign)}, {terminal.number(high, sign)}]", [low, high])


@dataclass(frozen=True)
class Table:
    """Rows below columns, with a title above and notes below.

    Parameters
    ----------
    rows : a cell of each column.
    groups : rows with a name above each group, after the others.
    """

    columns: Sequence[Column]
    rows: Sequence[Row] = ()
    title: str = ""
    notes: Sequence[str] = ()
    groups: Mapping[str, Sequence[Row]] | None = None

    @classmethod
    def of(
        cls,
        titles: Sequence[str],
        rows: Sequence[Row],
        *,
        numbers: Container[int] = (),
        long: Container[int] = (),
    ) -> Table:
        """A table with these titles; ``numbers`` and ``long`` are the places of other kinds."""
        columns = [
            Column(title, "number" if i in numbers else "long" if i in long else "text")
            for i, title in enumerate(titles)
        ]
        return cls(columns, rows)

    @cached_property
    def parts(self) -> dict[str, Sequence[Row]]:
        """The rows by the name of their group, '' for those without one."""
        return ({"": self.rows} if self.rows else {}) | dict(self.groups or {})

    def append(self, title: str, cells: Sequence[object], kind: Kind = "text") -> Table:
        """The table with a further column, which has a cell of each row."""
        rows = [[*row, cell] for row, cell in zip(self.rows, cells, strict=True)]
        return replace(self, columns=[*self.columns, Column(title, kind)], rows=rows)

    def select(self, *names: str) -> Table:
        """The columns of these names, in this order."""
        places = {column.name: i for i, column in enumerate(self.columns)}
        chosen = [places[name] for name in names]

        def shorten(rows: Sequence[Row]) -> list[Row]:
            return [[row[i] for i in chosen] for row in rows]

        return replace(
            self,
            columns=[self.columns[i] for i in chosen],
            rows=shorten(self.rows),
            groups={name: shorten(rows) for name, rows in (self.groups or {}).items()},
        )

    def text(self, indent: str = "  ") -> str:
        """Lines of aligned columns, with two spaces between columns; rows of a group are indented.

        The title and the notes are not part of it.
        """
        lines: list[Sequence[str]] = [[column.heading for column in self.columns]]
        lines = lines if any(lines[0]) else []
        for name, rows in self.parts.items():
            lines += [[name]] * bool(name)
            for row in rows:
                first, *others = map(_text_of, row)
                lines.append([f"  {first}" if name else first, *others])
        numbers = [i for i, column in enumerate(self.columns) if column.kind == "number"]
        return terminal.table(lines, numbers, indent)

    def __str__(self) -> str:
        return "\n".join([*[self.title] * bool(self.title), self.text(), *self.notes])

    def records(self) -> list[dict[str, Any]]:
        """Each row by the names of the columns, with exact values."""
        names = [column.name for column in self.columns]
        return [
            dict(zip(names, map(_value_of, row), strict=False))
            for rows in self.parts.values()
            for row in rows
        ]

    def dataframe(self) -> DataFrame:
        """The rows for pandas (extra ``dataframes``), NaN for a number that is missing.

        Raises
        ------
        MissingExtraError : pandas is not installed.
        """
        records = self.records()
        columns = {}
        for column in self.columns:
            values = [record.get(column.name) for record in records]
            if column.kind == "number":
                values = [math.nan if value is None else value for value in values]
            columns[column.name] = values
        units = {column.name: column.unit for column in self.columns if column.unit}
        return dataframe(columns, units, "to_dataframe()")

    def html(self, label: str) -> Html:
        """A table that scrolls if it is wider than the page; the first cell of a row is its header.

        Parameters
        ----------
        label : a description for screen readers.
        """
        kinds = [_attributes(column) for column in self.columns]
        bodies = []
        for name, rows in self.parts.items():
            title = element("th", name, scope="rowgroup", colspan=str(len(self.columns)))
            above = [element("tr", title, class_="group")] if name else []
            bodies.append(element("tbody", *above, *(_html_row(row, kinds) for row in rows)))
        titles = [
            element("th", column.heading, scope="col", **kind)
            for column, kind in zip(self.columns, kinds, strict=True)
        ]
        top = element("thead", element("tr", *titles))
        return scrolling(element("table", top, "\n", *bodies), label)

    def notebook(self) -> Html:
        """The table with its title and notes, as a notebook shows it: without a style sheet."""
        heads = [column.heading for column in self.columns]
        sides = ["right" if column.kind == "number" else "left" for column in self.columns]
        lines = [_notebook_row("th", heads, sides)] * any(heads)
        for name, rows in self.parts.items():
            lines += [_notebook_row("th", [name], sides[:1])] * bool(name)
            lines += [_notebook_row("td", row, sides) for row in rows]
        title = element("b", self.title) if self.title else Html("")
        notes = (element("div", note) for note in self.notes)
        return join(title, element("table", *lines) if lines else Html(""), *notes)


def _text_of(cell: object) -> str:
    return terminal.number(cell) if cell is None or isinstance(cell, float) else str(cell)


def _value_of(cell: object) -> object:
    return cell.value if isinstance(cell, Cell) else cell


def _markup_of(cell: object) -> str:
    if isinstance(cell, Html):
        return cell
    if cell is None or isinstance(cell, float):
        cell = number_cell(cell)
    if not isinstance(cell, Cell):
        return "–" if cell == NO_VALUE else str(cell)
    if cell.text == NO_VALUE:
        return element("span", "–", title="no value")
    shown: str = cell.text
    if isinstance(cell.value, (int, float, list)):
        shown = element("span", cell.text.replace("-", "−"), title=repr(cell.value))
    if cell.tone:
        shown = element("strong", shown) if cell.tone == "strong" else _tone(shown, cell.tone)
    return join(shown, _tone(f" {cell.note}", "soft")) if cell.note else shown


def _tone(shown: str, tone: str) -> Html:
    return element("span", shown, class_=tone)


def _attributes(column: Column) -> dict[str, str]:
    names = {"number": "number", "long": "wrap"}
    return {"class_": names[column.kind]} if column.kind in names else {}


def _html_row(row: Row, kinds: Sequence[dict[str, str]]) -> Html:
    first, *others = map(_markup_of, row)
    cells = [element("th", first, scope="row", **kinds[0])]
    cells += [element("td", cell, **kind) for cell, kind in zip(others, kinds[1:], strict=True)]
    return element("tr", *cells)


def _notebook_row(tag: str, row: Row, sides: Sequence[str]) -> Html:
    cells = [
        element(tag, _markup_of(cell), style=f"{PADDING} {side}")
        for cell, side in zip(row, sides, strict=True)
    ]
    return element("tr", *cells)


def package(name: str, feature: str) -> ModuleType:
    """An optional package of tables.

    Raises
    ------
    MissingExtraError : it is not installed.
    """
    try:
        return require(name, feature, EXTRA)
    except MissingPackageError as error:
        raise MissingExtraError(error.feature, error.extra) from None


def dataframe(
    columns: Mapping[str, Sequence[object] | FloatArray], units: Mapping[str, str], feature: str
) -> DataFrame:
    """A table of columns; ``attrs["units"]`` has the units of those that have one.

    Raises
    ------
    MissingExtraError : pandas is not installed.
    """
    frame: DataFrame = package("pandas", feature).DataFrame(dict(columns))
    frame.attrs["units"] = dict(units)
    return frame
