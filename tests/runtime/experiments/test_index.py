"""The index: rows whole or not at all, whatever happens to its writer."""

from __future__ import annotations

import csv
import math
import resource
import subprocess
import sys
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.errors import UsageError, one_line
from runtime.experiments.execution.index import Columns, Index, Row, csv_line, read_rows, remaining
from runtime.experiments.execution.trials import Configuration, GraphBundle, Trial
from runtime.experiments.execution.worker import TrialResult

COLUMNS = Columns(("a.b", "c"), ("rms", "final"))


def row(trial: int, cell: str = "1.0", seed: int = 0) -> Row:
    return Row(trial, (cell, "[1, 2]"), seed, "ok", "", (0.1, None), 0.25)


def checked(line: str, wall_s: str) -> str:
    """A line with its check, the CRC-32 of what stands before it as a line."""
    check = zlib.crc32(f"{line}\n".encode())
    return f"{line},{check:08x},{wall_s}\n"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    Index.create(tmp_path / "index.csv", COLUMNS)
    return tmp_path / "index.csv"


@pytest.fixture
def index(path: Path) -> Iterator[Index]:
    opened = Index(path, COLUMNS)
    yield opened
    opened.close()


FORMULAS = st.text("'=+-@\t01.e", max_size=6)
CELLS = st.text(st.characters(exclude_categories=("Cs",)), max_size=30).map(one_line) | FORMULAS
NUMBERS = st.none() | st.floats(allow_nan=False, allow_infinity=False)


@given(st.integers(0), CELLS, CELLS, CELLS, NUMBERS, NUMBERS)
def test_a_row_reads_back_equal_from_one_line(
    number: int, first: str, second: str, reason: str, a: float | None, b: float | None
) -> None:
    import csv

    written = Row(number, (first, second), 3, "failed", reason, (a, b), 0.5)
    line = COLUMNS.line(written)
    assert line.count("\n") == 1
    [fields] = csv.reader([line])
    assert COLUMNS.row(fields) == written
    for text in (*fields[1:3], fields[5]):
        assert text[:1] not in tuple("=+-@\t") or is_number(text)


def is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def test_numbers_are_written_as_they_are() -> None:
    line = COLUMNS.line(Row(0, ("-1.5", "+2"), 3, "ok", "-", (-0.5, None), 0.5))
    assert line == checked("0,-1.5,+2,3,ok,'-,-0.5,,", "0.5")
    never = Row(0, ("-1.5", "+2"), 3, "ok", "", (math.inf, None), 0.5, ("01ab", ""))
    line = COLUMNS.line(never)
    assert line == checked("0,-1.5,+2,3,ok,,inf,,01ab -", "0.5")
    [fields] = csv.reader([line])
    assert COLUMNS.row(fields) == never


def test_texts_of_any_length_are_read_and_long_reasons_shortened(path: Path) -> None:
    long = "x" * 1_000_000
    with path.open("a") as file:  # as indexes were written once
        file.write(COLUMNS.line(Row(0, ("1", "2"), 0, "failed", long, (None, None), 0.5)))
    trial = Trial(1, Configuration(0, ("1", "2"), GraphBundle("g")), 1)
    opened = Index(path, COLUMNS)
    opened.append(Row.of(trial, TrialResult("failed", long), COLUMNS.metrics))
    opened.close()
    first, second = read_rows(path, COLUMNS)
    assert first.reason == long
    assert second.reason == f"{long[:2000]}... (1000000 characters)"


def test_rows_are_appended_and_read(index: Index) -> None:
    index.append(row(1))
    index.append(row(0))
    assert [found.trial for found in index.rows()] == [1, 0]
    assert index.path.read_text().splitlines(keepends=True) == [
        "trial,a.b,c,seed,status,reason,rms,final,signals,check,wall_s\n",
        checked('1,1.0,"[1, 2]",0,ok,,0.1,,', "0.25"),
        checked('0,1.0,"[1, 2]",0,ok,,0.1,,', "0.25"),
    ]


def test_a_torn_line_is_cut_off_wherever_it_was_torn(path: Path) -> None:
    whole = path.read_bytes() + COLUMNS.line(row(0)).encode()
    line = COLUMNS.line(row(1)).encode()
    for cut in range(len(line)):
        path.write_bytes(whole + line[:cut])
        opened = Index(path, COLUMNS)
        assert [found.trial for found in opened.rows()] == [0]
        opened.append(row(2))
        opened.close()
        assert [found.trial for found in read_rows(path, COLUMNS)] == [0, 2]


def test_only_one_process_writes(path: Path, index: Index) -> None:
    with pytest.raises(UsageError, match="is being written by another process"):
        Index(path, COLUMNS)
    index.close()
    Index(path, COLUMNS).close()


FULL = """
import resource, signal, sys
from pathlib import Path
from runtime.errors import UsageError
from tests.runtime.experiments.test_index import COLUMNS, Index, row

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
index = Index(Path(sys.argv[1]), COLUMNS)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
for number in range(1000):
    try:
        index.append(row(number))
    except UsageError as error:
        print(number, error)
        break
"""


