"""Sections of the page about what a tick costs."""

from __future__ import annotations

import math

from benchmarks import case_c, chains, peers
from benchmarks.contests import COMPILED, NENGO, NUMBA, PYTHON, VECTOR, C, Contest
from benchmarks.tables import Goal, against, faster, figure, goals, table, within
from benchmarks.timing import Timing, take_turns

SMALL = 100
CONSTANT, LINEAR = 1.2, 1.15


def case_a_section(contests: dict[int, Contest], rounds: int) -> str:
    text = (
        "\n## Case A as one graph\n\nTwo learning ensembles, plant, fault and saturation at 1 kHz; "
        "matching point, error and LQR at 100 Hz. In nengo the latter are Nodes that call the "
        "same block code, and the neurons are ours. The loops by hand know nothing but this "
        "diagram.\n"
    )
    for neurons, contest in contests.items():
        times = contest.times(rounds)
        text += f"\n### {neurons:,} neurons in each ensemble\n\n" + against(times, PYTHON)
        if neurons == SMALL:
            wanted = [
                faster("compiled at least 20x faster than nengo", times, COMPILED, NENGO, 20.0),
                within("compiled within 2x of the numba loop", times, COMPILED, NUMBA, 2.0),
                faster("Python engine at least 2x faster than nengo", times, PYTHON, NENGO, 2.0),
            ]
        else:
            wanted = [
                faster("compiled ahead of nengo", times, COMPILED, NENGO, 1.0),
                faster("Python engine ahead of nengo", times, PYTHON, NENGO, 1.0),
                within("compiled within 1.5x of the numba loop", times, COMPILED, NUMBA, 1.5),
            ]
        wanted += [
            within("compiled within 1.3 of C by hand", times, COMPILED, C, 1.3),
            within("compiled within 1.5 of the fastest C by hand", times, COMPILED, VECTOR, 1.5),
        ]
        text += goals(wanted)
    return text


def tracking_section(contests: dict[float, Contest], rounds: int) -> str:
    _, missing = peers.installed(peers.PEERS)
    notes = "".join(f"* {peer.title}: {peer.note}.\n" for peer in peers.PEERS)
    skipped = "".join(f"* {title} is skipped: it {reason}.\n" for title, reason in missing.items())
    text = (
        "\n## The control part without neurons\n\nUnicycle, line, error, feedback, sum, saturator "
        "and fault, one box each; Euler steps, the pose recorded at each. Ours are shipped blocks "
        "and, for the line, a block of five lines.\n\n" + notes + skipped
    )
    for dt, contest in contests.items():
        times = contest.times(rounds)
        text += f"\n### {1e3 * dt:g} ms\n\n" + against(times, PYTHON)
        wanted = [
            faster(f"Python engine at least 5x faster than {peer}", times, PYTHON, peer, 5.0)
            for peer in ("bdsim", "pathsim", "python-control")
        ]
        wanted += [
            faster(
                "Python engine ahead of pydrake with Python systems", times, PYTHON, "pydrake", 1.0
            ),
            within("compiled within 3x of the numba loop", times, COMPILED, NUMBA, 3.0),
            within("compiled within 1.5 of C by hand", times, COMPILED, C, 1.5),
        ]
        text += goals(wanted)
    return text


def chain_section(lengths: tuple[int, ...], rounds: int) -> str:
    costs: dict[int, Timing] = {}
    builds: dict[int, Timing] = {}
    for length in lengths:
        timings = take_turns(
            {
                "build": lambda n=length: chains.build_seconds(n),  # type: ignore[misc]
                "run": lambda n=length: chains.run_seconds(n),  # type: ignore[misc]
            },
            rounds,
        )
        costs[length] = Timing(timings["run"].seconds, length * chains.TICKS)
        builds[length] = timings["build"]
    rows = [
        [f"{n:,}", figure(costs[n], 1e9, "ns", 0), figure(builds[n], 1e3, "ms")] for n in lengths
    ]
    medians = [cost.median for cost in costs.values()]
    low, high = lengths[-2:]
    power = math.log(builds[high].median / builds[low].median) / math.log(high / low)
    wanted = [
        Goal(
            "cost per block and tick constant within 20 %: largest against smallest",
            max(medians) / min(medians),
            most=CONSTANT,
        ),
        Goal(
            f"build time linear: its power of the number of blocks, from {low:,} to {high:,}, at "
            f"most {LINEAR:g}",
            power,
            most=LINEAR,
            unit="",
        ),
    ]
    head = ["blocks", f"per block and tick, over {chains.TICKS} ticks", "read, check and plan"]
    return "\n## Chains of Gain blocks\n\nPython engine.\n\n" + table(head, rows) + goals(wanted)


def parts_section(rounds: int) -> str:
    parts = case_c.Parts()
    timings = take_turns(
        {"scan": parts.scan_seconds, "fit": parts.fit_seconds}, rounds, case_c.PLACES
    )
    rows = [
        ["a scan of 360 beams", figure(timings["scan"], 1e6, "µs")],
        [
            "a path from a scan: fit, offset, trim, fillet, refit",
            figure(timings["fit"], 1e3, "ms", 2),
        ],
    ]
    return (
        f"\n## Case C by parts\n\nScans of the paper's room from {case_c.PLACES} places along the "
        "walls, as the Python engine calls the blocks.\n\n" + table(["", "per call"], rows)
    )
