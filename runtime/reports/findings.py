"""The sentence that a report begins with: what came out, in words and with the deciding number.

In: a run, the table of an ablation, the best configuration of a sweep. Out: plain text::

    "Settled at 12.97 s, mean error 0.254 m."
    "The baseline settled in 10 of 10 runs, without adaptive in none (p = 0.002)."
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from runtime.experiments.analysis import (
    EQUAL,
    LEVEL,
    NEGLIGIBLE,
    NEVER,
    SAME,
    THESE,
    TOO_FEW,
    UNRANKED,
    ComparisonLine,
    Estimate,
    lost,
    p_cell,
)
from runtime.experiments.tuning import Evaluation
from runtime.observation import RunData
from runtime.reports import pieces

MOST = 3  # metrics, or variants, in a sentence
BASELINE = "baseline"
NOT_SIGNIFICANT = "not significant"


def words(name: str) -> str:
    """A metric's name as words: "settled_at" is "settled at"."""
    return name.replace("_", " ")


def of_run(result: RunData) -> str:
    """What a run came to: how it ended, which expectations failed, its first metrics."""
    if result.status == "failed":
        return f"The run failed: {result.manifest.get('error') or 'without a message'}"
    if result.failures:
        count = len(result.failures)
        return f"{count} expectation{'s' * (count > 1)} failed: {'; '.join(result.failures)}."
    shown = []
    for name, value in list(result.metrics.items())[:MOST]:
        if value is not None:
            shown.append(f"{words(name)} {pieces.quantity(value, result.units.get(name, ''))}")
        elif name in result.never:
            shown.append(result.metric_text(name))
    ended = "" if result.status == "complete" else f"{result.status}: "
    return _sentence(f"{ended}{', '.join(shown)}") if shown else ""


def of_ablation(results: Mapping[str, Any]) -> str:
    """The differences from the baseline that are significant, those of the first metric first."""
    lines = [line for line in map(ComparisonLine.from_dict, results["table"]) if not line.place]
    own = {line.metric: line for line in lines if line.variant == BASELINE}
    compared = [
        line for line in lines if line.difference is not None and line.reference in (None, BASELINE)
    ]
    found = [line for line in compared if _is_significant(line) and line.metric in own]
    if not compared:
        return ""
    if not found:
        return _nothing_found(results, own, compared)
    first = [line for line in found if line.metric == found[0].metric]
    shown = " ".join(_difference(results, own[line.metric], line) for line in first[:MOST])
    variants = len({line.variant for line in found})
    more = f" {variants} variants differ significantly from the baseline in at least one metric."
    return shown + (more if len(first) > MOST or variants > len(first) else "")


def _nothing_found(
    results: Mapping[str, Any],
    own: Mapping[str, ComparisonLine],
    compared: Sequence[ComparisonLine],
) -> str:
    """That no difference is significant, or why none was tested."""
    verdicts = {line.verdict for line in compared}
    if verdicts == {EQUAL}:
        return "No variant differs from the baseline in any metric."
    if verdicts <= {EQUAL, SAME}:
        first = [line for line in compared if line.verdict == SAME]
        first = [line for line in first if line.metric == first[0].metric]
        return " ".join(_difference(results, own[line.metric], line) for line in first[:MOST])
    if not verdicts & {"no", NEGLIGIBLE}:
        why = ", ".join(sorted(verdicts - {"-"})) or "no values"
        return f"No difference from the baseline was tested: {why}."
    untested = sum(line.verdict == TOO_FEW for line in compared)
    more = f"; of {untested} there are {TOO_FEW}" * bool(untested)
    return f"No variant differs significantly from the baseline in any metric{more}."


def _is_significant(line: ComparisonLine) -> bool:
    return line.verdict.startswith("yes")


def _difference(results: Mapping[str, Any], own: ComparisonLine, line: ComparisonLine) -> str:
    """One significant difference with the p value of what it names.

    Of the shares of runs with a value only where that is what was tested: by McNemar's test, or by
    ranks of pairs that all are infinite, where both are the sign test.
    """
    name, difference = line.metric, line.difference
    never = str((results.get("never") or {}).get(name, NEVER))
    is_counted = line.has_significant_presence or difference is None or not difference.n
    if _count(own.own, own.runs) != _count(line.own, line.runs) and is_counted:
        p = line.p_presence if line.has_significant_presence else line.p_adjusted
        did = never.removeprefix("never ") if never.startswith("never ") else f"had {words(name)}"
        text = f"the baseline {did} in {_count(own.own, own.runs)} of {own.runs} runs{_failed(own)}"
        text += f", {line.variant} in {_count(line.own, line.runs) or 'none'}{_failed(line)}"
        return _sentence(text, _p(p))
    unit = str((results.get("units") or {}).get(name, ""))
    if difference is not None and difference.never:
        text = (
            f"{line.variant}: {words(name)} differs from the baseline's by signed ranks, in which "
            f"a run that failed or {never} is the worst; {_count(line.own, line.runs)} of "
            f"{line.runs} runs have a value, and {_count(own.own, own.runs)} of the baseline's"
        )
        return _sentence(text, _p(line.p_adjusted))
    means = (_mean(each.own, each.runs, unit, never) for each in (line, own))
    text = f"{line.variant}: {words(name)} {' instead of '.join(means)}"
    text += f", over {line.runs} seeds" * (not (own.own.is_same and line.own.is_same))
    return _sentence(text, _p(line.p_adjusted))