@pytest.mark.parametrize("spare", [0, 1, 17])
@pytest.mark.slow
def test_a_row_that_does_not_fit_leaves_nothing_of_itself(path: Path, spare: int) -> None:
    # A limit on file sizes simulates the full disk: the last write is incomplete as well.
    header, line = len(path.read_bytes()), len(COLUMNS.line(row(0)).encode())
    limit = str(header + 3 * line + spare)
    command = [sys.executable, "-c", FULL, str(path), limit]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == (
        f"3 cannot write '{path}': File too large; what was written before is intact\n"
    )
    assert len(list(read_rows(path, COLUMNS))) == 3
    assert len(path.read_bytes()) == header + 3 * line
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY


def trial(number: int, cell: str = "1.0", seed: int = 0) -> Trial:
    return Trial(number, Configuration(number, (cell, "[1, 2]"), GraphBundle("g")), seed)


def test_what_remains_is_what_has_no_row(index: Index) -> None:
    for number in (1, 0, 4):
        index.append(row(number))
    left = remaining(index, map(trial, range(7)))
    assert [found.number for found in left] == [2, 3, 5, 6]


def test_what_remains_holds_no_more_than_ran_side_by_side(index: Index) -> None:
    taken = 0

    def trials() -> Iterator[Trial]:
        nonlocal taken
        for number in range(10**9):
            taken += 1
            yield trial(number)

    for number in (2, 0, 1, 3, 5):
        index.append(row(number))
    left = remaining(index, trials())
    assert taken == 6
    assert next(left).number == 4


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (
            [row(0, cell="2.0")],
            "belongs to a different plan: its trial 0 is 2.0, [1, 2] with seed 0, ours 1",
        ),
        (
            [row(0, seed=9)],
            "belongs to a different plan: its trial 0 is 1.0, [1, 2] with seed 9, ours 1.0",
        ),
        ([row(0), row(1), row(0)], "index.csv:4: not a row of this plan: trial 0 has a row above"),
        ([row(3), row(3)], "index.csv:3: not a row of this plan: trial 3 has a row above"),
        ([row(99)], "trial 99 is a duplicate, or is not in the plan"),
    ],
)
def test_rows_of_another_plan_are_refused(index: Index, rows: list[Row], message: str) -> None:
    for found in rows:
        index.append(found)
    with pytest.raises(UsageError) as caught:
        remaining(index, map(trial, range(5)))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "belongs to a different plan: expected the columns trial, a.b"),
        ("point,x,seed\n", "got point, x, seed"),
        (
            csv_line(COLUMNS.header) + "1,2\n",
            "index.csv:2: not a row of this plan: expected 11 fields",
        ),
        (
            csv_line(COLUMNS.header) + checked("0,1,2,0,ok,,1,2,", "3") + "1,1,2,0,ok,,1,2,,,3\n",
            "index.csv:3: not a row of this plan: its check shows that it was changed",
        ),
        (
            csv_line(COLUMNS.header) + checked('0,1,2,0,ok,"a', "3") + "x,,,,,,,,,,3\n",
            "index.csv:2: not a row of this plan",
        ),
        *(
            (csv_line(COLUMNS.header) + checked(line, wall_s), f"index.csv:2: not a row{message}")
            for line, wall_s, message in (
                ("x,1,2,0,ok,,1,2,", "3", ""),
                ("1,1,2,0,ok,,1,y,", "3", ""),
                ("1,1,2,0,ok,,1,2,ab", "3", " of this plan: expected 2 signals, got 1"),
                ("1,1,2,0,fine,,1,2,", "3", " of this plan: expected a status (ok, failed"),
                ("1,1,2,0,ok,,1,2,", "-3", " of this plan: expected a duration in wall_s"),
                ("1,1,2,0,ok,,1,2,", "nan", " of this plan: expected a duration in wall_s"),
            )
        ),
    ],
)
def test_what_is_no_index(path: Path, text: str, message: str) -> None:
    path.write_text(text)
    with pytest.raises(UsageError) as caught:
        list(read_rows(path, COLUMNS))
    assert message in str(caught.value)


def test_numbers_keep_every_bit(index: Index) -> None:
    values = (math.pi, 5e-324)
    index.append(Row(0, ("1", "2"), 0, "ok", "", values, 0.0))
    assert next(index.rows()).metrics == values


def test_a_changed_byte_is_found_wherever_it_is(path: Path) -> None:
    whole = path.read_bytes() + b"".join(COLUMNS.line(row(n)).encode() for n in range(2))
    for place in range(len(whole)):
        for bit in (1, 4, 128):
            damaged = bytearray(whole)
            damaged[place] ^= bit
            path.write_bytes(damaged)
            try:
                found = list(read_rows(path, COLUMNS))
            except UsageError as error:
                assert "index.csv" in str(error)
                continue
            # The duration alone is not under the check.
            assert [replace(one, wall_s=0.25) for one in found] == [row(0), row(1)]


def test_what_is_no_index_is_not_cut(path: Path) -> None:
    for content in (b"one long text", path.read_bytes().replace(b"\n", b"\r") + b"1,2\r"):
        path.write_bytes(content)
        Index(path, COLUMNS).close()
        assert path.read_bytes() == content
