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
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from runtime.errors import UsageError
from runtime.experiments.design import slugs
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


def is_complete(task: str, contestant: str) -> bool:
    """Whether all tunings of a contestant have rows."""
    done = {row["tuning"] for row in read(task) if row["contestant"] == contestant}
    return len(done) >= plan.tunings(task, contestant)


def gather(task: str, folder: Path) -> Path:
    """Write the rows of the tunings in a contest's folder that have been judged, beside the old."""
    settings = plan.read()
    names = slugs(list(settings["tasks"][task]["contestants"]))
    # Rows stay where a folder has no others: a study may be continued on another computer.
    old = read(task) if task in tasks() else []
    found: list[Row] = []
    for name, start in names.items():
        for tuning in range(plan.tunings(task, name)):
            first = settings["tasks"][task].get("sampling_seed", 0)
            own = folder / f"{start}-{first + tuning}"
            if _is_judged(own):
                found += _rows(name, tuning, own)
            else:
                found += [x for x in old if (x["contestant"], x["tuning"]) == (name, str(tuning))]
    if not found:
        raise UsageError(f"there is no judged tuning in '{folder}'; see --out")
    kept = [key for key in found[0] if key not in FIRST]
    text = io.StringIO()
    writer = csv.DictWriter(text, [*FIRST, *kept], lineterminator="\n")
    writer.writeheader()
    writer.writerows(found)
    ROWS.mkdir(exist_ok=True)
    path = ROWS / f"{task}.csv.xz"
    path.write_bytes(lzma.compress(text.getvalue().encode(), preset=9))
    return path


def _is_judged(own: Path) -> bool:
    """Whether a tuning and all of its held-out runs are complete, and not interrupted."""
    facts = own / "tuning.json"
    return facts.exists() and json.loads(facts.read_text("utf-8"))["status"] == "complete"


def _rows(name: str, tuning: int, own: Path) -> Iterator[Row]:
    facts = json.loads((own / "tuning.json").read_text(encoding="utf-8"))
    paths = list(facts["vary"]) if "vary" in facts else []
    began = str(int((own / "graph.resolved.yaml").stat().st_mtime))
    common = {"contestant": name, "tuning": str(tuning), "began": began}
    for file, part in (("index.csv", plan.TRAINING), ("held_out.csv", plan.HELD_OUT)):
        with (own / file).open(encoding="utf-8") as stream:
            for row in csv.DictReader(stream):
                yield common | {"part": part} | _row(row, part, paths)


def _row(row: Row, part: str, paths: list[str]) -> Row:
    values = ",".join(row.pop(path, "") for path in paths)
    first = {"configuration": row.get("configuration", ""), "values": values}
    first["condition"] = row["condition"]
    return first | {
        key: _short(value) for key, value in row.items() if key not in (*NOT_KEPT, *paths)
    }


def entered(task: str, contestant: str, tuning: int) -> dict[str, float]:
    """The values that a tuning entered, by path; empty if they were the contestant's own.

    Raises
    ------
    UsageError : the tuning has not been judged.
    """
    own = [
        row for row in read(task) if (row["contestant"], row["tuning"]) == (contestant, str(tuning))
    ]
    # Held out, a winner is judged beside configuration 0, the contestant's own values.
    judged = [int(row["configuration"]) for row in own if row["part"] == plan.HELD_OUT]
    if not judged:
        raise UsageError(f"tuning {tuning} of {contestant} has no held-out run in task {task}")
    # Training runs are in the order of the configurations, which begin with 0.
    tried = list(dict.fromkeys(row["values"] for row in own if row["part"] == plan.TRAINING))
    values = tried[max(judged)]
    # Values are numbers, so that no comma is within one.
    cells = [float(cell) for cell in values.split(",") if cell]
    return dict(zip(plan.factors(task, contestant), cells, strict=True)) if cells else {}


def _short(cell: str) -> str:
    try:
        return f"{float(cell):.5g}" if "." in cell else cell
    except ValueError:
        return cell


def held_out(task: str, metric: str) -> dict[str, dict[tuple[int, str, int], float | None]]:
    """A metric of the held-out runs of what each tuning entered: by tuning, condition and seed."""
    found: dict[str, dict[tuple[int, str, int], float | None]] = defaultdict(dict)
    own = [row for row in read(task) if row["part"] == plan.HELD_OUT]
    # Configuration 0 is the contestant's own values, which the winner's take the place of.
    for row in sorted(own, key=lambda row: int(row["configuration"])):
        place = (int(row["tuning"]), row["condition"], int(row["seed"]))
        is_value = row["status"] == "ok" and row[metric] != ""
        found[row["contestant"]][place] = float(row[metric]) if is_value else None
    return dict(found)
