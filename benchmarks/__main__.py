"""All measurements in one run:  python -m benchmarks [rounds] [--quick] [--against TREE]

``--only`` measures one section alone (``language``: the language server; ``continuous``: a loop of
continuous blocks; ``accuracy``: errors on closed loops; ``compiling``: start and speed of the
compiled engine), and replaces it in the page.

Writes docs/performance.md. First every implementation of a diagram must agree with the others to
1e-9; where one does not, nothing is timed and nothing is written. ``--quick`` tries everything on
few ticks and only prints: its figures mean nothing.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from benchmarks import (
    accuracy,
    compiling,
    continuous,
    environments,
    growth,
    language,
    monte_carlo,
    per_tick,
    physics,
    populations,
    real_time,
    sessions,
    start_up,
    stiff,
    sweeps,
    whole_loop,
)
from benchmarks.agreement import TOLERANCE, DisagreementError
from benchmarks.contests import Contest, case_a_contest, tracking_contest
from benchmarks.peers import PEERS
from benchmarks.timing import machine

PAGE = Path(__file__).parent.parent / "docs" / "performance.md"
PACKAGES = ("numpy", "networkx", "numba", "mujoco-core", "nengo", *(peer.package for peer in PEERS))

HEAD = """# Performance

Written by `python -m benchmarks`; goals and misses included. Contestants take turns in one process
on one machine, after a round that does not count; figures are medians, with the smallest and
largest in brackets; rounds: {rounds}. Building and compiling are left out of all per-tick figures.

Before anything was timed, all implementations of each diagram went the same way: no pose differs by
more than {apart:.1g} m or rad ({tolerance:g} is allowed).

