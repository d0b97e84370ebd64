"""All measurements in one run:  python -m benchmarks [rounds]  writes docs/performance.md."""

from __future__ import annotations

import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from benchmarks import case_a, case_c, chains
from benchmarks.timing import Timing, machine, process_seconds, take_turns

PAGE = Path(__file__).parent.parent / "docs" / "performance.md"
SECONDS = 10.0
FOLLOWING = 30.0

HEAD = """# Performance

Written by `python -m benchmarks`. Contestants take turns in one process on one machine, after a
round that does not count; figures are medians of {rounds} rounds, with the smallest and largest in
brackets. Building is left out of all per-tick figures.

Machine: {machine}. Packages: {packages}.
"""


def packages() -> str:
    found = []
    for name in ("numpy", "networkx", "nengo"):
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} is not installed")
    return ", ".join(found)


def figure(timing: Timing, scale: float, unit: str, digits: int = 1) -> str:
    """``33.1 us (32.9 to 34.0)``."""
    low, high = timing.spread
    values = [f"{scale * value:.{digits}f}" for value in (timing.median, low, high)]
    return f"{values[0]} {unit} ({values[1]} to {values[2]})"


def against_nengo(rounds: int) -> str:
    contestants = {"spikeblocks, Python engine": lambda: case_a.ours(SECONDS)}
    try:
        import nengo  # noqa: F401

        contestants["nengo"] = lambda: case_a.nengo_run(SECONDS)
        note = ""
    except ImportError:
        note = "\nnengo is not installed: pip install -e '.[bench]'\n"
    timings = take_turns(contestants, rounds, round(SECONDS / case_a.DT))
    ours = timings["spikeblocks, Python engine"].median
    rows = "".join(
        f"| {name} | {figure(t, 1e6, 'us')} | {t.median / ours:.2f} |\n"
        for name, t in timings.items()
    )
    return (
        "\n## Case A as one graph\n\nTwo learning ensembles of 100 neurons at 1 kHz, plant, fault "
        "and saturation at 1 kHz, matching point, error and LQR at 100 Hz. In nengo the latter "
        "are Nodes that call the same block code.\n\n"
        f"| | per tick | against ours |\n|---|---|---|\n{rows}{note}"
    )


def wall_following(rounds: int) -> str:
    parts = case_c.Parts()
    timings = take_turns(
        {"scan": parts.scan_seconds, "fit": parts.fit_seconds}, rounds, case_c.PLACES
    )
    whole = take_turns({"whole": lambda: case_c.run_seconds(FOLLOWING)}, rounds)["whole"]
    per_tick = Timing(whole.seconds, round(FOLLOWING / case_c.DT))
    return (
        f"\n## Case C by parts\n\nScans of the paper's room from {case_c.PLACES} places along the "
        f"walls; the whole graph with both ensembles at 1 kHz over {FOLLOWING:g} s by the Python "
        "engine.\n\n| | per call |\n|---|---|\n"
        f"| a scan of 360 beams | {figure(timings['scan'], 1e6, 'us')} |\n"
        f"| a path from a scan: fit, offset, trim, fillet, refit | "
        f"{figure(timings['fit'], 1e3, 'ms', 2)} |\n"
        f"| a tick of the whole graph | {figure(per_tick, 1e6, 'us')} |\n\n"
        f"The whole graph runs at {FOLLOWING / whole.median:.1f} times real time.\n"
    )


def chain_table(rounds: int) -> str:
    rows = ""
    for length in (10, 100, 1000, 2000):
        timings = take_turns(
            {
                "build": lambda n=length: chains.build_seconds(n),
                "run": lambda n=length: chains.run_seconds(n),
            },
            rounds,
        )
        build, run = timings["build"], timings["run"]
        per_block = Timing(run.seconds, length * chains.TICKS)
        rows += f"| {length} | {figure(per_block, 1e9, 'ns', 0)} | {figure(build, 1e3, 'ms')} |\n"
    return (
        "\n## Chains of Gain blocks\n\n"
        f"| blocks | per block and tick, over {chains.TICKS} ticks | read, check and plan |\n"
        f"|---|---|---|\n{rows}"
    )


def start_up(rounds: int) -> str:
    script = "import sys; from runtime.cli import main; main()"
    calls = {
        "`import runtime`": ("-c", "import runtime"),
        "`runtime --help`": ("-c", script, "--help"),
        "`runtime validate line_actuator_failure`": (
            "-c",
            script,
            "validate",
            "line_actuator_failure",
        ),
        "an empty Python process": ("-c", "pass"),
    }
    timings = take_turns(
        {name: (lambda a=arguments: process_seconds(*a)) for name, arguments in calls.items()},
        rounds,
    )
    rows = "".join(f"| {name} | {figure(t, 1.0, 's', 2)} |\n" for name, t in timings.items())
    return f"\n## Start-up\n\n| process | wall time |\n|---|---|\n{rows}"


def page(rounds: int) -> str:
    """docs/performance.md, measured now."""
    head = HEAD.format(rounds=rounds, machine=machine(), packages=packages())
    return (
        head
        + against_nengo(rounds)
        + wall_following(rounds)
        + chain_table(rounds)
        + start_up(rounds)
    )


if __name__ == "__main__":
    text = page(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
    PAGE.write_text(text, encoding="utf-8")
    print(text)
