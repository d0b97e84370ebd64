"""One table for all results: what it holds, and its printers.

In: rows of strings, numbers and :class:`Cell`. Out: lines for a terminal, markup for a page or a
notebook, plain values for JSON, a data frame for pandas::

    table = Table([Column("metric"), Column("mean", "number")], [["error [m]", 0.21]])
    table.text()       metric     mean
                       error [m]  0.21
    table.html("metrics")         <table>...      table.records()    [{"metric": ..., "mean": 0.21}]
"""

from runtime.tables.markup import (
    Html,
    bullets,
    element,
    facts,
    join,
    scrolling,
    text,
    visible,
)
from runtime.tables.table import (
    NO_VALUE,
    Cell,
    Column,
    Table,
    dataframe,
    interval_cell,
    number_cell,
    package,
)
