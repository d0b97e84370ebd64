"""Cases A and B from other starts and on other paths than the paper's one setting."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

import runtime
from runtime.experiments.analysis import Estimate, difference, estimate
from tests.studies.following import ENGINE
from tests.studies.kept import kept

CASES = {"A": "line_actuator_failure", "B": "sine_estimation_error"}
GAINS = {"of the graph": None, "Q = R = 1": [1.0, 1.0, 1.0]}
LQR = "LQR"
RULES = (LQR, "LQR + feedforward", "as printed", "robust")
HEAD = "## Cases A and B beyond the paper's one setting"
TEXT = """
Fresh seeds {first} to {last}, nothing tuned on them. Each draws, besides neurons and noise, a start
(x in 0..3 m, y in -1..3 m, heading within a quarter turn of the path's) and in case B the path
(amplitude 0.5..1.5 m, wavelength 4..9 m); beside it, the same seeds in the paper's setting. Mean
position error in m (lateral in A; from 10 s on in B) with its 95 % interval, and the paired
difference from the LQR alone. `robust` is the shipped rule.
"""


def draw(case: str, seed: int) -> dict[str, object]:
    """What a seed changes of a case's graph."""
    rng = np.random.default_rng([seed, 7])
    x, y, turn = rng.uniform((0.0, -1.0, -0.5 * math.pi), (3.0, 3.0, 0.5 * math.pi)).tolist()
    changes: dict[str, object] = {"plant.x0": [x, y, turn]}
    if case == "B":
        amplitude, wavelength = rng.uniform((0.5, 4.0), (1.5, 9.0)).tolist()
        changes |= {"track.amplitude": amplitude, "track.wavelength": wavelength}
    return changes


def graph_of(case: str, rule: str) -> runtime.Graph:
    """A case's graph under one of ``RULES``."""
    graph = runtime.load(CASES[case] + ("_robust" if rule == "robust" else ""))
    if rule in RULES[:2]:
        graph = graph.without("adaptive")
    if rule == LQR:
        graph = graph.set("match.alpha", 0.0)
    return graph.set("plots", {}).set("run.engine", ENGINE)


def errors(
    case: str, rule: str, gains: list[float] | None, seeds: range, varied: bool
) -> list[float | None]:
    """The mean error (m) of each seed, in the paper's setting or in one that it draws."""
    graph = graph_of(case, rule)
    if gains is not None:
        graph = graph.set("lqr.q", gains)
    found = []
    for seed in seeds:
        changed = graph
        for path, value in draw(case, seed).items() if varied else ():
            changed = changed.set(path, value)
        key = f"variations {case} {rule} {gains} {seed} {varied}"
        found.append(kept(key, lambda g=changed, s=seed: g.run(seed=s).metrics["position_mae"]))
    return found


def rows(seeds: range) -> Iterator[tuple[str, ...]]:
    """A row for each case, gains and rule."""
    for case in CASES:
        for name, gains in GAINS.items():
            alone = [errors(case, LQR, gains, seeds, varied) for varied in (False, True)]
            for rule in RULES:
                cells = []
                for varied in (False, True):
                    own = errors(case, rule, gains, seeds, varied)
                    apart = difference(own, alone[varied], "t")
                    known = [value for value in own if value is not None]
                    cells += [
                        _interval(estimate(known)),
                        "" if rule == LQR else _interval(apart, "+"),
                    ]
                yield case, name, rule, *cells


def section(seeds: range) -> str:
    """The section of docs/reproduction.md."""
    header = (
        *("case", "gains", "controller", "the paper's setting", "against the LQR"),
        *("drawn settings", "against the LQR"),
    )
    lines = [header, ("---",) * len(header), *rows(seeds)]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return f"{HEAD}\n{TEXT.format(first=seeds[0], last=seeds[-1])}\n{table}\n"


def _interval(found: Estimate, sign: str = "") -> str:
    if math.isnan(found.low):  # identical runs have none
        return f"{found.mean:{sign}.3f}"
    return f"{found.mean:{sign}.3f} [{found.low:{sign}.3f}, {found.high:{sign}.3f}]"