def _count(estimate: Estimate, runs: int) -> int:
    """How many runs have a value: all of them, where one stands for all since they are equal."""
    return runs if estimate.is_same and estimate.n else estimate.n


def _failed(line: ComparisonLine) -> str:
    return f", {line.failed} failed" if line.failed else ""


def _mean(estimate: Estimate, runs: int, unit: str, never: str) -> str:
    """A mean with the number of runs that have a value if not all have, or what became of them."""
    if not estimate.n:
        word = lost(estimate.never, estimate.failed, never)
        return f"{word} in all of {runs} runs" if word else "no value"
    shown = pieces.quantity(estimate.mean, unit)
    if estimate.is_same:
        return f"{shown} (the seed changes nothing)"
    return shown + f" in {estimate.n} of {runs} runs" * (estimate.n < runs)


def _p(p: float) -> str:
    return "" if math.isnan(p) else f"p {p_cell(p)}" if p < 1e-4 else f"p = {p_cell(p)}"


def of_sweep(
    factors: Sequence[str], cells: Sequence[str], metric: str, goal: str, mean: float, unit: str
) -> str:
    """The best configuration, and its objective."""
    values = ", ".join(f"{name} = {cell}" for name, cell in zip(factors, cells, strict=True))
    largest = "largest" if goal == "maximize" else "smallest"
    return _sentence(f"{largest} {words(metric)}, {pieces.quantity(mean, unit)}, at {values}")


def of_tuning(stored: Mapping[str, Any]) -> str:
    """The best winner beside the graph's own values on the held-out runs, metric by metric."""
    return " ".join(_won(stored))


def _won(stored: Mapping[str, Any]) -> Iterator[str]:
    front = stored["front"]
    for name in [*stored.get("minimize", ()), *stored.get("maximize", ())][:MOST]:
        held_out = {
            line["configuration"]: Evaluation.from_dict(line["held_out"])
            for line in stored["table"]
            if line["metric"] == name and "n" in line["held_out"]
        }
        if not front or front[0] not in held_out or 0 not in held_out:
            continue
        best, own = held_out[front[0]], held_out[0]
        never = str((stored.get("never") or {}).get(name, NEVER))
        unit = str(stored["units"].get(name, ""))
        found, given = (_mean(each.mean, each.units, unit, never) for each in (best, own))
        note = "" if not best.p >= LEVEL else f"{NOT_SIGNIFICANT}, "
        text = (
            f"{words(name)} on the held-out runs is {found} with configuration {front[0]}, and "
            f"{given} with the graph's own values"
        )
        yield _sentence(text, _p(best.p) and note + _p(best.p))


def of_contest(stored: Mapping[str, Any]) -> str:
    """The best contestant in the first metric, and whether the others differ significantly."""
    metric, is_largest = stored["metrics"][0], "maximize" in stored
    lines = [x for x in map(ComparisonLine.from_dict, stored["table"]) if x.metric == metric]
    own = {line.variant: line for line in lines}

    def rank(name: str) -> tuple[int, float]:
        line = own[name]
        mean = line.own.mean if line.own.n else 0.0
        return line.runs - _count(line.own, line.runs), -mean if is_largest else mean

    best, *others = sorted(own, key=rank)
    unit, units = stored["units"].get(metric, ""), f"{stored['paired_by']}s"
    if not own[best].own.n:
        return f"No contestant has a value of {words(metric)} in the held-out runs."
    never = str((stored.get("never") or {}).get(metric, NEVER))
    shown = [_contestant(lines, best, name, unit, never) for name in others[:MOST]]
    rest, runs = "largest" if is_largest else "smallest", own[best].runs
    mean = _mean(own[best].own, runs, unit, never)
    text = f"{rest} {words(metric)} over {runs} held-out {units}: {best}, {mean}"
    text += f", instead of {'; '.join(shown)}" * bool(shown)
    return _sentence(text)


def _contestant(
    lines: Sequence[ComparisonLine], best: str, name: str, unit: str, never: str
) -> str:
    """The mean of a contestant, and the verdict on its difference from the best."""
    line = next(line for line in lines if {line.variant, line.reference} == {best, name})
    own = next(line for line in lines if line.variant == name)
    note = "" if _is_significant(line) else f"{NOT_SIGNIFICANT}, "
    p = _p(line.p_adjusted)
    is_of_these = line.difference is not None and line.difference.is_of_these
    if line.verdict == THESE:
        note = f"{THESE} differ, of one tuning each, "
    elif is_of_these:
        p = ""
    if line.verdict in (TOO_FEW, EQUAL, NEGLIGIBLE, SAME, UNRANKED):
        note, p = line.verdict, ""
    mean = _mean(own.own, own.runs, unit, never)
    return f"{name}, {mean} ({note}{p})".replace(" ()", "").replace(", )", ")")


def _sentence(text: str, note: str = "") -> str:
    """A text with a capital letter, a note in brackets and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{f' ({note})' if note else ''}."
