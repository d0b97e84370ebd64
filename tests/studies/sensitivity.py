"""The claims of cases A and B over the LQR's gains, which the paper does not give.

And a search: is there a setting at all in which all claims of case A hold?
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

import runtime
from tests.studies.cases import case, measured
from tests.studies.claims import LINE, SINE, holds_in_a, holds_in_b
from tests.studies.following import ENGINE, in_parallel

GAINS = (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
NETWORKS = 20
CLAIMS = {LINE: ("A1", "A2", "A3", "A4", "A5"), SINE: ("B1", "B2", "B3", "B4")}
DRAWN, STEPS, SEARCH_SEED = 1500, 500, 1
SEARCHED = (100, 101, 102)  # the networks of a setting

TEXT = """
## Claims against gains

The paper does not give the LQR's gains, and the verdicts above depend on them. Below, each claim is
judged as above with Q = q I and R = I, all else as in the graphs, over {networks} networks: the
share of the networks with which it holds, with its 95 % interval (Wilson). A2 is about a single
run, which has neither neurons nor noise.
"""

SEARCH = """
**Is there a setting in which all five claims of case A hold?** {found} {drawn} settings were drawn
at random, and {steps} more around the best ones (`tests/studies/sensitivity.py`, seed {seed}).
Drawn are each component of Q, the rates, the learning rate and the radius of the neurons, the
sampling period, what the network's input is, and a fault that biases the turn rate besides halving
it. A claim holds in a setting if it does with two of its three networks at least. The most claims
that hold at once are {most} of five, in {share} settings. {never}The numbers of settings in which
each holds: {each}.
"""


def wilson(held: int, runs: int, z: float = 1.959964) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson, 1927)."""
    share, size = held / runs, z * z / runs
    middle = share + 0.5 * size
    half = math.sqrt(size * share * (1.0 - share) + 0.25 * size * size)
    return max(0.0, (middle - half) / (1.0 + size)), min(1.0, (middle + half) / (1.0 + size))


def _shown(held: np.ndarray) -> str:
    if len(held) == 1:
        return "yes" if held[0] else "no"
    low, high = wilson(int(held.sum()), len(held))
    return f"{held.mean():.0%} [{low:.0%}, {high:.0%}]"


def _held(job: tuple[str, float, int]) -> dict[str, list[bool]]:
    """Whether each claim of a case holds with gains q, for each network."""
    name, q, networks = job
    adaptive = case(name, f"adaptive/{q:g}", networks)
    if name == LINE:
        found = holds_in_a(adaptive, case(name, f"lqr/{q:g}", 1))
    else:
        found = holds_in_b(adaptive, case(name, f"lqr/{q:g}", networks))
    return {claim: [bool(one) for one in held] for claim, held in found.items()}


def gain_rows(networks: int = NETWORKS) -> list[tuple[str, ...]]:
    """A row for each q."""
    jobs = [(name, q, networks) for q in GAINS for name in CLAIMS]
    held = in_parallel(_held, jobs)
    rows = []
    for q in GAINS:
        cells = []
        for name, claims in CLAIMS.items():
            found = held[name, q, networks]
            cells += [_shown(np.array(found[c][:1] if c == "A2" else found[c])) for c in claims]
        rows.append((f"{q:g}", *cells))
    return rows


@dataclass(frozen=True)
class Setting:
    """What is searched over; all but the input are numbers."""

    q_along: float
    q_lateral: float
    q_heading: float
    rate: float
    radius: float
    low_rate: float
    high_rate: float
    dt: float
    bias: float
    turn_input: str


# The ranges, on a logarithmic scale where they are positive.
RANGES = {
    "q_along": (1e-3, 10.0),
    "q_lateral": (1e-3, 10.0),
    "q_heading": (1e-3, 10.0),
    "rate": (1e-7, 1e-3),
    "radius": (0.3, 4.0),
    "low_rate": (20.0, 200.0),
    "high_rate": (200.0, 400.0),
    "dt": (0.002, 0.1),
}
BIAS = 0.2  # rad/s, the largest
INPUTS = ("error.heading", "error.lateral", "error.position")


