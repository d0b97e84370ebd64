"""The sentence that a report begins with: what came out, in words and with the deciding number.

In: a run, the table of an ablation, the best configuration of a sweep. Out: plain text::

    "Settled at 12.97 s, mean error 0.254 m."
    "The baseline settled in 10 of 10 runs, without adaptive in none (p = 0.002)."
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from runtime.experiments.analysis import (
    EQUAL,
    LEVEL,
    MEAN,
    NEGLIGIBLE,
    NEVER,
    SAME,
    THESE,
    TOO_FEW,
    UNRANKED,
    is_significant,
    lost,
)
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
    told = []
    for name, value in list(result.metrics.items())[:MOST]:
        if value is not None:
            told.append(f"{words(name)} {pieces.quantity(value, result.units.get(name, ''))}")
        elif name in result.never:
            told.append(result.metric_text(name))
    ended = "" if result.status == "complete" else f"{result.status}: "
    return _sentence(f"{ended}{', '.join(told)}") if told else ""


def of_ablation(results: Mapping[str, Any]) -> str:
    """The differences from the baseline that are significant, those of the first metric first."""
    lines = [line for line in results["table"] if not place_of(line)]
    own = {line["metric"]: line for line in lines if line["variant"] == BASELINE}
    compared = [line for line in lines if line["difference"] is not None and _is_whole(line)]
    found = [line for line in compared if _is_significant(line) and line["metric"] in own]
    if not compared:
        return ""
    if not found:
        return _nothing_found(results, own, compared)
    first = [line for line in found if line["metric"] == found[0]["metric"]]
    told = " ".join(_difference(results, own[line["metric"]], line) for line in first[:MOST])
    variants = len({line["variant"] for line in found})
    more = f" {variants} variants differ significantly from the baseline in at least one metric."
    return told + (more if len(first) > MOST or variants > len(first) else "")


def _nothing_found(
    results: Mapping[str, Any],
    own: Mapping[str, Mapping[str, Any]],
    compared: Sequence[Mapping[str, Any]],
) -> str:
    """That no difference is significant, or why none was tested."""
    verdicts = {line["difference"].get("verdict", "no") for line in compared}
    if verdicts == {EQUAL}:
        return "No variant differs from the baseline in any metric."
    if verdicts <= {EQUAL, SAME}:
        first = [line for line in compared if line["difference"]["verdict"] == SAME]
        first = [line for line in first if line["metric"] == first[0]["metric"]]
        return " ".join(_difference(results, own[line["metric"]], line) for line in first[:MOST])
    if not verdicts & {"no", NEGLIGIBLE}:
        why = ", ".join(sorted(verdicts - {"-"})) or "no values"
        return f"No difference from the baseline was tested: {why}."
    untested = sum(line["difference"].get("verdict") == TOO_FEW for line in compared)
    more = f"; of {untested} there are {TOO_FEW}" * bool(untested)
    return f"No variant differs significantly from the baseline in any metric{more}."


def _is_whole(line: Mapping[str, Any]) -> bool:
    """Whether a line compares a variant with the baseline over all settings."""
    return line.get("reference") in (None, BASELINE) and not place_of(line)


def place_of(line: Mapping[str, Any]) -> str:
    """What a line is of besides its metric: a setting, or the statistic of a tail."""
    statistic = str(line.get("statistic", MEAN))  # none in folders of earlier versions
    return str(line.get("setting", "")) if statistic == MEAN else statistic


def _is_significant(line: Mapping[str, Any]) -> bool:
    difference = line["difference"]
    verdict = str(difference.get("verdict", ""))
    return verdict.startswith("yes") if verdict else bool(difference["distinguishable"])


def _difference(results: Mapping[str, Any], own: Mapping[str, Any], line: Mapping[str, Any]) -> str:
    """One significant difference with the p value of what it names.

    Of the shares of runs with a value only where that is what was tested: by McNemar's test, or by
    ranks of pairs that all are infinite, where both are the sign test.
    """
    name, variant, runs = line["metric"], line["variant"], line["runs"]
    difference = line["difference"]
    never = str((results.get("never") or {}).get(name, NEVER))
    p, counted = difference["p_adjusted"], difference.get("p_presence")
    is_counted = is_significant(counted) or difference.get("n") == 0
    if _count(own) != _count(line) and is_counted:
        p = counted if is_significant(counted) else p
        did = never.removeprefix("never ") if never.startswith("never ") else f"had {words(name)}"
        text = f"the baseline {did} in {_count(own)} of {own['runs']} runs{_failed(own)}, "
        text += f"{variant} in {_count(line) or 'none'}{_failed(line)}"
        return _sentence(text, _p(p))
    unit = str((results.get("units") or {}).get(name, ""))
    if difference.get("never"):
        text = (
            f"{variant}: {words(name)} differs from the baseline's by signed ranks, in which a run "
            f"that failed or {never} is the worst; {_count(line)} of {runs} runs have a value, and "
            f"{_count(own)} of the baseline's"
        )
        return _sentence(text, _p(p))
    text = (
        f"{variant}: {words(name)} {_mean(line, unit, never)} instead of {_mean(own, unit, never)}"
    )
    text += f", over {runs} seeds" * (not (own.get("identical") and line.get("identical")))
    return _sentence(text, _p(p))


def _count(line: Mapping[str, Any]) -> int:
    """How many runs have a value: all of them, where one stands for all since they are equal."""
    return int(line["runs"] if line.get("identical") and line["n"] else line["n"])


def _failed(line: Mapping[str, Any]) -> str:
    failed = line.get("failed", 0)
    return f", {failed} failed" if failed else ""


def _mean(line: Mapping[str, Any], unit: str, never: str) -> str:
    """A mean with the number of runs that have a value if not all have, or what became of them."""
    if not line["n"]:
        word = lost(line.get("never", 0), line.get("failed", 0), never)
        return f"{word} in all of {line['runs']} runs" if word else "no value"
    if line.get("identical"):
        return f"{pieces.quantity(line['mean'], unit)} (the seed changes nothing)"
    count, runs = line["n"], line.get("runs", line["n"])
    return f"{pieces.quantity(line['mean'], unit)}{f' in {count} of {runs} runs' * (count < runs)}"


def _p(p: float | None) -> str:
    if p is None:
        return ""
    return "p < 0.0001" if p < 1e-4 else f"p = {p:.2g}"


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
        lines = {line["configuration"]: line for line in stored["table"] if line["metric"] == name}
        if not front or front[0] not in lines or 0 not in lines:
            continue
        own, best = (lines[number]["held_out"] for number in (0, front[0]))
        if "n" not in own or "n" not in best:
            continue
        never = str((stored.get("never") or {}).get(name, NEVER))
        unit = str(stored["units"].get(name, ""))
        p = (best.get("difference") or {}).get("p_adjusted")
        verdict = "" if p is None or p < LEVEL else f"{NOT_SIGNIFICANT}, "
        text = (
            f"{words(name)} on the held-out runs is {_mean(best, unit, never)} with "
            f"configuration {front[0]}, and {_mean(own, unit, never)} with the graph's own values"
        )
        yield _sentence(text, _p(p) and verdict + _p(p))


def of_contest(stored: Mapping[str, Any]) -> str:
    """The best contestant in the first metric, and whether the others differ significantly."""
    metric, is_largest = stored["metrics"][0], "maximize" in stored
    lines = [line for line in stored["table"] if line["metric"] == metric]
    own = {line["variant"]: line for line in lines}

    def rank(name: str) -> tuple[int, float]:
        mean = own[name]["mean"] if own[name]["n"] else 0.0
        return own[name]["runs"] - _count(own[name]), -mean if is_largest else mean

    best, *others = sorted(own, key=rank)
    unit, units = stored["units"].get(metric, ""), f"{stored['paired_by']}s"
    if not own[best]["n"]:
        return f"No contestant has a value of {words(metric)} in the held-out runs."
    never = str((stored.get("never") or {}).get(metric, NEVER))
    told = [_contestant(lines, best, name, unit, never) for name in others[:MOST]]
    rest = "largest" if is_largest else "smallest"
    mean, runs = _mean(own[best], unit, never), own[best]["runs"]
    text = f"{rest} {words(metric)} over {runs} held-out {units}: {best}, {mean}"
    text += f", instead of {'; '.join(told)}" * bool(told)
    return _sentence(text)


def _contestant(
    lines: Sequence[Mapping[str, Any]], best: str, name: str, unit: str, never: str
) -> str:
    """The mean of a contestant, and the verdict on its difference from the best."""
    line = next(line for line in lines if {line["variant"], line["reference"]} == {best, name})
    own = next(line for line in lines if line["variant"] == name)
    mean = _mean(own, unit, never)
    difference = line["difference"] or {}
    note = "" if _is_significant(line) else f"{NOT_SIGNIFICANT}, "
    p = _p(difference.get("p_adjusted"))
    if difference.get("verdict") == THESE:
        note, p = f"{THESE} differ, of one tuning each, ", _p(difference.get("p_of_these"))
    if difference.get("verdict") in (TOO_FEW, EQUAL, NEGLIGIBLE, SAME, UNRANKED):
        note, p = difference["verdict"], ""
    return f"{name}, {mean} ({note}{p})".replace(" ()", "").replace(", )", ")")


def _sentence(text: str, note: str = "") -> str:
    """A text with a capital letter, a note in brackets and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{f' ({note})' if note else ''}."
