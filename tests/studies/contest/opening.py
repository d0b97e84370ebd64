"""The sentences that the page of the contest begins with, chosen by rules from the numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tests.studies.contest import budgets
from tests.studies.contest.contestants import FED, TASKS, Task
from tests.studies.contest.results import (
    ERROR,
    RIVAL,
    Contest,
    Contestant,
    Verdict,
    rival_of,
    verdicts,
)
from tests.studies.contest.words import interval, listed, mm, table

SPIKES = ("lateral rule", "robust rule", "robust rule, one setting", "SNN as printed")
BARE = "LQR without feedforward"
OURS = ("robust rule", "robust rule, one setting")
OTHERS = "robust rule, "  # what stands in the neurons' place, or keeps its setting
TABLE = """What spiking adaptation adds to the error of the tuned {rival}, on the same runs, in mm:
"""
WORDS = ("better", "equivalent", "undecided", "worse")


@dataclass(frozen=True)
class _Limit:
    """What was found under one limit of effort."""

    name: str
    task: Task
    rival: Contestant
    found: Sequence[Contestant]
    against: dict[str, Verdict]


def sentences(contest: Contest) -> list[str]:
    """The five sentences."""
    limits = _limits(contest)
    return [
        _protocol(limits),
        _rival(limits),
        _spikes(limits),
        _feedforward(limits),
        _without_spikes(limits, contest),
    ]


def verdict_table(contest: Contest) -> str:
    """What spiking adaptation changes, against the tuned LQR."""
    limits = _limits(contest)
    rows = []
    for name in SPIKES:
        told = (limit.against.get(name) for limit in limits)
        cells = ("" if v is None else f"{interval(v.difference, '+')} {v.word}" for v in told)
        rows.append((name, *cells))
    return f"{TABLE.format(rival=RIVAL)}\n{table(('', *map(_named, limits)), rows)}"


def _limits(contest: Contest) -> list[_Limit]:
    limits = []
    for name, found in contest.limits.items():
        rival = rival_of(found)
        if rival is not None:
            task = TASKS[name]
            limits.append(_Limit(name, task, rival, found, budgets.settled(contest, name, rival)))
    return limits


def _named(limit: _Limit) -> str:
    return f"case {limit.task.case} ({limit.name})"


def _protocol(limits: Sequence[_Limit]) -> str:
    rival = limits[0].rival
    names = {one.name for limit in limits for one in limit.found}
    return (
        f"{len(names)} controllers were tuned alike, each by the same optimiser with "
        f"{rival.stored['trials']} trials on the same training runs under the same limit of "
        "effort, and judged on held-out runs with other seeds, starts, faults, paths, speeds and "
        "rooms."
    )


def _rival(limits: Sequence[_Limit]) -> str:
    parts = []
    for limit in limits:
        errors = {one.name: one.held_out(ERROR).mean for one in limit.found}
        best = min(errors, key=lambda name: errors[name])
        least = "" if best == RIVAL else f"; the best, {best}, by {mm(errors[best])} mm"
        named = f"case {limit.task.case} ({limit.name}{least})"
        parts.append(f"{mm(errors[RIVAL])} mm in {named}")
    untuned = limits[0].rival.line(ERROR, 0)["held_out"]["mean"]
    return (
        f"An {RIVAL} with feedforward and no adaptation, tuned with the same budget, is off by "
        f"{listed(parts)}; with the gains of the graph, which nobody tuned, by {mm(untuned)} mm in "
        f"{_named(limits[0])}."
    )


def _spikes(limits: Sequence[_Limit]) -> str:
    by_word: dict[str, list[str]] = {word: [] for word in WORDS}
    for limit in limits:
        for name in SPIKES:
            if name in limit.against:
                by_word[limit.against[name].word].append(limit.task.case)
    count = sum(map(len, by_word.values()))
    parts = [
        f"{word} in {len(cases)} ({_cases(cases)})" for word, cases in by_word.items() if cases
    ]
    return (
        f"Against that tuned {RIVAL}, spiking adaptation that is tuned together with its own "
        f"{RIVAL} is, of {count} comparisons, {listed(parts)}."
    )


def _cases(cases: Sequence[str]) -> str:
    names = sorted(set(cases))
    return f"case{'s' if len(names) > 1 else ''} {listed(names)}"


def _feedforward(limits: Sequence[_Limit]) -> str:
    parts = [
        f"{interval(limit.against[BARE].difference, '+')} mm in {_named(limit)}"
        for limit in limits
        if BARE in limit.against
    ]
    text = f"Feedforward matters more: leaving it out costs {listed(parts)}"
    for limit in limits:
        fed = next((one for one in limit.found if one.name == FED), None)
        if fed is None:
            continue
        against = verdicts(
            [one for one in limit.found if one.name in SPIKES], fed, limit.task.counts
        )
        told = [
            f"the {name} by {interval(against[name].difference, '+')} mm ({against[name].word})"
            for name in OURS
            if name in against
        ]
        text += (
            f"; in {_named(limit)}, where the paper's alpha is wrong, an {RIVAL} whose alpha is "
            f"tuned, too, is off by {mm(fed.held_out(ERROR).mean)} mm, from which differ "
            f"{listed(told)}"
        )
    return f"{text}."


def _without_spikes(limits: Sequence[_Limit], contest: Contest) -> str:
    parts = []
    for limit in limits:
        own = next((one for one in limit.found if one.name == OURS[0]), None)
        for one in limit.found:
            if own is not None and one.name.endswith("for spikes"):
                apart = mm(one.held_out(ERROR).mean - own.held_out(ERROR).mean, "+")
                what = one.name.removeprefix(OTHERS).removesuffix(" for spikes")
                parts.append(f"{apart} mm ({what}, {limit.name})")
    changed, count = budgets.changed(contest)
    told = (
        f"; a doubled budget changes {changed} of {count} verdicts, counted as undecided"
        if count
        else ""
    )
    return (
        "Other learners in place of the robust rule's neurons, tuned like them, change its error "
        f"by {listed(parts)}{told}."
    )
