"""The sentences that the page of the contest begins with, chosen by rules from the numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tests.studies.contest import budgets, fronts
from tests.studies.contest.contestants import FED, FRONT, TASKS, Task
from tests.studies.contest.results import (
    CHANGE,
    ERROR,
    RIVAL,
    Contest,
    Contestant,
    Verdict,
    rival_of,
    verdicts,
)
from tests.studies.contest.words import MM, interval, listed, mm

SPIKES = ("robust rule", "our rule", "our rule, one setting", "SNN as printed")
BARE = "LQR without feedforward"
OTHERS = "our rule, "  # what stands in the neurons' place, or keeps its setting
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
    limits = []
    for name, found in contest.limits.items():
        rival = rival_of(found)
        if rival is not None:
            task = TASKS[name]
            limits.append(_Limit(name, task, rival, found, verdicts(found, rival, task.counts)))
    return [
        _protocol(limits),
        _rival(limits),
        _spikes(limits),
        _conditions(limits, contest),
        _without_spikes(limits, contest),
    ]


def _protocol(limits: Sequence[_Limit]) -> str:
    rival = limits[0].rival
    names = {one.name for limit in limits for one in limit.found}
    told = listed(
        [f"{limit.task.limit:g} rad/s ({limit.name}, case {limit.task.case})" for limit in limits]
    )
    judged = listed([f"{len(limit.rival.runs)} ({limit.name})" for limit in limits])
    return (
        f"Each of {len(names)} controllers got the same {rival.stored['trials']} trials of one "
        f"optimiser on the same training runs, under one limit of effort or more, {told}, and was "
        f"then judged on held-out runs, {judged}, with other seeds, starts, faults, paths and "
        "speeds, in case C with other rooms, more noise and a rigid-body plant, too."
    )


def _rival(limits: Sequence[_Limit]) -> str:
    parts = []
    for limit in limits:
        best = min(limit.found, key=lambda one: one.held_out(ERROR).mean)
        text = f"{interval(limit.rival.held_out(ERROR))} mm ({limit.name}"
        if best is not limit.rival:
            text += f"; the smallest error, {mm(best.held_out(ERROR).mean)} mm, has {best.name}"
        parts.append(f"{text})")
    untuned = limits[0].rival.line(ERROR, 0)["held_out"]["mean"]
    effort = limits[0].rival.line(CHANGE, 0)["training"]["mean"]
    return (
        f"An {RIVAL} with feedforward and no adaptation, tuned like everyone, is off by "
        f"{listed(parts)} on the held-out runs; in case C the same {RIVAL} with the gains of the "
        f"graph, which nobody tuned, by {mm(untuned)} mm at an effort of {effort:.3f} rad/s in "
        "training."
    )


def _spikes(limits: Sequence[_Limit]) -> str:
    by_word: dict[str, list[str]] = {word: [] for word in WORDS}
    for limit in limits:
        for name in SPIKES:
            if name in limit.against:
                verdict = limit.against[name]
                told = f"{name} ({limit.name}) {interval(verdict.difference, '+')} mm"
                by_word[verdict.word].append(told)
    count = sum(map(len, by_word.values()))
    parts = [
        f"*{word}* in {len(told)}: {', '.join(told)}" for word, told in by_word.items() if told
    ]
    counts = listed([f"{MM * limit.task.counts:g} mm ({limit.name})" for limit in limits])
    return (
        f"Against that tuned {RIVAL}, with {counts} as what counts, a spiking adaptive part that "
        f"is tuned together with its own {RIVAL} is, of {count} comparisons, {'; '.join(parts)}."
    )


def _conditions(limits: Sequence[_Limit], contest: Contest) -> str:
    walls = [limit for limit in limits if limit.task.case == TASKS[FRONT].case]
    counts = TASKS[FRONT].counts
    found = [
        (value, f"{name}, {limit.name}", condition)
        for limit in walls
        for name in SPIKES
        for one in limit.found
        if one.name == name
        for condition, value in one.against(limit.rival).items()
    ]
    least, most = min(found), max(found)
    gains = sum(value <= -counts for value, _, _ in found)
    losses = sum(value >= counts for value, _, _ in found)
    on_front = [
        any(one.name in SPIKES for one in members)
        for members in fronts.by_condition(contest).values()
    ]
    return (
        f"In case C, condition by condition, spiking adaptation lowers the mean error by at least "
        f"{MM * counts:g} mm in {gains} of {len(found)} cases and raises it as much in {losses}; "
        f"the largest gain is {mm(least[0], '+')} mm ({least[2]}; {least[1]}), the largest loss "
        f"{mm(most[0], '+')} mm ({most[2]}; {most[1]}); of all settings, one with spikes is on the "
        f"front of error against effort in {sum(on_front)} of {len(on_front)} conditions."
    )


def _without_spikes(limits: Sequence[_Limit], contest: Contest) -> str:
    parts = list(_bare(limits))
    for limit in limits:
        own = next((one for one in limit.found if one.name == "our rule"), None)
        for one in limit.found:
            if own is not None and one.name.endswith("for spikes"):
                apart = mm(one.held_out(ERROR).mean - own.held_out(ERROR).mean, "+")
                what = one.name.removeprefix(OTHERS).removesuffix(" for spikes")
                parts.append(f"an {what} for the neurons of our rule {apart} ({limit.name})")
    changed, count = budgets.changed(contest)
    told = (
        f"; doubling the budget of {budgets.names(contest)} changes {changed} of {count} verdicts"
        if count
        else ""
    )
    return f"What else the error depends on, in mm: {', '.join(parts)}{told}."


def _bare(limits: Sequence[_Limit]) -> Iterator[str]:
    for name, told in ((BARE, "leaving out the feedforward"), (FED, "tuning alpha, too,")):
        parts = [
            f"{interval(limit.against[name].difference, '+')} ({limit.name})"
            for limit in limits
            if name in limit.against
        ]
        if parts:
            yield f"{told} {listed(parts)}"