Machine: {machine}. Packages: {packages}.
"""


@dataclass(frozen=True)
class Sizes:
    """How much of everything is run.

    Parameters
    ----------
    case_a : ticks for each number of neurons.
    tracking : ticks at each dt.
    chains : numbers of blocks.
    following : seconds of case C.
    seeds, nengo_seeds, until : of the Monte Carlo, and the length of its runs.
    """

    case_a: dict[int, int]
    tracking: dict[float, int]
    chains: tuple[int, ...]
    following: float
    seeds: int
    nengo_seeds: int
    until: float


FULL = Sizes(
    # 20 s, as the graph is shipped, where neurons that were silent for 8 s count.
    case_a={100: 20_000, 1000: 20_000, 10_000: 800},
    tracking={0.01: 2000, 0.001: 2000},
    chains=(10, 100, 1000),
    following=20.0,
    seeds=400,
    nengo_seeds=6,
    until=20.0,
)
QUICK = Sizes(
    case_a={100: 300, 1000: 100},
    tracking={0.01: 100, 0.001: 100},
    chains=(10, 100),
    following=12.0,
    seeds=4,
    nengo_seeds=2,
    until=0.5,
)


def packages() -> str:
    found = []
    for name in PACKAGES:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} is not installed")
    return ", ".join(found)


def say(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def page(rounds: int, sizes: Sizes, against: Path | None = None) -> str:
    """docs/performance.md, measured now; ``against`` is an earlier tree of this project.

    Raises
    ------
    DisagreementError : two implementations went different ways; nothing was timed.
    """
    apart = [0.0]

    def checked(found: tuple[Contest, float]) -> Contest:
        apart.append(found[1])
        say(f"{found[0].subject}: no pose apart by more than {found[1]:.1g}")
        return found[0]

    tracked = {dt: checked(tracking_contest(dt, n)) for dt, n in sizes.tracking.items()}
    case_a = {n: checked(case_a_contest(n, ticks)) for n, ticks in sizes.case_a.items()}
    loops = [whole_loop.planar(sizes.following), whole_loop.physics(sizes.following)]
    for loop in loops:
        say(f"{loop.title}: no pose apart by more than {loop.apart:.1g}")
    head = HEAD.format(
        rounds=rounds,
        apart=max(*apart, *(loop.apart for loop in loops)),
        tolerance=TOLERANCE,
        machine=machine(),
        packages=packages(),
    )
    sections = (
        lambda: per_tick.case_a_section(case_a, rounds),
        lambda: per_tick.tracking_section(tracked, rounds),
        *(partial(loop.section, rounds) for loop in loops),
        lambda: per_tick.parts_section(rounds),
        lambda: physics.section(rounds),
        lambda: populations.section(rounds, quick=sizes is QUICK),
        lambda: per_tick.chain_section(sizes.chains, rounds),
        lambda: monte_carlo.section(sizes.seeds, sizes.nengo_seeds, sizes.until, rounds),
        lambda: sweeps.section(min(sizes.seeds, sweeps.SEEDS), sizes.until, 1),
        lambda: growth.section(rounds, quick=sizes is QUICK),
        lambda: start_up.section(rounds),
        *(partial(each.section, rounds, quick=sizes is QUICK) for each in LOOPS),
        accuracy.section,
        lambda: language.section(rounds),
        lambda: environments.section(rounds),
        lambda: compiling.section(rounds, quick=sizes is QUICK),
        *([] if against is None else [lambda: compiling.section_against(rounds, against)]),
    )
    text = head
    for section in sections:
        text += section()
        say(text[text.rindex("\n## ") :].split("\n")[1])
    return text


def replaced(text: str, section: str) -> str:
    """The page with a section in the place of the one of the same heading, or at its end."""
    heading = section.lstrip("\n").split("\n")[0]
    before, found, rest = text.partition(f"\n{heading}\n")
    if not found:
        return text.rstrip("\n") + f"\n\n{section.strip()}\n"
    after = rest.find("\n## ")
    return before + section.rstrip("\n") + "\n" + (rest[after:] if after >= 0 else "")


def case_a_alone(rounds: int) -> str:
    """Case A, after all implementations went the same way."""
    found = {n: case_a_contest(n, ticks)[0] for n, ticks in FULL.case_a.items()}
    return per_tick.case_a_section(found, rounds)


def tracking_alone(rounds: int) -> str:
    """The control part, after all implementations went the same way."""
    found = {dt: tracking_contest(dt, ticks)[0] for dt, ticks in FULL.tracking.items()}
    return per_tick.tracking_section(found, rounds)


def monte_carlo_alone(rounds: int) -> str:
    return monte_carlo.section(FULL.seeds, FULL.nengo_seeds, FULL.until, rounds)


# What ``--only`` measures, of the number of rounds.
ALONE: dict[str, Callable[[int], str]] = {
    "accuracy": accuracy.section,
    "case_a": case_a_alone,
    "tracking": tracking_alone,
    "case_c": lambda rounds: whole_loop.planar(FULL.following).section(rounds),
    "case_c_by_parts": per_tick.parts_section,
    "robot_by_parts": physics.section,
    "chains": lambda rounds: per_tick.chain_section(FULL.chains, rounds),
    "case_c_with_physics": lambda rounds: whole_loop.physics(FULL.following).section(rounds),
    "populations": populations.section,
    "monte_carlo": monte_carlo_alone,
    "sweeps": lambda rounds: sweeps.section(sweeps.SEEDS, FULL.until, rounds),
    "compiling": compiling.section,
    "continuous": continuous.section,
    "environments": environments.section,
    "growth": growth.section,
    "language": language.section,
    "real_time": real_time.section,
    "sessions": sessions.section,
    "start_up": start_up.section,
    "stiff": stiff.section,
}


LOOPS = (continuous, stiff, real_time, sessions)
AGAINST = "against"  # of two trees


def measured_alone(name: str, rounds: int, against: Path | None) -> str:
    """One section, with where and under which load it was measured."""
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    note = f"`--only {name}`, rounds: {rounds}, on {machine()}; load before: {load}"
    section = ALONE[name] if name in ALONE else partial(compiling.section_against, against=against)
    return section(rounds).rstrip("\n") + f"\n\nMeasured by itself with {note}.\n"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("rounds", nargs="?", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="few ticks; print, write nothing")
    parser.add_argument("--against", type=Path, help="an earlier tree, see benchmarks/compiling.py")
    parser.add_argument("--only", choices=[*ALONE, AGAINST], help="measure this section alone")
    options = parser.parse_args()
    if options.rounds < 1:
        parser.error(f"rounds must be 1 or more, got {options.rounds}")
    if options.only == AGAINST and options.against is None:
        parser.error(f"--only {AGAINST} needs --against TREE")
    if options.only and options.quick:
        parser.error("--quick is for the whole page; give --only or --quick")
    if options.only:
        measured = measured_alone(options.only, options.rounds, options.against)
        text = replaced(PAGE.read_text(encoding="utf-8"), measured)
        PAGE.write_text(text, encoding="utf-8")
        return 0
    try:
        text = page(options.rounds, QUICK if options.quick else FULL, options.against)
    except DisagreementError as error:
        print(f"no table: {error}", file=sys.stderr)
        return 1
    if not options.quick:
        PAGE.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
