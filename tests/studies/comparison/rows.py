"""Every trial of a task as a row: ``docs/study/rows/TASK.csv.xz``.

In: the folder of a contest. Out: one row for each training run and each held-out run::

    contestant,tuning,began,part,configuration,values,condition,seed,status,error,...
    LQR,0,1767348000,training,12,"1204,0.31",heals 1,0,ok,0.02313,...
"""

from __future__ import annotations

import csv
import io
import json
import lzma
from collections import defaultdict
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from tests.studies.comparison import plan

ROWS = plan.FOLDER / "rows"
FIRST = ("contestant", "tuning", "began", "part", "configuration", "values")
NOT_KEPT = ("trial", "reason", "signals", "check", "wall_s", "checks", "condition", "configuration")
Row = dict[str, str]


def tasks() -> list[str]:
    """The tasks that have rows, in the order of the plan."""
    return [task for task in plan.read()["tasks"] if (ROWS / f"{task}.csv.xz").exists()]


@cache
def read(task: str) -> list[Row]:
    """The rows of a task."""
    text = lzma.decompress((ROWS / f"{task}.csv.xz").read_bytes()).decode()
    return list(csv.DictReader(io.StringIO(text)))


def began(task: str) -> dict[tuple[str, int], datetime]:
    """When each tuning began."""
    return {
        (row["contestant"], int(row["tuning"])): datetime.fromtimestamp(int(row["began"]), UTC)
        for row in read(task)
    }


def gather(task: str, folder: Path) -> Path:
    """Write the rows of a contest's folder."""
    facts = json.loads((folder / "contest.json").read_text(encoding="utf-8"))
    found = list(_rows(facts["contestants"].items(), folder))
    kept = [key for key in found[0] if key not in FIRST]
    text = io.StringIO()
    writer = csv.DictWriter(text, [*FIRST, *kept], lineterminator="\n")
    writer.writeheader()
    writer.writerows(found)
    ROWS.mkdir(exist_ok=True)
    path = ROWS / f"{task}.csv.xz"
    path.write_bytes(lzma.compress(text.getvalue().encode(), preset=9))
    return path


def _rows(
    contestants: Iterable[tuple[str, list[dict[str, object]]]], folder: Path
) -> Iterator[Row]:
    for name, tunings in contestants:
        for tuning in tunings:
            own = folder / str(tuning["folder"])
            made = str(int((own / "graph.resolved.yaml").stat().st_mtime))
            common = {"contestant": name, "tuning": str(tuning["sampling_seed"]), "began": made}
            entered = tuning["values"]
            paths = list(entered) if isinstance(entered, dict) else []
            for file, part in (("index.csv", plan.TRAINING), ("held_out.csv", plan.HELD_OUT)):
                for row in csv.DictReader((own / file).open(encoding="utf-8")):
                    yield common | {"part": part} | _row(row, part, paths)


def _row(row: Row, part: str, paths: list[str]) -> Row:
    values = ",".join(row.pop(path, "") for path in paths)
    first = {"configuration": row.get("configuration", ""), "values": values}
    first["condition"] = row["condition"]
    return first | {
        key: _short(value) for key, value in row.items() if key not in (*NOT_KEPT, *paths)
    }


def _short(cell: str) -> str:
    try:
        return f"{float(cell):.5g}" if "." in cell else cell
    except ValueError:
        return cell


def held_out(task: str, metric: str) -> dict[str, dict[tuple[int, str, int], float | None]]:
    """A metric of the held-out runs of what each tuning entered: by tuning, condition and seed."""
    found: dict[str, dict[tuple[int, str, int], float | None]] = defaultdict(dict)
    for row in read(task):
        # A winner's rows follow those of the contestant's own values, and take their place.
        if row["part"] == plan.HELD_OUT:
            place = (int(row["tuning"]), row["condition"], int(row["seed"]))
            is_value = row["status"] == "ok" and row[metric] != ""
            found[row["contestant"]][place] = float(row[metric]) if is_value else None
    return dict(found)
