"""Damaged indexes and plans of sweeps and ablations give the same rows or are refused."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from hypothesis import strategies as st

from tests.fuzz.campaign import Record, campaign
from tests.fuzz.mutation import mutate_bytes
from tests.fuzz.workspace import assert_answered, call, fresh, made

TITLE = "Damaged indexes"
WHAT = (
    "In index.csv and plan.yaml of a sweep and of an ablation, bytes and bits are changed, lines "
    "are removed, doubled, exchanged or cut off, cells exchanged or overwritten with huge numbers, "
    "columns removed, line ends and the encoding changed; then sweep --resume, ablate --resume or "
    "report reads the folder."
)
HOLDS = (
    "The file is refused with exit code 2 and its name; or the rows are bit for bit those of the "
    "undamaged folder, all of them after --resume, only such for report."
)
SWEEP, ABLATION = "sweeps/tiny", "ablations/tiny"
RESUME = (
    (SWEEP, ("sweep", "exp.yaml", "--resume", "--keep", "all", "-j", "1", "--no-plots")),
    (ABLATION, ("ablate", "exp.yaml", "--resume", "-j", "1", "--no-plots")),
)
REPORT = tuple((folder, ("report", folder, "--json")) for folder in (SWEEP, ABLATION))
INDEX, PLAN = "index.csv", "plan.yaml"
NUMBERS = ("1e999", "-1e308", "9" * 400, "nan", "-1", "0x10", "1_0", "٣", "", " 0")


@dataclass(frozen=True)
class Case:
    """A file's new content, and the command that reads its folder then."""

    folder: str
    file: str
    how: str
    content: bytes
    command: tuple[str, ...]


@st.composite
def _cases(draw: st.DrawFn) -> Case:
    file = draw(st.sampled_from([INDEX, INDEX, INDEX, PLAN]))
    folder, command = draw(st.sampled_from(RESUME if file == PLAN else (*RESUME, *REPORT)))
    data = (made() / folder / file).read_bytes()
    ways = {"bytes": _bytes, "bit": _bit, "lines": _lines, "encoding": _encoding, "end": _end}
    if file == INDEX:
        ways |= {"cells": _cells, "column": _column}
    how = draw(st.sampled_from(sorted(ways)))
    return Case(folder, file, how, ways[how](draw, data), command)


def _bytes(draw: st.DrawFn, data: bytes) -> bytes:
    return mutate_bytes(draw, data)


def _bit(draw: st.DrawFn, data: bytes) -> bytes:
    place = draw(st.integers(0, len(data) - 1))
    changed = bytes([data[place] ^ 1 << draw(st.integers(0, 7))])
    return data[:place] + changed + data[place + 1 :]


def _lines(draw: st.DrawFn, data: bytes) -> bytes:
    lines = data.splitlines(keepends=True)
    one, other = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
    what = draw(st.sampled_from(["remove", "double", "exchange", "blank"]))
    if what == "remove":
        del lines[one]
    elif what == "exchange":
        lines[one], lines[other] = lines[other], lines[one]
    else:
        lines.insert(other, lines[one] if what == "double" else b"\n")
    return b"".join(lines)


def _encoding(draw: st.DrawFn, data: bytes) -> bytes:
    text = data.decode()
    others = [text.encode(name) for name in ("utf-16", "utf-32-le", "utf-8-sig", "cp500")]
    return draw(
        st.sampled_from([*others, *(text.replace("\n", e).encode() for e in ("\r\n", "\r"))])
    )


def _end(draw: st.DrawFn, data: bytes) -> bytes:
    return data[: draw(st.integers(0, len(data)))]


def _written(rows: Iterable[Iterable[str]]) -> bytes:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue().encode()


def _cells(draw: st.DrawFn, data: bytes) -> bytes:
    rows = [list(row) for row in _rows(data)]
    one, other = (draw(st.integers(0, len(rows) - 1)) for _ in range(2))
    column = draw(st.integers(0, len(rows[0]) - 1))
    if draw(st.booleans()):
        rows[one][column], rows[other][column] = rows[other][column], rows[one][column]
    else:
        rows[one][column] = draw(st.sampled_from(NUMBERS))
    return _written(rows)


def _column(draw: st.DrawFn, data: bytes) -> bytes:
    rows = _rows(data)
    column = draw(st.integers(0, len(rows[0]) - 1))
    return _written(row[:column] + row[column + 1 :] for row in rows)


def cases() -> st.SearchStrategy[Case]:
    """All damages."""
    return _cases()


def _rows(data: bytes) -> list[tuple[str, ...]]:
    return [tuple(row) for row in csv.reader(io.StringIO(data.decode(), newline=""))]


def _lasting(data: bytes) -> list[tuple[str, ...]]:
    """The rows without their last column, the duration, in the order of their trials."""
    return sorted(row[:-1] for row in _rows(data))


@cache
def _whole(folder: str) -> list[tuple[str, ...]]:
    return _lasting((made() / folder / INDEX).read_bytes())


def check(case: Case) -> str:
    """Damage a file, read its folder and compare; returns how it ended."""
    with fresh():
        Path(case.folder, case.file).write_bytes(case.content)
        answer = call(case.command)
        after = Path(case.folder, INDEX).read_bytes()
    assert_answered(answer, case.command)
    assert answer.code in (0, 2), f"exit code {answer.code}: {answer.err[-500:]}"
    if answer.code == 2:
        named = f"{case.folder}/{INDEX}" if case.file == INDEX else case.folder
        assert named in answer.err, answer.err
        assert case.file == PLAN or after in (case.content, _cut(case.content)), "it was changed"
        return "refused"
    whole = _whole(case.folder)
    if case.command[0] == "report":
        assert set(_lasting(after)) <= set(whole), "rows that are not of this folder were read"
        return "the same rows" if _lasting(after) == whole else "fewer rows"
    assert _lasting(after) == whole, "other rows than before"
    return "the same rows"


def _cut(content: bytes) -> bytes:
    """Without the incomplete last line, which a killed sweep leaves."""
    return content[: content.rfind(b"\n") + 1]


def run(examples: int, seed: int) -> Record:
    """Try damages."""
    made()
    return campaign("damaged_indexes", cases(), check, examples, seed)
