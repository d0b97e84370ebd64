"""Limits on what a file of others may ask for: one table, which docs/security.md shows.

Out: numbers, each named and explained once. They are counts and sizes, not times, so that the same
file is refused everywhere.
"""

from __future__ import annotations

MIB, GIB = 2**20, 2**30

GRAPH_FILE = 16 * MIB
GRAPH_VALUES = 250_000  # each takes 300 bytes of memory, twice where a graph is checked
GRAPH_DEPTH = 50
GRAPH_LEVELS = 50  # files that extend or contain each other
GRAPH_WORK = 12 * GRAPH_VALUES  # enough to read, merge and fill in the largest document four times
GRAPH_BLOCKS = 20_000
GRAPH_ARRAYS = 2 * GIB  # as numbers of 8 bytes, which are held in memory
PROBLEMS = 1_000
EXPRESSION_LENGTH, EXPRESSION_DEPTH, EXPRESSION_WRITTEN = 2_000, 40, 20_000
INVERTED_SIDE = 64  # of a matrix that is inverted: n^3 operations
MODULE = 2 * MIB  # of lines that are kept for tracebacks: each takes 60 bytes
RECORDED, RECORDED_NUMBERS, RECORDED_COLUMNS = 64 * MIB, 4_000_000, 100_000
TEXT = 64 * MIB  # a quarter of it beyond ASCII, where Python takes four bytes a character
JSON_VALUES = 2_000_000
INDEX, LINE = GIB, 8 * MIB
SMALL_ARCHIVE, LARGEST_RATIO = 64 * MIB, 16
ARCHIVE_LIST = 8 * MIB  # of a zip archive's list of members: each takes up to 20 times as much


def size(count: int) -> str:
    """A number of bytes in its unit: ``64 MiB``."""
    return f"{count // GIB} GiB" if count >= GIB else f"{count // MIB} MiB"


TABLE: tuple[tuple[str, str], ...] = (
    ("one graph file", size(GRAPH_FILE)),
    (
        "values in one file, or in a graph with all that it extends, contains and repeats",
        f"{GRAPH_VALUES:,}",
    ),
    (
        "nesting of a value, and of a graph as it is written to its run folder (two levels a part)",
        f"{GRAPH_DEPTH}",
    ),
    ("files that extend or contain each other, one inside the other", f"{GRAPH_LEVELS}"),
    ("entries that are read, merged and substituted", f"{GRAPH_WORK:,}"),
    ("blocks, those of parts included", f"{GRAPH_BLOCKS:,}"),
    (
        "arrays of a graph (`weights: my.npz#w`), all together, in memory",
        size(GRAPH_ARRAYS),
    ),
    (
        "one expression: characters; levels; operations, with all that its indices run over",
        f"{EXPRESSION_LENGTH:,}; {EXPRESSION_DEPTH}; {EXPRESSION_WRITTEN:,}",
    ),
    ("rows of a matrix that an expression inverts", f"{INVERTED_SIDE}"),
    ("problems that are listed", f"{PROBLEMS:,}"),
    ("a Python file that a graph names (`module`)", size(MODULE)),
    (
        "a file of `FromFile`; its columns; the numbers that are used of it",
        f"{size(RECORDED)}; {RECORDED_COLUMNS:,}; {RECORDED_NUMBERS:,}",
    ),
    (
        "an archive's compressed members, all together, if that is more than "
        f"{LARGEST_RATIO} times the archive",
        size(SMALL_ARCHIVE),
    ),
    ("an archive's list of its members", size(ARCHIVE_LIST)),
    (
        "a text file of a run folder or an experiment; values in one of JSON",
        f"{size(TEXT)}; {JSON_VALUES:,}",
    ),
    ("an experiment's index.csv, a session's log; one line of it", f"{size(INDEX)}; {size(LINE)}"),
)