def drawn(rng: random.Random) -> Setting:
    """A setting from all over the ranges."""
    values = {k: math.exp(rng.uniform(*map(math.log, ends))) for k, ends in RANGES.items()}
    return _valid(Setting(**values, bias=rng.uniform(-BIAS, BIAS), turn_input=rng.choice(INPUTS)))


def near(setting: Setting, rng: random.Random) -> Setting:
    """A setting beside another one."""
    values = {
        k: min(max(getattr(setting, k) * math.exp(rng.gauss(0.0, 0.3)), low), high)
        for k, (low, high) in RANGES.items()
    }
    bias = min(max(setting.bias + rng.gauss(0.0, 0.03), -BIAS), BIAS)
    return _valid(replace(setting, **values, bias=bias))


def _valid(setting: Setting) -> Setting:
    """With a sampling period of whole milliseconds, which are the steps of the run."""
    return replace(setting, dt=max(0.002, round(setting.dt, 3)))


def claims_of(setting: Setting) -> dict[str, bool]:
    """The claims of case A that hold with most of the networks."""
    graph = runtime.load(LINE).set("plots", {}).set("run.engine", ENGINE)
    graph = graph.probe("lateral", "error.lateral", every=10)
    changes = {
        "lqr.q": [setting.q_along, setting.q_lateral, setting.q_heading],
        "fault.bias": [0.0, setting.bias],
        **{f"{block}.dt": setting.dt for block in ("match", "error", "lqr")},
    }
    for path, value in changes.items():
        graph = graph.set(path, value)
    lqr = graph.without("adaptive").set("match.alpha", 0.0)
    for path, value in {
        "rate_omega": setting.rate,
        "radius": setting.radius,
        "max_rates": [setting.low_rate, setting.high_rate],
    }.items():
        graph = graph.set(f"adaptive.params.{path}", value)
    graph = graph.wire("adaptive.turn_input", setting.turn_input)
    held = holds_in_a(measured(graph, SEARCHED), measured(lqr, SEARCHED[:1]))
    return {claim: bool(2 * one.sum() > len(one)) for claim, one in held.items()}


def _settings(rng: random.Random, number: int) -> Iterator[Setting]:
    for _ in range(number):
        yield drawn(rng)


def search(number: int = DRAWN, steps: int = STEPS) -> dict[Setting, dict[str, bool]]:
    """All settings that were tried, and the claims that hold in each."""
    rng = random.Random(SEARCH_SEED)
    tried = in_parallel(claims_of, list(_settings(rng, number)))
    for _ in range(5):
        best = sorted(tried, key=lambda one: -sum(tried[one].values()))[:10]
        around = [near(best[i % len(best)], rng) for i in range(steps // 5)]
        tried |= in_parallel(claims_of, around)
    return tried


def searched(number: int = DRAWN, steps: int = STEPS) -> str:
    """What the search found, in words."""
    tried = search(number, steps)
    counts = [sum(held.values()) for held in tried.values()]
    names = CLAIMS[LINE]
    most = max(counts)
    best = [held for held, count in zip(tried.values(), counts, strict=True) if count == most]
    missing = [name for name in names if not any(held[name] for held in best)]
    verb = "is" if len(missing) == 1 else "are"
    never = f"{' and '.join(missing)} {verb} in none of these. " if missing else ""
    each = ", ".join(f"{name} {sum(held[name] for held in tried.values())}" for name in names)
    return SEARCH.format(
        found="One was found." if most == len(names) else "None was found.",
        drawn=number,
        steps=len(tried) - number,
        seed=SEARCH_SEED,
        most=most,
        share=f"{len(best)} of {len(tried)}",
        never=never,
        each=each,
    )
