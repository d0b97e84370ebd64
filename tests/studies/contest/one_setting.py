"""One setting of the robust rule for the cases A, B and C: tuned over all three, and held out."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

from runtime.cli import run
from runtime.experiments.analysis import difference, estimate
from runtime.experiments.design import read_experiment
from tests.studies.contest.words import interval, table

FILE = Path(__file__).with_suffix(".yaml")
NAME = "one_setting"
ALONE = "lqr_alone.json"
TEXT = """## One setting for the cases A, B and C

`runtime tune {file}` found one setting of the robust rule for
all three cases, over {trials} trials: {values}.
Errors in mm on held-out runs, as the experiment weighs them: 3 % of the lateral error in A and 5 %
of the position error in B, so that no case outweighs the others. Each is beside the graph's own LQR
and feedforward, soft in A and B; the last column is the paired difference that the rule makes.
"""


def tuned(out: Path, jobs: int) -> None:
    """Tune the rule over all cases, and run the LQR alone on the same held-out runs."""
    run(["tune", str(FILE), "-j", str(jobs), "--resume", "--out", str(out), "--no-plots", "-q"])
    stored = out / NAME / ALONE
    if stored.exists():
        return
    seeds, conditions = read_experiment(str(FILE)).entries.held_out
    found = {}
    for condition in conditions:
        graph = condition.graph.without("adaptive").set("run.engine", "compiled")
        for seed in seeds or ():
            found[f"{condition.name}/{seed}"] = graph.run(seed=seed).metrics["error"]
    stored.write_text(json.dumps(found), encoding="utf-8")


def section(out: Path) -> str:
    """The section of docs/comparison.md; empty if nothing was tuned."""
    folder = out / NAME
    if not (folder / ALONE).exists():
        return ""
    stored = json.loads((folder / "tuning.json").read_text(encoding="utf-8"))
    alone: dict[str, float] = json.loads((folder / ALONE).read_text(encoding="utf-8"))
    (winner,) = stored["front"]
    values: dict[str, Any] = stored["configurations"][winner]["values"]
    errors = _errors(folder / "held_out.csv", str(winner))
    rows = []
    for condition in stored["held_out"]["conditions"]:
        runs = [run for run in alone if run.rpartition("/")[0] == condition]
        own, without = ([found[run] for run in runs] for found in (errors, alone))
        rows.append((condition, without, own))
    rows.append(("all", list(alone.values()), [errors[run] for run in alone]))
    lines = [
        (
            name,
            interval(estimate(without)),
            interval(estimate(own)),
            interval(difference(own, without, "t"), "+"),
        )
        for name, without, own in rows
    ]
    text = TEXT.format(
        file=f"tests/studies/contest/{FILE.name}",
        trials=stored["trials"],
        values=", ".join(f"`{path}` = {value:g}" for path, value in values.items()),
    )
    header = ("held-out condition", "LQR alone", "robust rule", "difference")
    return f"{text}\n{table(header, lines)}"


def _errors(path: Path, winner: str) -> dict[str, float]:
    with path.open(encoding="utf-8", newline="") as lines:
        return {
            f"{row['condition']}/{row['seed']}": float(row["error"])
            for row in csv.DictReader(lines)
            if row["configuration"] == winner
        }
