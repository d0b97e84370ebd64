"""What passes before anything runs: whole processes."""

from __future__ import annotations

from functools import partial

from benchmarks.tables import Goal, figure, goals, table
from benchmarks.timing import process_seconds, take_turns

CLI = "import sys; from runtime.cli import main; main()"
FIRST_TICK = (
    "import runtime; "
    "runtime.load('line_actuator_failure').run(until=0.002, engine='{engine}').manifest['ticks']"
)
GRAPH = "line_actuator_failure"
CALLS: dict[str, tuple[tuple[str, ...], float | None]] = {
    "an empty Python process": (("-c", "pass"), None),
    "`import runtime`": (("-c", "import runtime"), None),
    "`runtime --help`": (("-c", CLI, "--help"), 0.3),
    f"`runtime validate {GRAPH}`": (("-c", CLI, "validate", GRAPH), 0.6),
    "first tick, Python engine": (("-c", FIRST_TICK.format(engine="python")), 1.0),
    "first tick, compiled engine, from its cache": (
        ("-c", FIRST_TICK.format(engine="compiled")),
        1.0,
    ),
}


def section(rounds: int) -> str:
    timings = take_turns(
        {name: partial(process_seconds, *arguments) for name, (arguments, _) in CALLS.items()},
        rounds,
    )
    rows = [[name, figure(timing, 1.0, "s", 2)] for name, timing in timings.items()]
    wanted = [
        Goal(f"{name} within {limit:g} s", timings[name].median, most=limit, unit=" s")
        for name, (_, limit) in CALLS.items()
        if limit is not None
    ]
    return "\n## Start-up\n\n" + table(["process", "wall time"], rows) + goals(wanted)
