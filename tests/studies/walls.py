"""Case C over conditions, controllers and seeds: a section of docs/reproduction.md."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import numpy as np

import runtime
from runtime.loader import SHIPPED
from tests.studies.claims import spread

FIRST_SEED = 10
CONDITIONS = {
    "ideal": (),
    "turn rate -35 %": ("turn_loss_35",),
    "turn rate -50 %": ("turn_loss_50",),
    "turn bias 0.15 rad/s": ("turn_bias",),
    "pose noise 5 cm, 0.1 rad": ("pose_noise",),
    "mixed": ("mixed",),
}
CONTROLLERS = ("LQR", "LQR + feedforward", "+ SNN as printed", "+ robust SNN")
SHOWN = ("distance_mae", "distance_mae_cylinders", "contacts", "loops")
Job = tuple[str, str, int]

HEAD = """
## Case C: following the walls of the paper's room

Mean |distance - 0.18 m| over the whole way from the contour on, along the cylinders in brackets, in
mm, over seeds {first} to {last}, which nothing was tuned on; then the share of runs that closed
the loop
and the share of time in contact. The paper: 110 mm for the LQR, 60 mm with the adaptive part.
A robot that turns on 0.2 m and makes no other error is {floor:.1f} mm off.
"""


def graph_of(controller: str, condition: str) -> runtime.Graph:
    """A controller's graph under a condition."""
    graph = runtime.load("wall_following" + ("_robust" if "robust" in controller else ""))
    if controller.startswith("LQR"):
        graph = graph.without("adaptive")
    if controller == "LQR":
        graph = graph.set("blocks.match.alpha", 0.0)
    for name in CONDITIONS[condition]:
        graph = graph.overlay(SHIPPED / "conditions" / f"{name}.yaml")
    return graph.set("plots", {})


def measure(job: Job) -> dict[str, float]:
    """One run's metrics; NaN where one has no value."""
    controller, condition, seed = job
    metrics = graph_of(controller, condition).run(seed=seed).metrics
    return {key: np.nan if value is None else float(value) for key, value in metrics.items()}


def section(seeds: int) -> str:
    """The section's text, measured now."""
    wanted = range(FIRST_SEED, FIRST_SEED + seeds)
    jobs = [(k, c, s) for c in CONDITIONS for k in CONTROLLERS for s in wanted]
    with ProcessPoolExecutor() as pool:
        results = dict(zip(jobs, pool.map(measure, jobs), strict=True))
    rows = []
    for condition in CONDITIONS:
        cells = [condition]
        for controller in CONTROLLERS:
            runs = [results[controller, condition, seed] for seed in wanted]
            whole, along, contacts, loops = (np.array([r[key] for r in runs]) for key in SHOWN)
            closed = float((loops >= 1.0).mean())
            cells.append(
                f"{spread(1e3 * whole, digits=1)} ({spread(1e3 * along, digits=1)}); "
                f"{closed:.0%}; {contacts.mean():.1%}"
            )
        rows.append("| " + " | ".join(cells) + " |\n")
    floor = 1e3 * results[jobs[0]]["distance_floor"]
    head = HEAD.format(first=wanted[0], last=wanted[-1], floor=floor)
    top = "| condition | " + " | ".join(CONTROLLERS) + " |\n|" + "---|" * (len(CONTROLLERS) + 1)
    return head + "\n" + top + "\n" + "".join(rows) + _paired(results, wanted)


def _paired(results: dict[Job, dict[str, float]], wanted: range) -> str:
    """In how many paired seeds the robust controller is better than LQR with feedforward."""
    lines = []
    for condition in CONDITIONS:
        better = [
            results["+ robust SNN", condition, seed]["distance_mae"]
            < results["LQR + feedforward", condition, seed]["distance_mae"]
            for seed in wanted
        ]
        lines.append(f"{condition}: {sum(better)} of {len(better)}")
    return "\nSeeds on which the robust SNN beats LQR + feedforward: " + "; ".join(lines) + ".\n"
