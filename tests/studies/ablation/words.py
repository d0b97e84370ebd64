"""Answers in words and cells, chosen from the numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from operator import attrgetter

from runtime.experiments.analysis.estimates import (
    Estimate,
)
from tests.studies.ablation.judge import AS_WELL, EQUAL, NOT_SIGNIFICANT, Effect, Metric
from tests.studies.ablation.runs import CONFIGURATIONS

Word = Callable[[Effect], str]
verdict: Word = attrgetter("verdict")
stands_in: Word = attrgetter("stands_in")
NO_EFFECT = (NOT_SIGNIFICANT, EQUAL)
PLAIN = (*NO_EFFECT, AS_WELL)  # what is not printed bold


def own(found: Estimate, runs: int, metric: Metric) -> str:
    """A mean with its interval, and on how many seeds there is one if not on all."""
    count = "" if found.n == runs else f" ({found.n} of {runs})"
    if not found.n:
        return f"never{count}"
    return f"{_span(found.mean, found.low, found.high, metric)}{count}"


def change(effect: Effect) -> str:
    """A difference with its interval and verdict."""
    metric = effect.asked.metric
    if effect.is_equal:
        return EQUAL
    counts = ""
    if effect.own.n != effect.base.n:
        counts = f"{effect.own.n} seeds against {effect.base.n}"
    if not effect.own.n or not effect.base.n:
        return _cell(counts, effect.verdict) if counts else "never"
    if math.isinf(effect.apart.mean):
        span = ""
    elif effect.apart.scale == "log ranks":
        span = percent(effect)
    else:
        span = _span(effect.apart.mean, effect.apart.low, effect.apart.high, metric, "+")
    return _cell(", ".join(part for part in (span, counts) if part), effect.verdict)


def _span(mean: float, low: float, high: float, metric: Metric, sign: str = "") -> str:
    def number(value: float) -> str:
        return _signed(value * metric.scale, metric.digits, sign)

    if math.isnan(low) or number(low) == number(high):
        return number(mean)
    return f"{number(mean)} [{number(low)}, {number(high)}]"


def share(effect: Effect, word: Word = verdict) -> str:
    """The same, as a part of the error that it is held against."""
    return EQUAL if effect.is_equal else _cell(percent(effect), word(effect))


def percent(effect: Effect) -> str:
    """A difference and its interval in percent."""
    mean, low, high = (_signed(100 * part) for part in effect.share)
    return (
        f"{mean} %" if math.isnan(effect.share[1]) or low == high else f"{mean} % [{low}, {high}]"
    )


def _signed(value: float, digits: int = 0, sign: str = "+") -> str:
    text = f"{value:{sign}.{digits}f}"
    return text.replace("-", "−") if text.strip("+-0.") else text.strip("+-")


def _cell(numbers: str, word: str) -> str:
    return numbers if word == NOT_SIGNIFICANT else f"{numbers} {_shown(word)}"


def _shown(word: str) -> str:
    return word if word in PLAIN else f"**{word}**"


def grouped(effects: Sequence[Effect], word: Word = verdict, numbers: bool = False) -> str:
    """Configurations by verdict: 'helps in A and B; not significant in C ideal'.

    Parameters
    ----------
    numbers : say how much, where it is significant.
    """
    groups: dict[str, list[str]] = {}
    for effect in effects:
        message = word(effect)
        number = f" ({percent(effect)})" if numbers and message not in NO_EFFECT else ""
        groups.setdefault(message, []).append(f"{effect.asked.configuration.label}{number}")
    if len(groups) == 1 and len(effects) == len(CONFIGURATIONS) and not numbers:
        return f"{_shown(word(effects[0]))} everywhere"
    ordered = sorted(groups.items(), key=lambda group: group[0] in NO_EFFECT)
    return "; ".join(f"{_shown(message)} in {listed(places)}" for message, places in ordered)


def tally(effects: Sequence[Effect], word: Word = verdict) -> str:
    """How often each verdict falls: 'helps 3 times, not significant 15 times, of 18'."""
    message = [word(effect) for effect in effects]
    ordered = sorted(dict.fromkeys(message), key=lambda name: (name in NO_EFFECT, name))
    counts = ", ".join(f"{_shown(name)} {_times(message.count(name))}" for name in ordered)
    return f"{counts}, of {len(message)}"


def _times(n: int) -> str:
    return "once" if n == 1 else f"{n} times"


def listed(texts: Sequence[str]) -> str:
    """A list in words."""
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table."""
    lines = ["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join(lines) + "\n"
