"""docs/ablation.md: the answers at its top, then the tables they are taken from."""

from __future__ import annotations

from runtime.experiments.analysis.estimates import (
    LEVEL,
)
from runtime.experiments.analysis.statistics import (
    CORRECTION,
)
from runtime.runs import versions
from tests.studies.ablation.conclusions import conclusions, opening, overview
from tests.studies.ablation.judge import MARGIN, Judged
from tests.studies.ablation.tables import worth
from tests.studies.following import ENGINE

HEAD = """# Does the spiking adaptive term help?

Written by `python -m tests.studies.ablation --seeds {seeds}` from the experiments in
`graphs/experiments`: {runs} runs with {n} seeds, on which nothing was tuned, by the {engine}
engine. One of these experiments is
`runtime ablate experiments/walls --with conditions/mixed.yaml --seeds {seeds}`.

* **A**: a line, half of the turn rate lost. **B**: y = sin x, pose noise of 5 cm and 0.1 rad.
  **C**: along the walls of the paper's room; *turn loss*: half of the turn rate lost; *turn bias*:
  0.15 rad/s; *mixed*: 30 % of the turn rate lost, lag, delay, slip and noise.
* **As printed** is the paper's learning rule, the **robust rule** that of
  `graphs/rules/robust.yaml`, with one setting for all cases.
* **The graph's LQR is not tuned**: soft by choice in A and B, so that there is something to learn.
  The *tuned LQR*, PID, PurePursuit and Stanley have the settings that `runtime tune` found with 40
  trials each, under a limit of effort (0.03 rad/s in A, 0.25 in B, 0.2 in C;
  `tests/studies/settings`). Whether a network is needed is asked by
  [the comparison](comparison.md), where everything is tuned together, several times; this page
  takes parts away and puts others in their place, and tunes nothing again. So the effort is not
  the same here: where something helps beside the tuned LQR, it may do so at a higher effort.

## In short

The answers are chosen from the numbers, by the rules [below](#how-to-read-this). They are about the
mean error: the distance to the line, to the path, or to the contour 180 mm from the walls.
"""

WORTH = """
## What the adaptive part adds to each controller

Each controller alone, then the difference that the adaptive part makes to it, with 95 % intervals
where the seeds differ. No word: the difference is not significant. "Closed" is on how many seeds
the robot went all the way round, "contact" the part of the run in which it touched something:
alone, as printed, with the robust rule.
"""

OVERVIEW = """
All answers about the mean error, in percent of the error without what is asked about, or with what
is replaced, with 95 % intervals. No word: the difference is not significant.
"""

READING = """
## How to read this

* A seed draws the noise and the neurons. Differences are paired: to the run with the same seed,
  and so with the same noise and neurons. Intervals, of 95 %, are Student's t of the mean
  difference, or by signed ranks where values are skewed or something is never reached: then of the
  ratio, in percent, where values are positive. What is never reached, as a run that failed, is
  worse than any value. In case A there is no noise: what has no neurons gives one and the same
  result on all seeds.
* A change **helps** or **hurts** where its difference is significant: p < {level:.2g}, corrected
  by {correction} for all {asked} comparisons of this page. "Not significant" does not mean
  that there is no difference: the interval shows how large it may be.
* What takes the place of something else does **as well** where the whole interval is within
  {margin:.0f} % of the error of what it replaces, else **better** or **worse** where
  the difference is significant.
* By Student's t alone, {other} of the {asked} verdicts would be different.
* All gains and learning rates were chosen on other seeds of the same cases. Whether a learner is
  slow by its rate or by its kind is asked by letting it learn twice as fast. How the rate of the
  printed rule was chosen is described in [reproduction.md](reproduction.md).
* An integrator learns one number, an ensemble a function of its input: as printed of the heading
  error in A and B, in C of the turn rate that LQR and feedforward ask for; with the robust rule
  of that turn rate and of the path's. The integrator's gain is that of the network in whose place
  it stands about an input of 0, worked out, not tuned.
* Case C is chaotic: single runs differ between machines and engines, while means agree.

Versions: {versions}.
"""


def page(judged: Judged, otherwise: Judged) -> str:
    """The whole page.

    Parameters
    ----------
    otherwise : the same questions, answered by another test.
    """
    results, effects = judged.results, judged.effects
    first = next(iter(results.values())).seeds
    head = HEAD.format(
        runs=sum(len(measured.values) * len(measured.seeds) for measured in results.values()),
        seeds=f"{first[0]}..{first[-1]}",
        n=len(first),
        engine=ENGINE,
    )
    reading = READING.format(
        level=LEVEL,
        correction=CORRECTION,
        asked=len(effects),
        margin=100 * MARGIN,
        other=sum(e.verdict != otherwise.effects[asked].verdict for asked, e in effects.items()),
        versions=", ".join(f"{name} {number}" for name, number in versions().items()),
    )
    answers = [f"{i}. {line}" for i, line in enumerate(conclusions(judged), start=1)]
    parts = [head, opening(judged), *answers, *_failures(judged), OVERVIEW, overview(judged)]
    parts += [WORTH, *worth(judged), reading]
    return "\n".join(parts)


def _failures(judged: Judged) -> list[str]:
    """Runs that did not end as they should."""
    broken = [f"* {line}" for measured in judged.results.values() for line in measured.broken]
    return ["\nRuns that failed, which is worse than any value:\n", *broken] if broken else []
