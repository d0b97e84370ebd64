"""What a tuning prints and stores: its front, and training beside held-out."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

from runtime.experiments.analysis import CONFIDENCE, CORRECTION, is_significant
from runtime.experiments.execution import SCHEMA_VERSION
from runtime.experiments.tuning.judging import Judged, Judgement, judge
from runtime.experiments.tuning.plan import BASELINE, TUNING, TuningPlan
from runtime.experiments.tuning.running import TuningResult
from runtime.experiments.tuning.scores import Tried
from runtime.files import write_json
from runtime.terminal import number, table, with_unit


def to_dict(result: TuningResult) -> dict[str, Any]:
    """What tuning.json holds."""
    plan = result.plan
    counts = Counter(one.status for one in result.tried[1:])
    complete = not result.is_interrupted
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "tuning",
        "experiment": plan.name,
        "graph": plan.graph.title,
        "folder": str(result.folder),
        "status": "complete" if complete else "interrupted",
        **{k: v for k, v in plan.specification.items() if k not in ("training", "held_out")},
        "training": _runs(plan, "training"),
        "held_out": _runs(plan, "held_out"),
        "units": plan.units,
        "counts": dict(counts),
        "runs": result.runs,
        "held_out_runs": sum(len(one.rows) for one in result.held_out.values()),
        "confidence": CONFIDENCE,
        "correction": CORRECTION,
        "configurations": [_tried(plan, one) for one in result.tried],
        "front": [one.number for one in result.winners],
        "table": [line.to_dict() for line in judgements(result)],
        "wall_s": round(result.wall_s, 3),
    }


def judgements(result: TuningResult) -> list[Judgement]:
    """The baseline and the winners on both sets of runs; empty before the held-out runs."""
    if not result.held_out:
        return []
    return judge(result.plan, result.tried, result.winners, result.held_out)


def _runs(plan: TuningPlan, key: str) -> dict[str, Any]:
    runs = plan.tuning.training if key == "training" else plan.tuning.held_out
    conditions = {
        condition.name: [str(change) for change in condition.changes]
        for condition in runs.conditions
    }
    return {"seeds": str(runs.seeds), "conditions": conditions}


def _tried(plan: TuningPlan, one: Tried) -> dict[str, Any]:
    score = one.score
    means = {} if score is None else score.metrics
    return {
        "number": one.number,
        "values": None if one.values is None else dict(zip(plan.paths, one.values, strict=True)),
        "status": one.status,
        "feasible": score is not None and score.is_feasible and score.has_values,
        "metrics": {name: None if math.isnan(v) else v for name, v in means.items()},
        "runs": len(one.rows),
    }


def summary(result: TuningResult) -> str:
    """What the command prints, without the folder."""
    plan, tuning = result.plan, result.plan.tuning
    counts = Counter(one.status for one in result.tried[1:])
    statuses = ", ".join(f"{n} {status}" for status, n in sorted(counts.items()))
    lines = [
        f"{plan.name}: {len(result.tried) - 1} of {tuning.trials} trials by {tuning.sampler}: "
        f"{statuses}; {result.runs} training runs in {result.wall_s:.1f} s"
    ]
    for name, runs in (("training", tuning.training), ("held out", tuning.held_out)):
        lines.append(f"{name}: seeds {runs.seeds}; conditions {', '.join(runs.names)}")
    if tuning.constraints:
        lines.append(f"constraints: {', '.join(map(str, tuning.constraints))}")
    if not result.winners:
        return "\n".join([*lines, _none_feasible(result)])
    kind = "winner" if len(tuning.objectives) == 1 else "front"
    lines.append(f"{kind}:")
    for one in result.winners:
        if one.values is not None:
            values = zip(plan.paths, plan.cells(one.values), strict=True)
            lines.append(
                f"  {one.number}: {', '.join(f'{path}={value}' for path, value in values)}"
            )
    lines += [f"  {note}" for note in edges(result)]
    if result.held_out:
        lines += ["", table(_rows(result), right=range(2, 8)), "", LEGEND]
    return "\n".join(lines)


LEGEND = (
    "mean over all runs; difference from the graph's own values on the same runs, paired t, with "
    "95 % intervals;\n* significant after Benjamini-Hochberg. optimism: training minus held-out."
)


def _none_feasible(result: TuningResult) -> str:
    best = [one for one in result.tried[1:] if one.score is not None and one.score.has_values]
    if not best:
        return "no configuration has a value of every metric in every run"
    closest = min(best, key=lambda one: one.score.violation if one.score else math.inf)
    means = closest.score.metrics if closest.score else {}
    found = ", ".join(f"{name} {number(means[name])}" for name in result.plan.tuning.metrics)
    return f"no configuration satisfies the constraints; the closest, {closest.number}, has {found}"


def edges(result: TuningResult) -> list[str]:
    """Which values of winners lie within 2 % of an end of their range."""
    from runtime.experiments.design import Range

    found = []
    for one in result.winners:
        for factor, value in zip(result.plan.design.factors, one.values or (), strict=False):
            if isinstance(factor, Range):
                low, high, at = float(factor.low), float(factor.high), float(value)
                if factor.scale == "log":
                    low, high, at = math.log(low), math.log(high), math.log(at)
                share = (at - low) / (high - low)
                if not 0.02 <= share <= 0.98:
                    end = "lower" if share < 0.5 else "upper"
                    found.append(
                        f"note: {factor.path}={value:g} of {one.number} is at the {end} end of "
                        "its range; widen it"
                    )
    return found


def _rows(result: TuningResult) -> list[list[str]]:
    units = result.plan.units
    header = ["metric", "values", "training", "difference", "held out", "difference", "optimism"]
    rows = [header]
    lines = judgements(result)
    for metric in result.plan.tuning.metrics:
        for line in lines:
            if line.metric == metric:
                name = "own" if line.number == BASELINE else str(line.number)
                rows.append(
                    [
                        with_unit(metric, units),
                        name,
                        number(line.training.mean.mean),
                        _apart(line.training),
                        number(line.held_out.mean.mean),
                        _apart(line.held_out),
                        number(line.optimism, "+"),
                    ]
                )
    return rows


def _apart(judged: Judged) -> str:
    apart = judged.difference
    if apart is None or math.isnan(apart.mean):
        return "-"
    text = number(apart.mean, "+")
    if not math.isnan(apart.low):
        text += f" [{number(apart.low, '+')}, {number(apart.high, '+')}]"
    return text + ("*" if is_significant(judged.p) else "")


def save_json(result: TuningResult) -> dict[str, Any]:
    """Write tuning.json; returns what it holds.

    Raises
    ------
    UsageError : it cannot be written.
    """
    stored = to_dict(result)
    write_json(result.folder / TUNING, stored)
    return stored
