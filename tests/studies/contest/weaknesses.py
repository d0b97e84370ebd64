"""Where a rule fails: after a fault has healed, under a constant bias, under noise of the range."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

import runtime
from runtime.experiments.analysis import difference, estimate
from tests.studies import variations
from tests.studies.contest.contestants import TASKS
from tests.studies.contest.words import MM, interval, table
from tests.studies.following import ENGINE

HERE = Path(__file__).parent
SEEDS = range(200, 210)
FILE = "weaknesses.json"
HEALED = 90.0  # s, when the fault of the contest's graph ends
SPANS = {
    "10 s after": (HEALED, HEALED + 10.0),
    "10 to 40 s after": (HEALED + 10.0, HEALED + 40.0),
}
LQR, PRINTED, LATERAL, ROBUST = "LQR", "as printed", "lateral rule", "robust rule, one setting"
RULES = {LQR: "walls.yaml", PRINTED: "walls.yaml", LATERAL: "lateral.yaml", ROBUST: "robust.yaml"}
HALF = {"fault.gain": [1.0, 0.5]}
NOISE = {
    "1 cm": {},
    "3 cm, which the fitter is not told": {"lidar.sigma": 0.03},
    "3 cm, which it is told": {"lidar.sigma": 0.03, "fitter.sigma": 0.03},
}
BIAS = {"fault.gain": [1.0, 1.0], "fault.bias": [0.0, 0.15], "run.until": 35.0}
TRACKS = {"A": "lateral_line.yaml", "B": "lateral_sine.yaml"}
ON_TRACK = {LQR: "LQR", PRINTED: "as printed", ROBUST: "robust"}
# Constants of each rule: address, and where it has an entry.
CONSTANTS = {
    LATERAL: (
        "adaptive.snn_omega.learning_rate",
        "adaptive.snn_omega.leak",
        "adaptive.snn_omega.radius",
        "adaptive.snn_omega.max_rates",
        "adaptive.snn_omega.tau_syn",
        "adaptive.snn_omega.limit",
        "adaptive.snn_v.learning_rate",
        "lateral.gain",
    ),
    ROBUST: (
        "adaptive.snn_omega.learning_rate",
        "adaptive.snn_omega.leak",
        "adaptive.snn_omega.e_leak",
        "adaptive.snn_omega.radius",
        "adaptive.snn_omega.max_rates",
        "adaptive.snn_omega.tau_syn",
        "adaptive.snn_omega.limit",
        "course.lookahead_time",
    ),
}

HEAD = """## What the rules do badly

