"""The answers in short: sentences, and one table of all questions about the error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from runtime.experiments.design.variants import BASELINE
from tests.studies.ablation.judge import (
    ALONE,
    APART,
    AS_WELL,
    BARE,
    BETTER,
    EXACT,
    FAST,
    FAST_INTEGRATOR,
    HELPS,
    HURTS,
    TRACKERS,
    TUNED,
    Effect,
    Judged,
)
from tests.studies.ablation.runs import CONFIGURATIONS, PRINTED, ROBUST, RULES
from tests.studies.ablation.words import Word, grouped, markdown, share, stands_in, tally, verdict

RATES, INTEGRATOR = "rate neurons", "integrator"
SPEED, TURN = "no adaptive speed", "no adaptive turn rate"
BLIND = "no feedforward"
FED = f"{TUNED} and feedforward"


@dataclass(frozen=True)
class Question:
    """What ``variant`` does to the error of ``against``, in a word for each configuration."""

    title: str
    rule: str
    variant: str
    against: str
    word: Word = verdict

    def answers(self, judged: Judged) -> list[Effect | None]:
        """One for each configuration; None where there is no such variant."""
        return [
            judged(configuration, self.rule, self.variant, self.against)
            if self.variant in judged.results[configuration, self.rule].values
            else None
            for configuration in CONFIGURATIONS
        ]

    def message(self, judged: Judged, numbers: bool = False) -> str:
        """The configurations by answer: 'helps in A; hurts in B'."""
        return grouped([e for e in self.answers(judged) if e is not None], self.word, numbers)


def _both(title: str, variant: str, against: str, word: Word = verdict) -> list[Question]:
    return [Question(f"{title}, {rule}", rule, variant, against, word) for rule in RULES]


ADDED = _both("SNN", BASELINE, ALONE)
BESIDE_TUNED = _both("SNN beside the tuned LQR", TUNED, TUNED + APART)
BESIDE_FED = _both("SNN beside LQR and feedforward, both tuned", FED, FED + APART)
UNAIDED = _both("SNN without feedforward", BLIND, BARE)
UNSPIKED = _both("rate neurons for spikes", RATES, BASELINE, stands_in)
INTEGRATED = _both("integrator for the SNN", INTEGRATOR, BASELINE, stands_in)
FASTER = _both("integrator for the SNN, both twice as fast", FAST_INTEGRATOR, FAST, stands_in)
OUTRUN = _both("integrator, twice as fast, for the SNN", FAST_INTEGRATOR, BASELINE, stands_in)
HASTY = _both("SNN twice as fast as the graph's", FAST, BASELINE)
STILL = Question("without the speed's half, as printed", PRINTED, SPEED, BASELINE, stands_in)
UNTURNED = Question("without the turn rate's half, as printed", PRINTED, TURN, BASELINE, stands_in)
FORWARD = Question("feedforward, no SNN", PRINTED, ALONE, BARE)
EXACTLY = Question("exact feedforward, no SNN", PRINTED, EXACT, BARE)
WITH_EXACT = _both("SNN beside exact feedforward", EXACT.removesuffix(APART), EXACT)
INSTEAD = [
    Question(f"{name} for LQR with SNN, robust rule", ROBUST, name + APART, BASELINE, stands_in)
    for name in (TUNED, FED, *TRACKERS)
]
ALL = [
    *(*ADDED, *BESIDE_TUNED, *BESIDE_FED, *UNAIDED, *WITH_EXACT, FORWARD, EXACTLY),
    *(*UNSPIKED, *INTEGRATED, *FASTER, *OUTRUN, *HASTY),
    *(STILL, UNTURNED, *INSTEAD),
]


def overview(judged: Judged) -> str:
    """All questions and configurations in one table."""
    rows = []
    for question in ALL:
        found = question.answers(judged)
        rows.append(
            [question.title, *("" if e is None else share(e, question.word) for e in found)]
        )
    return markdown(["", *(configuration.label for configuration in CONFIGURATIONS)], rows)


def opening(judged: Judged) -> str:
    """The question answered by counting."""

    def count(questions: Sequence[Question], *words: str) -> int:
        asked = ((q, e) for q in questions for e in q.answers(judged) if e is not None)
        return sum(question.word(effect) in words for question, effect in asked)

    def times(question: Question) -> str:
        return f"helps in {count([question], HELPS)} and hurts in {count([question], HURTS)}"

    both, least = len(RULES) * len(CONFIGURATIONS), (BETTER, AS_WELL)
    return (
        f"In the {len(CONFIGURATIONS)} configurations above the spiking term as printed "
        f"{times(ADDED[0])}; with the robust rule it {times(ADDED[1])}. In its place, rate neurons "
        f"do at least as well in {count(UNSPIKED, *least)} of {both} comparisons, a plain "
        f"integrator in {count(INTEGRATED, *least)}. In place of learning by the robust rule, "
        "beside the graph's LQR, a tuned LQR does at least as well in "
        f"{count(INSTEAD[:1], *least)} of {len(CONFIGURATIONS)}.\n"
    )


def conclusions(judged: Judged) -> list[str]:
    """The page's first sentences."""

    def sentence(questions: Sequence[Question]) -> str:
        printed, ours = (question.message(judged) for question in questions)
        if printed == ours:
            return f"{printed}, with either rule"
        return f"as printed, {printed}. With the robust rule, {ours}"

    return [
        f"**The printed rule**, beside the graph's LQR, which nobody tuned, and feedforward: "
        f"{ADDED[0].message(judged, numbers=True)}.",
        f"**The robust rule**, likewise: {ADDED[1].message(judged, numbers=True)}.",
        f"**Beside the tuned LQR**: {sentence(BESIDE_TUNED)}. With its feedforward tuned, too: "
        f"{sentence(BESIDE_FED)}.",
        f"**Beside PID, PurePursuit and Stanley**: {_trackers(judged)}.",
        f"**Do spikes matter?** Rate neurons in their place: {sentence(UNSPIKED)}.",
        f"**Does a network matter?** A plain integrator in its place: {sentence(INTEGRATED)}. Both "
        f"twice as fast: {sentence(FASTER)}.",
        f"**Which half?** As printed, without the speed's: {STILL.message(judged)}. Without the "
        f"turn rate's: {UNTURNED.message(judged)}. The robust rule has only the turn rate's.",
        f"**Feedforward alone**, beside the LQR: {FORWARD.message(judged, numbers=True)}. "
        f"The network "
        f"without it: {sentence(UNAIDED)}.",
        f"**Exact feedforward alone** (alpha = v_r where the graph has less): "
        f"{EXACTLY.message(judged, numbers=True)}. The network beside it: {sentence(WITH_EXACT)}.",
        f"**In place of learning**, against the graph's LQR with the robust rule. The tuned LQR: "
        f"{INSTEAD[0].message(judged)}; its feedforward tuned, too: {INSTEAD[1].message(judged)}. "
        f"PID, PurePursuit and Stanley: {_tally(judged, INSTEAD[2:])}.",
    ]


def _trackers(judged: Judged) -> str:
    printed, ours = (
        _tally(judged, [Question("", rule, name, name + APART) for name in TRACKERS])
        for rule in RULES
    )
    return f"as printed, {printed}. With the robust rule, {ours}"


def _tally(judged: Judged, questions: Sequence[Question]) -> str:
    """Questions with the same words, counted over all configurations."""
    found = [e for question in questions for e in question.answers(judged) if e is not None]
    return tally(found, questions[0].word)
