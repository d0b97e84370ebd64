"""The registered plan as experiment files.

In: ``docs/study/plan.yaml``. Out: for each task a file for ``runtime contest``, with conditions
that are drawn anew from their own seeds::

    params.gain: {uniform: [0.3, 0.8]}  ->  heals 0: {set: {params.gain: 0.7133, ...}}
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from runtime.document import dump_yaml

FOLDER = Path(__file__).parents[3] / "docs" / "study"
PLAN, TEXT = FOLDER / "plan.yaml", FOLDER / "plan.md"
TRAINING, HELD_OUT = "training", "held_out"
DIGITS = 4
FEWEST = 3  # tunings; of fewer, their scatter is unknown
SETTINGS = ("tunings", "trials", "patience")  # of a task or a contestant, else of the plan


@cache
def read() -> dict[str, Any]:
    """The plan."""
    plan: dict[str, Any] = yaml.safe_load(PLAN.read_text(encoding="utf-8"))
    return expanded(plan)


def expanded(plan: dict[str, Any]) -> dict[str, Any]:
    """A plan whose tasks that are ``like`` another have its entries, with their own before them.

    ``only`` are the contestants that such a task has; ``groups`` only change numbers.
    """
    for name, entry in plan["tasks"].items():
        if "like" in entry:
            base = plan["tasks"][entry["like"]]
            own = base | entry
            own["contestants"] = {
                key: base["contestants"][key] | more for key, more in entry["only"].items()
            }
            own["groups"] = {key: base["groups"][key] | n for key, n in entry["groups"].items()}
            plan["tasks"][name] = own
    return plan


def conditions(task: str, part: str) -> dict[str, dict[str, Any]]:
    """The conditions of a task, as changes by name; those of training and held out are others."""
    plan = read()
    entry = plan["tasks"][task]
    found = {}
    for g, (group, about) in enumerate(entry["groups"].items()):
        draws = {**entry["draws"], **entry.get("group_draws", {}).get(group, {})}
        for k in range(about.get(part, 0)):
            place = [list(plan["tasks"]).index(task), g, k, part == HELD_OUT]
            rng = np.random.default_rng([plan["version"], *map(int, place)])
            values = {path: _drawn(how, rng) for path, how in draws.items()}
            found[f"{group} {k}"] = {"set": values}
    return found


def group_of(condition: str) -> str:
    """The group that a condition belongs to."""
    return condition.rpartition(" ")[0]


def _drawn(how: Mapping[str, Any], rng: np.random.Generator) -> Any:
    if "path" in how:
        return _path(rng, **how["path"])
    ((kind, (low, high)),) = ((k, v) for k, v in how.items() if k != "each")
    values = rng.uniform(low, high, how.get("each", 1))
    if kind == "signed":
        values *= rng.choice([-1.0, 1.0], len(values))
    rounded = [float(f"{value:.{DIGITS}g}") for value in values]
    return rounded if "each" in how else rounded[0]


def _path(
    rng: np.random.Generator, step: float, turn: float, most: float, points: int
) -> list[list[float]]:
    """Waypoints a step apart, whose direction turns by a normal angle of at most ``most`` (rad)."""
    turns = np.clip(rng.normal(0.0, turn, points - 1), -most, most)
    turns[0] = 0.0
    angles = np.cumsum(turns)
    ways = np.cumsum(step * np.stack([np.cos(angles), np.sin(angles)], axis=1), axis=0)
    return [[0.0, 0.0], *np.round(ways, 3).tolist()]


def setting(task: str, key: str, contestant: str = "") -> Any:
    """One of ``SETTINGS``."""
    entry = read()["tasks"][task]
    own = entry["contestants"].get(contestant, {})
    return own.get(key, entry.get(key, read()[key]))


def tunings(task: str, contestant: str) -> int:
    """How many tunings a contestant has."""
    return int(setting(task, "tunings", contestant))


def fewest(task: str, contestant: str) -> int:
    """From how many tunings on a contestant is judged: all, if fewer are planned."""
    return min(FEWEST, tunings(task, contestant))


def experiment(
    task: str, only: str = "", entered: Mapping[str, Any] | None = None, tuning: int | None = None
) -> dict[str, Any]:
    """The contents of a task's file for ``runtime contest``.

    Parameters
    ----------
    only : this contestant; all if empty.
    entered : values in place of what it varies, those of one tuning of another task.
    tuning : the number of this tuning, which then is the only one.
    """
    plan = read()
    entry = plan["tasks"][task]
    first = entry.get("sampling_seed", 0)
    return {
        "experiment": task,
        "graph": str(FOLDER / entry["graph"]),
        "minimize": "error",
        "constraints": {"effort": {"below": entry["effort"]}},
        "margin": f"{100 * (plan['margin'] - 1):g}%",
        **{key: setting(task, key, only) for key in ("trials", "patience")},
        "batch": plan["batch"],
        "repeats": tunings(task, only) if tuning is None else 1,
        "sampling_seed": first + (tuning or 0),
        **{
            part: {
                "seeds": entry.get("seeds", {}).get(part, plan[part]["seeds"]),
                "conditions": conditions(task, part),
            }
            for part in (TRAINING, HELD_OUT)
        },
        "contestants": {
            name: _contestant(changes, entry["vary"], entered)
            for name, changes in entry["contestants"].items()
            if only in ("", name)
        },
    }


def _contestant(
    changes: Mapping[str, Any], vary: Mapping[str, Any], entered: Mapping[str, Any] | None
) -> dict[str, Any]:
    """Its changes with files by their whole path, and factors in place of the names of sets."""
    written = {key: value for key, value in changes.items() if key not in SETTINGS}
    if "with" in written:
        names = written["with"] if isinstance(written["with"], list) else [written["with"]]
        written["with"] = [str((FOLDER / name).resolve()) for name in names]
    factors = _factors(written.pop("vary", []), vary)
    if entered is not None:
        return written | {"set": {**written.get("set", {}), **entered}}
    return written | ({"vary": factors} if factors else {})


def _factors(listed: Sequence[Any], vary: Mapping[str, Any]) -> dict[str, str]:
    found: dict[str, str] = {}
    for each in listed:
        found |= vary[each] if isinstance(each, str) else each
    return found


def factors(task: str, contestant: str) -> dict[str, str]:
    """The ranges that a contestant's tuning searches, by path."""
    entry = read()["tasks"][task]
    return _factors(entry["contestants"][contestant].get("vary", []), entry["vary"])


def write(
    task: str,
    folder: Path,
    only: str = "",
    entered: Mapping[str, Any] | None = None,
    tuning: int | None = None,
) -> Path:
    """Write a task's file, as :func:`experiment`, and return it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{task}.yaml"
    contents = dump_yaml(experiment(task, only, entered, tuning))
    path.write_text(contents, encoding="utf-8")
    return path


def margin() -> float:
    """ln of the smallest ratio that counts."""
    return math.log(read()["margin"])