Seeds {first} to {last}, beside the graph's own LQR and feedforward; nothing was tuned on these
seeds. Mean errors in mm with 95 % intervals.
"""
HEALS = """**After a fault has healed** (case C, half of the turn rate lost from 60 to 90 s): the
mean distance error in excess of that of the same run without the fault. The rule has unlearned in
time where the second interval is below {counts:g} mm.
"""
CONSTANT = """**A constant bias of 0.15 rad/s in case A**, 35 s: runs that settle within 0.1 m and
0.1 rad for good, and the lateral offset over the last 5 s.
"""
NOISY = """**Noise of the range** (case C without a fault, from when the contour is reached): the
rule's error, and in brackets what it adds to that of the LQR on the same runs.
"""
DIFFER = """**Constants that differ from case to case** (A, B, C), of those that the rule has:
{found}.
"""


def measure(folder: Path) -> None:
    """Run what the folder does not hold yet."""
    stored = folder / FILE
    if not stored.exists():
        found = {"heals": heals(), "bias": bias(), "noise": noise()}
        stored.write_text(json.dumps(found), encoding="utf-8")


def heals() -> dict[str, dict[str, list[float]]]:
    """For each rule and span (s) what the healed fault adds to the mean error (m) of each seed."""
    found = {}
    for rule in RULES:
        own: dict[str, list[float]] = {span: [] for span in SPANS}
        for seed in SEEDS:
            faulty, healthy = (_errors(walls(rule, fault), seed) for fault in (HALF, {}))
            for name, span in SPANS.items():
                own[name].append(faulty(span) - healthy(span))
        found[rule] = own
    return found


def _errors(graph: runtime.Graph, seed: int) -> Callable[[tuple[float, float]], float]:
    """The mean distance error (m) of a run between two times."""
    result = graph.run(seed=seed)
    error = np.abs(graph.network.world.distance(result["pose"][:, :2]) - 0.18)
    time = result.time("pose")
    return lambda span: float(error[(time >= span[0]) & (time < span[1])].mean())


def walls(rule: str, changes: Mapping[str, object]) -> runtime.Graph:
    """Case C with a rule of ``RULES``."""
    graph = runtime.load(str(HERE / RULES[rule]))
    return _set(graph.without("adaptive") if rule == LQR else graph, changes)


def _set(graph: runtime.Graph, changes: Mapping[str, object]) -> runtime.Graph:
    for path, value in {**changes, "plots": {}, "run.engine": ENGINE}.items():
        graph = graph.set(path, value)
    return graph


def track(case: str, rule: str) -> runtime.Graph:
    """Case A or B with a rule of ``RULES``."""
    if rule == LATERAL:
        return runtime.load(str(HERE / TRACKS[case]))
    return variations.graph_of(case, ON_TRACK[rule])


def bias() -> dict[str, dict[str, list[float | None]]]:
    """For each rule when each seed settles (s), and its lateral offset at the end (m)."""
    found = {}
    for rule in RULES:
        graph = _set(track("A", rule), BIAS).probe("lateral", "error.lateral", every=10)
        results = [graph.run(seed=seed) for seed in SEEDS]
        found[rule] = {
            "settled": [result.metrics["converged_at"] for result in results],
            "offset": [float(r["lateral"][r.time("lateral") >= 30.0].mean()) for r in results],
        }
    return found


def noise() -> dict[str, dict[str, list[float | None]]]:
    """For each rule and noise the mean error (m) of each seed."""
    return {
        rule: {
            name: [walls(rule, changes).run(seed=seed).metrics["error"] for seed in SEEDS]
            for name, changes in NOISE.items()
        }
        for rule in RULES
    }


def section(folder: Path) -> str:
    """The section of docs/comparison.md; empty if nothing was run."""
    if not (folder / FILE).exists():
        return ""
    stored = json.loads((folder / FILE).read_text(encoding="utf-8"))
    alone = stored["noise"][LQR]
    tables = (
        (
            HEALS.format(counts=MM * TASKS["gentle"].counts),
            ("rule", *SPANS),
            [
                (rule, *(interval(estimate(own[span]), "+") for span in SPANS))
                for rule, own in stored["heals"].items()
            ],
        ),
        (
            CONSTANT,
            ("rule", "settled", "mean time, s", "offset, mm"),
            [(rule, *_settled(own)) for rule, own in stored["bias"].items()],
        ),
        (
            NOISY,
            ("rule", *NOISE),
            [
                (rule, *(_added(own[name], alone[name], rule == LQR) for name in NOISE))
                for rule, own in stored["noise"].items()
            ],
        ),
    )
    parts = [HEAD.format(first=SEEDS[0], last=SEEDS[-1])]
    for text, header, rows in tables:
        parts += [text, table(header, rows)]
    told = (f"{rule} {differing(rule)} of {len(CONSTANTS[rule])}" for rule in CONSTANTS)
    return "\n".join((*parts, DIFFER.format(found="; ".join(told))))


def _settled(own: dict[str, Sequence[float | None]]) -> tuple[str, str, str]:
    known = [time for time in own["settled"] if time is not None]
    when = f"{np.mean(known):.1f}" if known else "-"
    offset = estimate([value for value in own["offset"] if value is not None])
    return f"{len(known)} of {len(own['settled'])}", when, interval(offset, "+")


def _added(own: list[float | None], alone: list[float | None], is_alone: bool) -> str:
    text = interval(estimate([value for value in own if value is not None]))
    return text if is_alone else f"{text} ({interval(difference(own, alone, 't'), '+')})"


def differing(rule: str) -> int:
    """How many of a rule's constants have another value in one of the cases A, B and C."""
    graphs = [track(case, rule) for case in variations.CASES]
    graphs.append(walls(rule, {}))
    count = 0
    for address in CONSTANTS[rule]:
        block, _, key = address.rpartition(".")
        values = {str(graph.network.entries[block].block.value(key)) for graph in graphs}
        count += len(values) > 1
    return count
